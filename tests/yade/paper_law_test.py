"""The paper's law (contact_laws.py), which YADE has not, in compact cells: at rest where it starts, to the letter ever after.

Two spheres against its closed form: tests/bridge/paper_law_test.cpp.
"""

import unittest
from functools import cache

import numpy as np

import compact_cell
import compact_scene
from compact_cell import CompactCell

from cells import element, measure, packing, select, stiffness, template

SPHERES = 100
PAPER = {"spheres": SPHERES, "cohesion": 1.0, "contact_law": "paper"}
SPECS = {
    "plain": PAPER,
    "adhesive new contacts": {**PAPER, "new_contacts": "adhesive"},
    "dashpots": {**PAPER, "viscous_damping": 0.2, "seed": 2},
    "soft, strong": {**PAPER, "kappa": 100.0, "cohesion": 3.0, "stiffness_ratio": 2.0, "size_ratio": 3.0},
    "no cohesion": {**PAPER, "cohesion": 0.0},
}
SIGMA = 1e5


@cache
def exported(name):
    return compact_scene.export(select(element(packing(**SPECS[name]))))


def cell(name):
    return CompactCell.from_scene(exported(name))


def paths(c, inertial_number=2e-2):
    """Velocity gradients [1/s] without change of volume: random, back, compressed sideways."""
    first, rate = np.random.default_rng(1).standard_normal((3, 3)), inertial_number / c.info()["time_scale"]
    first -= np.trace(first) / 3 * np.eye(3)
    return [L * rate / np.linalg.norm(L) for L in (first, -first, np.diag([1.0, -1.0, 0.0]))]


def overlaps(scene):
    i, j = scene.ids.T
    d = scene.x[j] + scene.shift @ scene.H.T - scene.x[i]
    return scene.radius[i] + scene.radius[j] - np.linalg.norm(d, axis=1)


class Start(unittest.TestCase):
    def test_it_is_at_rest_under_the_stress_that_is_asked_for(self):
        for name in SPECS:
            c = cell(name)
            np.testing.assert_allclose(c.stress(), -SIGMA * np.eye(3), rtol=0, atol=1e-3 * SIGMA, err_msg=name)
            self.assertLess(c.report()["unbalanced_force"], 1e-4, name)
            before = c.stress()
            c.deform(np.zeros((3, 3)), 500)
            np.testing.assert_allclose(c.stress(), before, rtol=0, atol=1e-4 * SIGMA, err_msg=name)

    def test_yades_scene_of_it_is_the_same_but_where_attraction_slides(self):
        """The scene holds unp = f_c/kn: what `ve inspect` draws and the manifest says."""
        for name in SPECS:
            ve = element(packing(**SPECS[name]))
            stress, report, _ = measure(ve)
            c = cell(name)
            np.testing.assert_allclose(stress, c.stress(), rtol=0, atol=1e-3 * SIGMA, err_msg=name)
            self.assertEqual(report["contacts"], c.report()["contacts"])
            self.assertEqual(report["adhesive_contacts"], c.report()["adhesive_contacts"])
            np.testing.assert_allclose(stiffness(ve), c.stiffness("affine"), rtol=0, atol=1e-10 * stiffness(ve).max())

    def test_dashpots_shorten_the_time_step(self):
        plain, damped = (template(packing(**PAPER, viscous_damping=ratio))["manifest"] for ratio in (0.0, 0.5))
        self.assertLess(damped["time_step"], 0.8 * plain["time_step"])


class Law(unittest.TestCase):
    def test_every_contact_to_the_letter_after_any_path(self):
        for name, spec in SPECS.items():
            c, f_c = cell(name), spec["cohesion"] * SIGMA * 1e-6
            for L in paths(c):
                c.deform(L, 300)
                if "viscous_damping" in spec:
                    c.rest()
                scene, report = compact_scene.Scene(c.to_scene()), c.report()
                delta, adhesion = overlaps(scene), scene.normal_adhesion
                self.assertGreaterEqual(delta.min(), 0, f"{name}: a contact ends with its overlap")
                elastic = scene.kn * delta
                np.testing.assert_allclose(scene.normal_force, elastic - adhesion, rtol=0, atol=1e-9 * elastic.max())
                shear = np.linalg.norm(scene.shear, axis=1)
                self.assertTrue((shear <= 0.5 * elastic * (1 + 1e-12) + 1e-12 * elastic.max()).all(), name)
                self.assertEqual(report["adhesive_contacts"], (adhesion > 0).mean(), name)
                np.testing.assert_allclose(report["sliding_contacts"], (shear >= (1 - 1e-6) * 0.5 * elastic).mean(), atol=0.01)
                self.assertTrue(np.isin(adhesion, (0.0, f_c)).all() or np.allclose(adhesion[adhesion > 0], f_c))
            self.assertGreater(-np.trace(c.stress()), 0.3 * SIGMA, f"{name}: it is under pressure")
            sliding = shear >= (1 - 1e-6) * 0.5 * elastic
            self.assertGreater(sliding.sum(), 0, name)
            if f_c > 0:
                self.assertGreater((sliding & (scene.normal_force < 0)).sum(), 0, f"{name}: attraction slides")
                self.assertEqual(report["adhesive_contacts"] == 1, "new_contacts" in spec, f"{name}: contacts were gained")

    def test_kernels_and_a_restart_give_equal_bits(self):
        for name in SPECS:
            saved = set()
            for kernel in compact_cell.kernels():
                compact_cell.use_kernel(kernel)
                c, restarted = cell(name), None
                for L in paths(c):
                    restarted = CompactCell.load((restarted or c).save())
                    for v in (c, restarted):
                        v.rest()
                        v.deform(L, 150)
                        v.hold(20)
                self.assertEqual(restarted.save(), c.save(), name)
                saved.add(c.save())
            self.assertEqual(len(saved), 1, f"{name}: kernels differ")


if __name__ == "__main__":
    unittest.main()
