"""Each law for two spheres against its closed form: normal cycle, sliding cycle, loss, new contact."""

import unittest

import numpy as np

import contact_laws
from cells import ADHESIVE, element, engine, rate, select
from two_spheres import DIAMETER, F_C, FRICTION, KN, STEP, Pair, normal_path, slide, slider, sliding_cycle, there_and_back

TOLERANCE = 1e-6 * F_C


class Normal(unittest.TestCase):
    def test_friction(self):
        rows = normal_path("friction", there_and_back(60))
        np.testing.assert_allclose(rows[:, 1], np.maximum(KN * rows[:, 0], 0), rtol=0, atol=TOLERANCE)

    def test_adhesive_until_the_spheres_part(self):
        rows = normal_path("adhesive", there_and_back(39) + [1] * 20)
        self.assertTrue((rows[:, 0] > 0).all() and rows[:, 1].min() < -0.9 * F_C)
        np.testing.assert_allclose(rows[:, 1], KN * rows[:, 0] - F_C, rtol=0, atol=TOLERANCE)

    def test_adhesive_holds_on_over_the_stated_plateau_and_is_then_lost_for_good(self):
        rows = normal_path("adhesive", there_and_back(80))
        opening, closing = rows[:80], rows[80:]
        gap = -opening[:, 0]
        on_plateau = (gap > 0.5 * STEP) & (gap < F_C / KN - 0.5 * STEP)
        self.assertGreater(on_plateau.sum(), 15)
        np.testing.assert_allclose(opening[on_plateau, 1], -F_C, rtol=0, atol=TOLERANCE)
        self.assertFalse(opening[gap > F_C / KN + 0.5 * STEP, 2].any())
        self.assertFalse(opening[gap > F_C / KN + 0.5 * STEP, 1].any())
        again = closing[:, 0] > 0.5 * STEP
        np.testing.assert_allclose(closing[again, 1], KN * closing[again, 0], rtol=0, atol=TOLERANCE)

    def test_adhesive_closes_from_the_plateau_with_the_attraction_that_it_has_lost_there(self):
        """The second of the stated deviations: f_n = kn (delta + opening) - f_c ever after."""
        rows = normal_path("adhesive", [-1] * 50 + [1] * 50, overlap=4e-6)
        opening = -rows[:, 0].min()
        self.assertAlmostEqual(opening, 1e-6, delta=1e-12)
        back = rows[50:]
        np.testing.assert_allclose(back[:, 1], KN * (back[:, 0] + opening) - F_C, rtol=0, atol=TOLERANCE)

    def test_bonded(self):
        rows = normal_path("bonded", there_and_back(80))
        opening, closing = rows[:80], rows[80:]
        bound = opening[:, 0] > -F_C / KN + 0.5 * STEP
        np.testing.assert_allclose(opening[bound, 1], KN * opening[bound, 0], rtol=0, atol=TOLERANCE)
        self.assertLess(opening[bound, 1].min(), -0.9 * F_C)
        broken = opening[:, 0] < -F_C / KN - 0.5 * STEP
        self.assertTrue(broken.any() and not opening[broken, 1].any())
        np.testing.assert_allclose(closing[:, 1], np.maximum(KN * closing[:, 0], 0), rtol=0, atol=TOLERANCE)


