"""Splits of an increment, strain cycles and large distortions of the cell; what is measured is printed."""

import unittest

import numpy as np

import contact_loop
from cells import FRICTION, element, engine, measure, packing, rate, select

SPEC = packing(spheres=100, contact_law="friction")
BIAXIAL = np.diag([0.5, -1.0, 0.0])
SHEAR = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])


def strained(ve, direction, strain, inertial_number=5e-3):
    """Goes `strain` along `direction` in as many steps as the rate asks for, 10 at least, as the bridge does; stress."""
    dt = engine().info(ve)["time_step"]
    per_step = np.linalg.norm(rate(ve, inertial_number, direction)) * dt / np.linalg.norm(direction)
    steps = max(10, int(np.ceil(abs(strain) / per_step)))
    engine().deform(ve, strain * direction / (steps * dt), steps)
    return measure(ve)[0]


def widths(O):
    """Distances between opposite faces of the cell [m]."""
    H = np.array(O.cell.hSize).reshape(3, 3)
    return 1 / np.linalg.norm(np.linalg.inv(H), axis=1)


def overlapping_pairs(O):
    """Pairs (i, j), i < j, that overlap by more than round-off, over all neighbouring images."""
    H = np.array(O.cell.hSize).reshape(3, 3)
    x = np.array([O.cell.wrap(b.state.pos) for b in O.bodies])
    r = np.array([b.shape.radius for b in O.bodies])
    pairs = set()
    shifts = np.stack(np.meshgrid(*[range(-2, 3)] * 3, indexing="ij"), -1).reshape(-1, 3) @ H.T
    for i in range(len(x)):
        d = np.linalg.norm(x[None, i + 1 :] + shifts[:, None] - x[i], axis=2)
        _, j = np.nonzero(d < (r[i] + r[i + 1 :]) * (1 - 1e-12))
        pairs.update((i, int(k) + i + 1) for k in j)
    return pairs


class Splits(unittest.TestCase):
    def test_one_increment_of_1e_3_against_ten_of_1e_4(self):
        """The least number of steps makes the ten slower: what they differ by is what half the rate differs by."""
        start = element(SPEC)
        strained(start, BIAXIAL, 5e-3)
        state, answers = engine().save(start), {}
        for name, increments, inertia in (("one", 1, 5e-3), ("ten", 10, 5e-3), ("half rate", 1, 2.5e-3)):
            ve = engine().add(state)
            for _ in range(increments):
                answers[name] = strained(ve, BIAXIAL, 1e-3 / increments, inertia)
        size = np.linalg.norm(answers["one"])
        split, noise = (np.linalg.norm(answers[name] - answers["one"]) / size for name in ("ten", "half rate"))
        print(f"ten increments against one: {split:.1e} of |stress|; half the rate: {noise:.1e}")
        self.assertLess(split, 2e-2)


class Cycles(unittest.TestCase):
    def work(self, ve, amplitude, pieces):
        """Work per volume over |stress| x amplitude of one cycle of shear, in `pieces` a quarter; the cell returns."""
        stress, work = measure(ve)[0], 0.0
        for sign in (1, -1, -1, 1):
            for _ in range(pieces):
                after = strained(ve, SHEAR + SHEAR.T, sign * amplitude / pieces)
                work += 0.5 * ((stress + after) * (SHEAR + SHEAR.T)).sum() * sign * amplitude / pieces
                stress = after
        return work / (np.linalg.norm(stress) * amplitude)

    def test_a_strain_cycle_dissipates_and_the_cell_returns(self):
        ve = element(SPEC)
        before = measure(ve)[0]
        dissipated = [self.work(ve, 2e-3, 5) for _ in range(2)]
        after, _, F = measure(ve)
        print(f"cycles of 2e-3: work {dissipated[0]:.2f}, {dissipated[1]:.2f} of |stress| x amplitude; "
              f"|stress| {np.linalg.norm(after) / np.linalg.norm(before):.2f} of the first")
        self.assertGreater(min(dissipated), 0.02)
        self.assertLess(np.abs(F - np.eye(3)).max(), 1e-5)  # products of symmetric steps turn by the amplitude squared

    def test_a_small_cycle_returns(self):
        ve = element(SPEC)
        before = measure(ve)[0]
        work = self.work(ve, 1e-6, 1)
        change = np.linalg.norm(measure(ve)[0] - before) / np.linalg.norm(before)
        print(f"cycle of 1e-6: work {work:.1e} of |stress| x amplitude, stress changed by {change:.1e}")
        self.assertLess(change, 1e-3)


class Distortion(unittest.TestCase):
    def test_at_50_per_cent_shear_no_contact_is_missing_or_too_many(self):
        ve = element(SPEC)
        for _ in range(5):
            strained(ve, SHEAR, 0.1, 2e-2)
            O = select(ve)
            found = {(min(i.id1, i.id2), max(i.id1, i.id2)) for i in O.interactions}
            self.assertEqual(found, overlapping_pairs(O))
            c = contact_loop.contacts(O)
            r = np.array([b.shape.radius for b in O.bodies])
            self.assertTrue((c.length < r[c.ids].sum(axis=1)).all())
        print(f"50 % shear: {len(found)} contacts, narrowest {widths(O).min() / r.max() / 2:.1f} diameters")
        self.assertAlmostEqual(measure(ve)[2][0, 1], 0.5, delta=1e-9)

    def test_a_cell_that_no_flip_makes_wide_enough_is_refused(self):
        ve = element(FRICTION)
        with self.assertRaisesRegex(RuntimeError, "too narrow"):
            for _ in range(30):
                strained(ve, np.diag([-1.0, 1.0, 0.0]), 0.1, 5e-2)


if __name__ == "__main__":
    unittest.main()
