"""Packings from dimensionless groups: on target, at rest, reproducible, with the stiffnesses and adhesion asked for."""

import unittest
from unittest import mock

import numpy as np

import cells
import contact_loop
import packing
from cells import ADHESIVE, FRICTION, element, engine, measure, select, template

BONDED = {**ADHESIVE, "contact_law": "bonded"}
SOFT = cells.packing(kappa=100.0, stiffness_ratio=2.0, size_ratio=3.0, cohesion=2.0, confining_stress=2e5)


class Equilibrium(unittest.TestCase):
    def test_isotropic_stress_within_a_thousandth_and_at_rest(self):
        for spec in (FRICTION, ADHESIVE, BONDED, SOFT):
            with self.subTest(spec):
                sigma = spec["confining_stress"]
                stress, report, F = measure(element(spec))
                np.testing.assert_allclose(stress, -sigma * np.eye(3), rtol=0, atol=1e-3 * sigma)
                self.assertLess(report["unbalanced_force"], 1e-4)
                np.testing.assert_array_equal(F, np.eye(3))

    def test_equal_seeds_equal_bits_other_seeds_other_packings(self):
        first = engine().make_template({**FRICTION, "seed": 7})["manifest"]
        again = engine().make_template({**FRICTION, "seed": 7})["manifest"]
        other = engine().make_template({**FRICTION, "seed": 8})["manifest"]
        for key in ("porosity", "stress", "fabric", "unbalanced_force", "time_step"):
            self.assertEqual(first[key], again[key])
        self.assertNotEqual(first["fabric"], other["fabric"])

    def test_friction_during_compaction_makes_it_looser(self):
        loose = template({**FRICTION, "compaction_friction": 0.5})["manifest"]
        self.assertGreater(loose["porosity"], template(FRICTION)["manifest"]["porosity"] + 0.02)


class Contacts(unittest.TestCase):
    def test_sizes(self):
        O = select(element(SOFT))
        d = np.array([2 * b.shape.radius for b in O.bodies])
        self.assertAlmostEqual(d.mean(), 1e-3, delta=1e-15)
        self.assertLess(d.max() / d.min(), 3.0)
        self.assertGreater(d.max() / d.min(), 2.5)

    def test_stiffnesses_and_adhesion_are_equal_over_a_polydisperse_packing(self):
        kn, f_c = 100 * 2e5 * 1e-3, 2 * 2e5 * 1e-6
        c = contact_loop.contacts(select(element(SOFT)))
        for name, value in {
            "kn": kn,
            "ks": kn / 2,
            "normalAdhesion": f_c,
            "shearAdhesion": 0.5 * f_c,
            "unp": f_c / kn,
            "tangensOfFrictionAngle": 0.5,
        }.items():
            np.testing.assert_allclose(contact_loop.values(c, name), value, rtol=1e-12, err_msg=name)
        self.assertFalse(contact_loop.values(c, "fragile").any())
        self.assertTrue((contact_loop.values(c, "unpMax") == 0).all())

    def test_every_contact_of_the_adhesive_packing_overlaps_and_sticks(self):
        O = select(element(ADHESIVE))
        c = contact_loop.contacts(O)
        radius = np.array([b.shape.radius for b in O.bodies])
        self.assertTrue((radius[c.ids].sum(axis=1) > c.length).all())
        self.assertTrue(contact_loop.adhesive(c).all())

    def test_bonds_leave_the_forces_alone(self):
        c = contact_loop.contacts(select(element(BONDED)))
        self.assertTrue((contact_loop.values(c, "unp") == 0).all())
        self.assertTrue(contact_loop.values(c, "fragile").all())


class Numbers(unittest.TestCase):
    def loose(self):
        """Rows (x, y, z, radius) of the spheres before they touch, by number."""

        class Stopped(Exception):
            pass

        O = engine().O
        O.switchToScene(0)
        O.resetThisScene()
        with mock.patch.object(packing, "_Servo", side_effect=Stopped), self.assertRaises(Stopped):
            packing.prepare(O, {**FRICTION, "spheres": 200})
        return np.array([[*b.state.pos, b.shape.radius] for b in O.bodies])

    def test_spheres_near_to_one_another_have_near_numbers_and_are_those_of_the_seed(self):
        with mock.patch.object(packing, "_along_mortons_curve", lambda x: np.arange(len(x))):
            as_placed = self.loose()
        numbered = self.loose()
        self.assertEqual(set(map(tuple, numbered)), set(map(tuple, as_placed)))
        apart = [np.linalg.norm(np.diff(x[:, :3], axis=0), axis=1).mean() for x in (numbered, as_placed)]
        self.assertLess(apart[0], 0.5 * apart[1])
        ids = contact_loop.contacts(select(element({**FRICTION, "spheres": 200}))).ids
        self.assertLess(np.abs(ids[:, 0] - ids[:, 1]).mean(), 0.75 * 200 / 3)  # 200/3: numbers at random

    def test_contacts_of_a_saved_scene_are_in_the_order_of_the_numbers(self):
        O = select(element(ADHESIVE))
        self.assertTrue(O.interactions.serializeSorted)
        ids = [(i.id1, i.id2) for i in O.interactions]
        self.assertEqual(ids, sorted(ids))


if __name__ == "__main__":
    unittest.main()
