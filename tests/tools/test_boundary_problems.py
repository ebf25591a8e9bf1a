"""What a run cost, and whether a restart has the same bits, from the files that runs leave."""

import json
import sys
import tempfile
import types
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "validation" / "tools"))
import boundary_problems as problems
import campaign

HEADER = "step,time,load_factor,iterations,evaluations,dem_steps,residual,force,dem_seconds,wall_s\n"


class Files(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.runs = Path(temporary.name)
        self.c = types.SimpleNamespace(as_it_is=self.as_it_is)

    def as_it_is(self, name):
        folder = self.runs / name
        return campaign.Run(folder, 0, "step 2 rejected: stagnates\n", 5.0) if folder.exists() else None

    def write(self, name, rows, **summary):
        folder = self.runs / name
        folder.mkdir(parents=True)
        (folder / "history.csv").write_text(HEADER + "".join(rows))
        (folder / "summary.json").write_text(json.dumps({"ranks": 1, "threads": 2, "engine": "compact", **summary}))

    def test_cost(self):
        self.write("one", ["1,1,1,2,2,100,1e-3,-1,0.5,1800\n", "2,2,2,5,5,250,1e-3,-2,0.5,3600\n"])
        paid = problems.cost(self.as_it_is("one"))
        self.assertEqual((paid.steps, paid.evaluations, paid.most, paid.dem_steps), (2, 7, 5, 350))
        self.assertEqual((paid.wall, paid.core_hours, paid.rejected, paid.engine), (3600.0, 2.0, 1, "compact"))

    def test_the_wall_time_of_a_run_that_was_gone_on_with_is_that_of_all_its_sittings(self):
        self.assertEqual(problems.wall_seconds(np.array([10.0, 766.0, 48.0, 684.0])), 1450.0)
        self.assertEqual(problems.wall_seconds(np.array([10.0, 20.0])), 20.0)

    def test_strength_of_a_material_in_closed_form(self):
        phi, c, psi = np.radians(30), 0.2e5, np.radians(10)
        def element(sigma3):
            e = np.linspace(0.001, 0.02, 20)
            n = (1 + np.sin(phi)) / (1 - np.sin(phi))
            s1 = (n * sigma3 + 2 * c * np.sqrt(n)) * (1 - ((e - 0.01) / 0.05) ** 2)
            lateral = e * (1 + np.sin(psi)) / (1 - np.sin(psi))
            h = {"step": e, "stress_yy": -s1, "stress_xx": np.full(20, -sigma3), "strain_xx": lateral, "strain_yy": -e}
            return types.SimpleNamespace(history=lambda: h)
        found = problems.strength(element(1e5), element(2e5))
        np.testing.assert_allclose(found, (30, 0.2, 10), rtol=1e-12)

    def test_how_it_ended_has_no_path(self):
        said = "failed: stopped after step 49 (time 0.9), all steps up to it are in /a/b: unbalanced force 5.8e-01 after 10 steps, limit 5.0e-01; 19 of 19 trials"
        run = campaign.Run(self.runs, 4, said, 1.0)
        self.assertEqual(problems.how_it_ended(run), "stopped after step 49: unbalanced force 5.8e-01 after 10 steps, limit 5.0e-01")
        self.assertEqual(problems.how_it_ended(campaign.Run(self.runs, 0, "done: 3 steps", 1.0)), "done")
        self.assertEqual(problems.how_it_ended(campaign.Run(self.runs, 3, "odd", 1.0)), "exit status 3")

    def test_restart_with_the_same_bits_but_the_clocks(self):
        self.write("r/whole", ["1,1,1,2,2,100,1e-3,-1,0.5,1\n"])
        self.write("r/killed", ["1,1,1,2,2,100,1e-3,-1,0.7,9\n"])
        self.assertEqual(problems.bits_of_restart(self.c, "r"), (1, []))
        self.assertIn("same bits", problems.restart_line((1, []), "a case"))

    def test_a_restart_that_differs_is_named(self):
        self.write("r/whole", ["1,1,1,2,2,100,1e-3,-1,0.5,1\n"])
        self.write("r/killed", ["1,1,1,2,2,100,1e-3,-1.0000000000000002,0.5,1\n"])
        self.assertEqual(problems.bits_of_restart(self.c, "r"), (1, ["force"]))
        self.assertIn("**columns that differ: force**", problems.restart_line((1, ["force"]), "a case"))

    def test_a_restart_that_lacks_steps_differs(self):
        self.write("r/whole", ["1,1,1,2,2,100,1e-3,-1,0.5,1\n", "2,1,1,2,2,100,1e-3,-1,0.5,1\n"])
        self.write("r/killed", ["1,1,1,2,2,100,1e-3,-1,0.5,1\n"])
        self.assertIn("step", problems.bits_of_restart(self.c, "r")[1])

    def test_without_a_restart_there_is_nothing(self):
        self.assertIsNone(problems.bits_of_restart(self.c, "r"))


if __name__ == "__main__":
    unittest.main()