class Sliding(unittest.TestCase):
    """Cycles over three times the slip at the limit; the normal force follows the true overlap."""

    def cycle(self, law, overlap, limit, kt=KN):
        path = sliding_cycle(3 * limit / kt)
        rows, pair = slide(law, overlap, path, kt)
        return rows, pair, path

    def check_slider(self, rows, path, limit, kt=KN):
        expected = np.abs(slider(rows[:, 0], path, limit, kt))
        np.testing.assert_allclose(rows[:, 2], expected, rtol=0, atol=TOLERANCE)
        at_limit = np.isclose(expected, limit, rtol=1e-12)
        self.assertGreater(at_limit.sum(), len(path) // 4)
        np.testing.assert_allclose(rows[at_limit, 2], limit[at_limit], rtol=0, atol=TOLERANCE)

    def test_friction(self):
        rows, _, path = self.cycle("friction", 3e-6, FRICTION * KN * 3e-6, kt=KN / 2)
        np.testing.assert_allclose(rows[:, 1], KN * rows[:, 0], rtol=0, atol=TOLERANCE)
        self.check_slider(rows, path, FRICTION * KN * rows[:, 0], kt=KN / 2)

    def test_adhesive_limit_is_friction_times_the_elastic_force_and_sliding_leaves_the_adhesion(self):
        rows, pair, path = self.cycle("adhesive", 5e-6, FRICTION * KN * 5e-6)
        np.testing.assert_allclose(rows[:, 1], KN * rows[:, 0] - F_C, rtol=0, atol=TOLERANCE)
        self.check_slider(rows, path, FRICTION * KN * rows[:, 0])
        p = pair.contact.phys
        self.assertEqual((p.normalAdhesion, p.shearAdhesion, p.cohesionBroken), (F_C, FRICTION * F_C, False))

    def test_adhesive_under_attraction_passes_no_normal_force_in_a_step_that_slides(self):
        """The stated deviation of YADE 2023.02a; the shear force follows the law."""
        rows, _, path = self.cycle("adhesive", 1e-6, FRICTION * KN * 1e-6)
        self.check_slider(rows, path, FRICTION * KN * rows[:, 0])
        slides = np.isclose(rows[:, 2], FRICTION * KN * rows[:, 0], rtol=1e-9)
        n = len(path) // 4
        self.assertTrue(slides.sum() > n and (~slides).sum() > n // 4)
        self.assertFalse(rows[slides, 1].any())
        np.testing.assert_allclose(rows[~slides, 1], KN * rows[~slides, 0] - F_C, rtol=0, atol=TOLERANCE)

    def test_bonded_is_friction_after_the_first_slip(self):
        rows, pair, _ = self.cycle("bonded", 3e-6, FRICTION * (KN * 3e-6 + F_C))
        np.testing.assert_allclose(rows[:, 1], KN * rows[:, 0], rtol=0, atol=TOLERANCE)
        first = np.argmax(np.diff(rows[:, 2]) < -TOLERANCE)
        self.assertAlmostEqual(rows[first, 2], FRICTION * (KN * 3e-6 + F_C), delta=2 * KN * STEP)
        self.assertLess(rows[first + 1 :, 2].max(), FRICTION * KN * 3e-6 + TOLERANCE)
        self.assertTrue(pair.contact.phys.cohesionBroken)


class NewContact(unittest.TestCase):
    def test_has_no_adhesion_in_any_law_unless_asked_for(self):
        for law in ("friction", "adhesive", "bonded"):
            rows = normal_path(law, [1] * 40, overlap=-1e-6)
            touching = rows[:, 0] > 0.5 * STEP
            self.assertGreater(touching.sum(), 25)
            np.testing.assert_allclose(rows[touching, 1], KN * rows[touching, 0], rtol=0, atol=TOLERANCE)

    def test_is_adhesive_as_the_others_when_asked_for(self):
        """From the next look on, at most contact_laws.EVERY steps after it formed, and again after it was lost."""
        path = [1] * 60 + there_and_back(100)
        rows = normal_path("adhesive", path, overlap=-1.03e-6, new_adhesion=(F_C, FRICTION))
        looks = 0
        for first, last in ((0, 60), (160, 260)):  # formed on the way in, and formed again on the way back
            touching = np.flatnonzero(rows[first:last, 0] > 0) + first
            plain = touching[np.abs(rows[touching, 1] - KN * rows[touching, 0]) <= TOLERANCE]
            stuck = np.setdiff1d(touching, plain)
            self.assertLess(len(plain), contact_laws.EVERY)
            self.assertTrue((np.diff(stuck) == 1).all() and stuck[-1] == touching[-1])
            np.testing.assert_allclose(rows[stuck, 1], KN * rows[stuck, 0] - F_C, rtol=0, atol=TOLERANCE)
            looks += len(stuck)
        self.assertGreater(looks, 80)
        lost = (rows[:, 0] < -F_C / KN - 0.5 * STEP) & (np.arange(len(rows)) > 60)
        self.assertTrue(lost.any() and not rows[lost, 2].any())


class OtherModes(unittest.TestCase):
    """What else CohFrict can do stays out, also of contacts that form while a volume element is strained."""

    FUNCTOR = "neverErase always_use_moment_law shear_creep twist_creep useIncrementalForm".split()
    PREPARED = {"fragile": None, "cohesionDisablesFriction": False, "momentRotationLaw": False, "initCohesion": False}
    PREPARED |= {"unpMax": 0.0, "creep_viscosity": -1.0}

    def test_every_contact_has_the_values_of_its_law_and_no_others(self):
        for law, new in (("adhesive", "frictional"), ("adhesive", "adhesive"), ("bonded", "frictional")):
            ve, f_c = element({**ADHESIVE, "contact_law": law}), 1e5 * 1e-6
            if new == "adhesive":
                contact_laws.make_new_contacts_adhesive(select(ve), f_c, 0.5)
                ve = engine().add(engine().save(ve))
            L = rate(ve, 1e-2, [[0.5, 0, 0], [0, -1, 0], [0, 0, 0]])
            engine().deform(ve, L, 60 * contact_laws.EVERY - contact_laws.steps_made(select(ve)) % contact_laws.EVERY)
            loop = select(ve).engines[2]
            functor, maker = loop.lawDispatcher.functors[0], loop.physDispatcher.functors[0]
            self.assertFalse(any(functor.dict()[mode] for mode in self.FUNCTOR))
            self.assertFalse(maker.setCohesionNow or maker.setCohesionOnNewContacts)
            plain = []
            for i in select(ve).interactions:
                p = i.phys
                for name, value in {**self.PREPARED, "fragile": law == "bonded"}.items():
                    if p.normalAdhesion > 0 or name not in ("fragile", "unpMax"):
                        self.assertEqual(getattr(p, name), value, name)
                sticks = p.normalAdhesion > 0
                adhesion = (f_c, 0.5 * f_c, False) if sticks else (0.0, 0.0, True)
                found = (p.normalAdhesion, p.shearAdhesion, p.cohesionBroken)
                np.testing.assert_allclose(found, adhesion, rtol=1e-12)
                unp = f_c / p.kn if sticks and law == "adhesive" else 0.0  # less where the plateau has been used
                self.assertTrue(0 <= p.unp <= unp * (1 + 1e-12))
                self.assertEqual((p.moment_twist.norm(), p.moment_bending.norm()), (0.0, 0.0))
                if not sticks:
                    plain.append(i.iterMadeReal)
            if new == "adhesive":  # but for those of the step in which the volume element rests
                plain = [step for step in plain if step < select(ve).iter]
            self.assertEqual(len(plain) > 0, new == "frictional")

    def test_a_contact_passes_no_moment(self):
        for law in contact_laws.LAWS:
            pair = Pair(law, 4e-6)
            pair.moving.state.blockedDOFs = "xyzXYZ"
            for _ in range(5):
                pair.moving.state.angVel = pair._vector(1.0, 0, 0)
                pair.move(0, 0)
            self.assertEqual(pair.O.forces.t(0).norm(), 0.0)
            self.assertEqual(pair.O.forces.t(1).norm(), 0.0)


if __name__ == "__main__":
    unittest.main()
