"""The numbers of femxdem advise, on curves and costs that are known."""

import math
import sys
import tomllib
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "fe_master" / "program"))
import advice

STRAIN = np.linspace(0, 0.1, 101)


def path(stress, needed=12.0, strain=STRAIN, **more):
    values = {"dem_steps": 2000, "step_seconds": 1e-4, "adhesive": 0.9, "unbalanced": 0.1, **more}
    return advice.Path(strain, np.broadcast_to(np.asarray(stress, dtype=float), strain.shape).copy(), np.full(len(strain), needed), **values)


def peaked(height=4.0, at=0.02, residual=3.0):
    rising = 1 + (height - 1) * np.sin(np.minimum(STRAIN / at, 1) * math.pi / 2)
    return np.where(STRAIN < at, rising, residual + (height - residual) * np.exp(-(STRAIN - at) / 0.01))


class Curves(unittest.TestCase):
    def test_distance_is_relative_and_over_the_common_strain(self):
        self.assertAlmostEqual(advice.distance(path(1.1), path(1.0)), 0.1)
        short = path(1.1, strain=STRAIN[:50])
        self.assertAlmostEqual(advice.distance(short, path(1.0)), 0.1)

    def test_scatter_of_known_packings_and_the_spheres_that_it_asks_for(self):
        self.assertAlmostEqual(advice.scatter([path(x) for x in (0.9, 1.0, 1.1)]), 0.1)
        constant = advice.scatter_constant({100: (0.1, 3), 400: (0.05, 3)})
        self.assertAlmostEqual(constant, 1.0)
        self.assertEqual(advice.spheres_for(0.05, constant), 400)
        self.assertEqual(advice.spheres_for(0.049, constant), 450)
        self.assertEqual(advice.spheres_for(0.9, constant), advice.PACKING_STEP)

    def test_rate(self):
        paths = {2e-2: path(1.06), 1e-2: path(1.02), 5e-3: path(1.0)}
        self.assertEqual(advice.rate_for(0.03, paths), 1e-2)
        self.assertEqual(advice.rate_for(0.1, paths), 2e-2)
        self.assertEqual(advice.rate_for(0.01, paths), 5e-3)

    def test_what_any_small_change_does_averages_out_over_points(self):
        self.assertAlmostEqual(advice.beyond(0.05, 0.04, 1e9), 0.03)
        self.assertAlmostEqual(advice.beyond(0.03, 0.04, 16), 0.01)
        self.assertAlmostEqual(advice.beyond(0.04, 0.04, 1), 0.04)
        self.assertAlmostEqual(advice.beyond(0.05, 0.0, 1), 0.05)

    def test_peak_and_fall(self):
        strain, fall = advice.softening(path(peaked()))
        self.assertAlmostEqual(strain, 0.02, delta=0.002)
        self.assertAlmostEqual(fall, 0.25, delta=0.01)
        self.assertEqual(advice.softening(path(1 + STRAIN))[1], 0.0)

    def test_where_the_stress_stops_rising(self):
        self.assertAlmostEqual(advice.stops_rising(path(peaked())), 0.018, delta=0.002)
        plateau = np.minimum(1 + 100 * STRAIN, 4.0)
        self.assertAlmostEqual(advice.stops_rising(path(plateau)), 0.029, delta=0.002)
        self.assertGreater(advice.stops_rising(path(1 + STRAIN)), 0.06)

    def test_elastic_strain(self):
        bilinear = np.minimum(1 + 100 * STRAIN, 2 + 10 * (STRAIN - 0.01))
        self.assertAlmostEqual(advice.elastic_until(path(bilinear)), 0.013, delta=0.001)  # 0.8 of 100: at 1.29 %

    def test_path_of_history(self):
        zero, ones = np.zeros(3), np.ones(3)
        history = {f"{w}_{c}": zero for w in ("strain", "stress") for c in ("xx", "yy", "zz", "xy", "yz", "zx")}
        history |= {"stress_xx": -ones, "stress_zz": -2 * ones, "stress_yy": np.array([-3.0, -6.0, -9.0])}
        history |= {"strain_yy": np.array([0, -0.01, -0.02]), "strain_xy": np.array([0, 0.01, 0.02])}
        history |= {"dem_steps": np.array([0.0, 20, 60]), "evaluations": np.array([0.0, 2, 3]), "dem_seconds": ones}
        history |= {"inertial_number": np.array([0, 1e-2, 2e-2]), "adhesive_contacts": ones, "unbalanced_force": ones}
        p = advice.path_of(history, 2e-2)
        np.testing.assert_allclose(p.stress, [1.5, 3.0, 4.5])
        np.testing.assert_allclose(p.strain, [0, 0.01 * math.sqrt(3), 0.02 * math.sqrt(3)])
        self.assertAlmostEqual(p.step_seconds, (1 / 20 + 1 / 60) / 2)
        np.testing.assert_allclose(p.steps_needed, [0, 5, 20])  # the first trial was at half the rate: ve.min_steps


class Bands(unittest.TestCase):
    def test_thickness_goes_as_the_root_of_D(self):
        self.assertAlmostEqual(advice.band_thickness(2.5e3, 1e5), 0.572)
        self.assertAlmostEqual(advice.band_thickness(4 * 2.5e3, 1e5), 2 * 0.572)
        self.assertAlmostEqual(advice.band_thickness(advice.modulus_for(0.3, 2e5), 2e5), 0.3)


