"""The module femxdem for Python, as a notebook uses it.

    test_module.py BUILD CASES      BUILD: folder of the program and the module; CASES: the folder of this file
"""

import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

BUILD, CASES = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
sys.path.insert(0, str(BUILD))
import femxdem

KEPT = tempfile.TemporaryDirectory(prefix="femxdem_module_")
FOLDER = Path(KEPT.name)
CASE = FOLDER / "point.toml"
CASE.write_text("""
material = { type = "volume_element" }
ve = { spheres = 60, contact_law = "friction", cohesion = 0.0, inertial_number = 2e-2 }
[[path]]
strain_xx = 0.004
strain_yy = -0.008
increments = 4
[[path]]
strain_xy = 0.005
increments = 3
""")
CACHE = {"ve.cache": str(FOLDER / "packings")}


class Points(unittest.TestCase):
    def test_strained_by_hand_it_answers_as_the_path_to_the_bit(self):
        for engine in ("compact", "yade"):
            with self.subTest(engine=engine):
                case = {**CACHE, "ve.engine": engine}
                path = femxdem.run_path(CASE, FOLDER / engine, case)
                F, stress = path.tensors("F"), path.tensors("stress")
                self.assertEqual((F.shape, stress.shape, path.summary["engine"]), ((8, 3, 3), (8, 3, 3), engine))
                self.assertGreater(np.abs(stress[7] - stress[4]).max(), 1e3)
                with femxdem.VolumeElement(CASE, case) as ve:
                    found = ve.follow(F)
                np.testing.assert_array_equal(0.5 * (found["stress"] + found["stress"].transpose(0, 2, 1)), stress)
                np.testing.assert_array_equal(found["porosity"], path.history["porosity"])

    def test_a_trial_leaves_the_committed_state_and_a_failure_too(self):
        with femxdem.VolumeElement(CASE, CACHE) as ve:
            F = np.diag([1.0, 0.999, 1.0])
            first, C = ve.evaluate(F, stiffness=True)
            self.assertEqual(C.shape, (3, 3, 3, 3))
            np.testing.assert_allclose(C, C.transpose(1, 0, 2, 3))
            self.assertGreater(C[1, 1, 1, 1], C[0, 1, 0, 1])
            with self.assertRaisesRegex(femxdem.VolumeElementFailed, "det F = -1"):
                ve.evaluate(np.diag([-1.0, 1.0, 1.0]))
            with self.assertRaisesRegex(femxdem.VolumeElementFailed, "there is no trial|failed in this trial"):
                ve.commit()
            np.testing.assert_array_equal(ve.evaluate(F), first)
            with self.assertRaisesRegex(ValueError, "shape"):
                ve.evaluate(np.eye(2))
            ve.commit()
            self.assertGreater(ve.report["porosity"], 0.3)

    def test_a_refused_case_is_the_programs_sentence(self):
        with self.assertRaisesRegex(femxdem.FemxdemError, "ve.spheres.*exit status 2"):
            femxdem.VolumeElement(CASE, {"ve.spheres": -3})
        with self.assertRaisesRegex(femxdem.FemxdemError, "exit status 2"):
            femxdem.run_path(FOLDER / "nothing.toml")


class Runs(unittest.TestCase):
    def test_results_are_arrays(self):
        run = femxdem.run(CASES / "batch_law.toml", FOLDER / "law", {"control.end_time": 0.1})
        self.assertEqual(run.steps, [0, 1, 2, 3, 4, 5])
        self.assertEqual(run.step(5).fields["stress"].shape, (8, 4, 9))
        self.assertEqual(run.step().displacement.shape, run.mesh.nodes.shape)
        np.testing.assert_allclose(run.history["time"], [0.02, 0.04, 0.06, 0.08, 0.1])
        self.assertEqual(run.case["control"]["end_time"], 0.1)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
