"""What a run cost, and whether a restart has the same bits, from the files that runs leave."""

import json
import sys
import tempfile
import types
import unittest
from pathlib import Path

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