class Cost(unittest.TestCase):
    MEASURED = (  # spheres, I, tolerance, evaluations before and past: validation/biaxial, solver, quasi_static, advise
        (1000, 2e-2, 5e-3, 1.81, 2.38), (1000, 5e-3, 5e-3, 2.59, 3.92), (200, 2e-2, 5e-3, 2.25, 3.15),
        (200, 2e-2, 1e-3, 3.81, 4.83), (100, 2e-2, 5e-3, 2.44, 3.80), (100, 1e-2, 1e-2, 2.13, 4.39),
    )  # fmt: skip
    LEARNED = (  # with ve.answer = "mean" and solver.last_correction = "learned"; means of the packings
        (1000, 2e-2, 5e-3, 1.41, 1.83), (1000, 5e-3, 5e-3, 1.42, 2.18), (1000, 2e-3, 5e-3, 1.50, 2.30),
        (200, 2e-3, 5e-3, 2.02, 2.94), (1000, 5e-3, 1e-3, 2.38, 2.74), (200, 5e-3, 1e-3, 2.72, 4.69),
    )  # fmt: skip

    def test_evaluations_of_finished_runs(self):
        for runs, answers in ((self.MEASURED, ("end", "evaluated")), (self.LEARNED, ("mean", "learned"))):
            for spheres, rate, tolerance, before, past in runs:
                for measured, after in ((before, False), (past, True)):
                    ratio = advice.evaluations(spheres, rate, tolerance, after, answers) / measured
                    self.assertTrue(1 / 1.2 < ratio < 1.2, (spheres, rate, tolerance, after, answers, ratio))

    def test_steps_of_a_trial(self):
        self.assertEqual(advice.steps_of_a_trial(12.0, 10, 1.0), 12)
        self.assertEqual(advice.steps_of_a_trial(12.0, 10, 0.5), 0.5 * 24 + 0.5 * 10)

    def test_of_a_run_without_softening(self):
        c = advice.cost_of_run(path(1 + 100 * STRAIN**2), 512, 1000, 2e-2, 5e-3, 10, 0.5, 1e-4, True)
        past = int((STRAIN > advice.stops_rising(path(1 + 100 * STRAIN**2))).sum())  # the last few, near the largest stress
        self.assertLess(past, 5)
        self.assertAlmostEqual(c.evaluations, (100 - past) * 1.9 + past * 2.4)
        self.assertAlmostEqual(c.dem_steps, 512 * ((100 - past) * 1.9 * 12 + past * 2.4 * (0.5 * 24 + 0.5 * 10)))
        serial = c.evaluations * advice.SERIAL_SECONDS * 128
        self.assertAlmostEqual(c.core_hours, (c.dem_steps * 1e-4 + serial + advice.START_SECONDS) / 3600)
        self.assertEqual(c.ranks_that_pay(512, 1), int(c.dem_seconds / serial))
        self.assertEqual(c.ranks_that_pay(64, 8), 8)

    def test_past_the_peak_the_band_costs_more(self):
        c = advice.cost_of_run(path(peaked()), 512, 1000, 2e-2, 5e-3, 10, 0.4, 1e-4, True)
        none = advice.cost_of_run(path(1 + 100 * STRAIN**2), 512, 1000, 2e-2, 5e-3, 10, 0.4, 1e-4, True)
        self.assertGreater(c.evaluations, 1.15 * none.evaluations)
        self.assertGreater(c.dem_steps / c.evaluations, 1.2 * none.dem_steps / none.evaluations)


class Loads(unittest.TestCase):
    def test_of_the_biaxial(self):
        case = tomllib.loads((ROOT / "validation/biaxial/128.toml").read_text())
        (segment,) = advice.loading_path(case)
        self.assertAlmostEqual(segment["strain_yy"], math.log(0.9))
        self.assertEqual((segment["stress_xx"], segment["increments"]), (-1e5, 100))

    def test_own_path_and_none(self):
        own = [{"strain_yy": -0.1}]
        self.assertEqual(advice.loading_path({"path": own}), own)
        with self.assertRaisesRegex(ValueError, r"give the case a \[\[path\]\]"):
            advice.loading_path({"mesh": {"type": "gmsh"}, "load": [{"edge": "top", "component": "y", "value": -1}]})
        with self.assertRaisesRegex(ValueError, "shorten the specimen by 150%"):
            advice.loading_path({"mesh": {"height": 1.0}, "load": [{"edge": "top", "component": "y", "value": -1.5}]})


class Written(unittest.TestCase):
    TEXT = "# mine\n[ve]\nspheres = 100 # few\n\n[[ve.region]]\nspheres = 5\n\n[control]\nstep = 1\n"

    def test_values_replace_or_join_and_comments_stay(self):
        text = advice.with_values(self.TEXT, {("ve", "spheres"): 400, ("ve", "contact_law"): "friction", ("element", "D"): 2.5e3})
        self.assertIn("# mine", text)
        self.assertIn("spheres = 400 # few", text)
        case = tomllib.loads(text)
        self.assertEqual(case["ve"], {"spheres": 400, "contact_law": "friction", "region": [{"spheres": 5}]})
        self.assertEqual(case["element"], {"D": 2500.0})

    def test_what_is_written_in_another_way_is_said(self):
        with self.assertRaisesRegex(ValueError, "ve.spheres cannot be set in this file"):
            advice.with_values("ve.spheres = 100\n", {("ve", "spheres"): 400})


if __name__ == "__main__":
    unittest.main()
