"""Each law for two spheres against its closed form: normal cycle, sliding cycle, loss, new contact."""

import unittest

import numpy as np

from two_spheres import DIAMETER, F_C, FRICTION, KN, Pair

STEP = 1e-7  # [m], a twentieth of f_c/kn
TOLERANCE = 1e-6 * F_C


def normal_path(law, path, overlap=4e-6):
    """Rows (overlap, normal force, contact?) along `path`, increments of the overlap in STEPs."""
    pair, rows = Pair(law, overlap), []
    for direction in path:
        pair.move(-direction * STEP, 0)
        rows.append((pair.overlap, pair.normal_force, pair.contact is not None))
    return np.array(rows)


def there_and_back(steps):
    return [-1] * steps + [1] * steps


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

    def test_bonded(self):
        rows = normal_path("bonded", there_and_back(80))
        opening, closing = rows[:80], rows[80:]
        bound = opening[:, 0] > -F_C / KN + 0.5 * STEP
        np.testing.assert_allclose(opening[bound, 1], KN * opening[bound, 0], rtol=0, atol=TOLERANCE)
        self.assertLess(opening[bound, 1].min(), -0.9 * F_C)
        broken = opening[:, 0] < -F_C / KN - 0.5 * STEP
        self.assertTrue(broken.any() and not opening[broken, 1].any())
        np.testing.assert_allclose(closing[:, 1], np.maximum(KN * closing[:, 0], 0), rtol=0, atol=TOLERANCE)


def slide(law, overlap, path, kt=KN):
    """Rows (overlap, normal force, shear force) along `path`, tangential increments in STEPs, and the pair."""
    pair, rows = Pair(law, overlap, kt), []
    for direction in path:
        pair.move(0, direction * STEP)
        rows.append((pair.overlap, pair.normal_force, pair.shear_force))
    return np.array(rows), pair


class Sliding(unittest.TestCase):
    """Cycles over three times the slip at the limit; the normal force follows the true overlap."""

    def cycle(self, law, overlap, limit, kt=KN):
        n = int(3 * limit / (kt * STEP))
        rows, pair = slide(law, overlap, [1] * n + [-1] * 2 * n + [1] * n, kt)
        return rows, pair, n

    def check_slider(self, rows, limit, kt=KN):
        """Elastic-plastic in the tangential slip s (which YADE takes at touching spheres, s d/(d - delta)): trial kt s,
        cut at the limit of the current overlap."""
        n = len(rows) // 4
        force, expected = 0.0, []
        for k, (m, overlap) in enumerate(zip(limit, rows[:, 0])):
            slip = STEP * DIAMETER / (DIAMETER - overlap)
            trial = force + kt * slip * (-1 if n <= k < 3 * n else 1)
            force = np.clip(trial, -m, m)
            expected.append(abs(force))
        np.testing.assert_allclose(rows[:, 2], expected, rtol=0, atol=TOLERANCE)
        at_limit = np.isclose(expected, limit, rtol=1e-12)
        self.assertGreater(at_limit.sum(), n)
        np.testing.assert_allclose(rows[at_limit, 2], limit[at_limit], rtol=0, atol=TOLERANCE)

    def test_friction(self):
        rows, _, _ = self.cycle("friction", 3e-6, FRICTION * KN * 3e-6, kt=KN / 2)
        np.testing.assert_allclose(rows[:, 1], KN * rows[:, 0], rtol=0, atol=TOLERANCE)
        self.check_slider(rows, FRICTION * KN * rows[:, 0], kt=KN / 2)

    def test_adhesive_limit_is_friction_times_the_elastic_force_and_sliding_leaves_the_adhesion(self):
        rows, pair, _ = self.cycle("adhesive", 5e-6, FRICTION * KN * 5e-6)
        np.testing.assert_allclose(rows[:, 1], KN * rows[:, 0] - F_C, rtol=0, atol=TOLERANCE)
        self.check_slider(rows, FRICTION * KN * rows[:, 0])
        p = pair.contact.phys
        self.assertEqual((p.normalAdhesion, p.shearAdhesion, p.cohesionBroken), (F_C, FRICTION * F_C, False))

    def test_adhesive_under_attraction_passes_no_normal_force_in_a_step_that_slides(self):
        """The stated deviation of YADE 2023.02a; the shear force follows the law."""
        rows, _, n = self.cycle("adhesive", 1e-6, FRICTION * KN * 1e-6)
        self.check_slider(rows, FRICTION * KN * rows[:, 0])
        slides = np.isclose(rows[:, 2], FRICTION * KN * rows[:, 0], rtol=1e-9)
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
    def test_has_no_adhesion_in_any_law(self):
        for law in ("friction", "adhesive", "bonded"):
            rows = normal_path(law, [1] * 40, overlap=-1e-6)
            touching = rows[:, 0] > 0.5 * STEP
            self.assertGreater(touching.sum(), 25)
            np.testing.assert_allclose(rows[touching, 1], KN * rows[touching, 0], rtol=0, atol=TOLERANCE)


if __name__ == "__main__":
    unittest.main()
