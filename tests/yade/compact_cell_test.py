"""The compact cell against YADE with loopOnSortedInteractions: equal bits; its reports against YADE's; its states."""

import os
import unittest
from functools import cache
from unittest import mock

import numpy as np

import compact_cell
import compact_scene
import contact_laws
from compact_cell import CompactCell
from volume_element import END_STRESS

from cells import FIELDS, element, engine, mandel, measure, packing, select, stiffness

SPHERES = 100
SPECS = {
    "friction": {"contact_law": "friction"},
    "adhesive": {"cohesion": 1.0},
    "bonded": {"cohesion": 1.0, "contact_law": "bonded"},
    "adhesive new contacts": {"cohesion": 1.0, "new_contacts": "adhesive", "seed": 2},
    "stiff and shear-stiff": {"contact_law": "friction", "kappa": 10000.0, "stiffness_ratio": 0.2},
    "soft, wide sizes": {"cohesion": 2.0, "kappa": 100.0, "stiffness_ratio": 2.0, "size_ratio": 4.0},
}
SHEAR_AND_ROTATION = np.array([[0.0, 1.5, 0.0], [-0.5, 0.0, 0.3], [0.0, 0.0, 0.0]])
ROUND_OFF = {"turned"}  # orientations act on nothing; YADE's come from libm's sine
COUNTED_APART = {"iteration"}


def sorted_element(spec):
    ve = element(packing(**{"spheres": SPHERES, **spec}))
    select(ve).engines[2].loopOnSortedInteractions = True
    return ve


@cache
def exported(name):
    return compact_scene.export(select(sorted_element(SPECS[name])))


def cell(name):
    return CompactCell.from_scene(exported(name))


def rates(c, inertial_number=2e-2, seed=1):
    """Velocity gradients [1/s]: random ones, a reversal, shear with rotation, a hold, expansion and compression."""
    rng = np.random.default_rng(seed)
    first, second = rng.standard_normal((2, 3, 3))
    for L in (first, second, -second, SHEAR_AND_ROTATION, np.zeros((3, 3)), np.eye(3), -np.eye(3)):
        yield L * inertial_number / c.info()["time_scale"] / max(np.linalg.norm(L), 1e-300)


def differences(a, b, but=ROUND_OFF):
    """Names of what differs between two exports, or how far where only round-off may."""
    a, b = compact_scene.Scene(a), compact_scene.Scene(b)
    names = [name for name in vars(a) if not name.startswith("_") and name not in but]
    for name in but & ROUND_OFF:
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=0, atol=1e-13)
    return [name for name in names if not np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)]


def on_the_plateau(c):
    """Contacts in tension at -f_c, or at none because they slide there: their limit of the shear force is mu f_c - mu f_c,
    zero or what round-off makes of it."""
    scene = compact_scene.Scene(c.to_scene())
    at_the_end = (scene.normal_force == -scene.normal_adhesion) | (scene.normal_force == 0)
    return ((scene.normal_adhesion > 0) & at_the_end).sum()


class Bits(unittest.TestCase):
    def test_an_export_is_read_and_given_back(self):
        for name in SPECS:
            self.assertEqual(differences(cell(name).to_scene(), exported(name), set()), [], name)

    def test_equal_yade_after_1_10_and_100_steps_of_every_kernel(self):
        for name, spec in SPECS.items():
            ve = sorted_element(spec)
            O = select(ve)
            cells = {}
            for kernel in compact_cell.kernels():
                cells[kernel] = cell(name)
            sets = set()
            for L, steps in zip(rates(cell(name)), (1, 10, 100, 133, 7, 160, 160)):
                engine().deform(ve, L, steps)
                state = compact_scene.export(O)
                sets.add(compact_scene.Scene(state).ids.tobytes())
                for kernel, c in cells.items():
                    compact_cell.use_kernel(kernel)
                    c.deform(L, steps)
                    self.assertEqual(differences(c.to_scene(), state), [], f"{name}, {kernel}, {steps} steps")
            self.assertGreater(len(sets), 4, "contacts are lost and gained")
            saved = {c.save() for c in cells.values()}
            self.assertEqual(len(saved), 1, f"{name}: kernels differ")

    def test_a_split_of_the_steps_changes_nothing(self):
        for name in ("bonded", "adhesive new contacts"):
            one, other = cell(name), cell(name)
            L = next(rates(one))
            one.deform(L, 90)
            for steps in (1, 29, 60):
                other.deform(L, steps)
            self.assertEqual(one.save(), other.save())


class States(unittest.TestCase):
    def test_copies_share_nothing_and_an_assignment_brings_the_same_bits(self):
        base = cell("adhesive")
        before, trial = base.save(), base.copy()
        for L in rates(base):
            trial.assign(base)
            trial.deform(L, 20)
            first = trial.save()
            trial.assign(base)
            trial.deform(L, 20)
            self.assertEqual(trial.save(), first)
        self.assertEqual(base.save(), before)

    def test_a_cell_takes_no_more_room_than_the_larger_one_that_it_becomes(self):
        small, large = sorted((cell("adhesive"), cell("soft, wide sizes")), key=lambda c: c.memory)
        self.assertLess(small.memory, large.memory)
        small.assign(large)
        self.assertEqual(small.memory, large.memory)

    def test_a_loaded_state_goes_on_with_equal_bits(self):
        for name in SPECS:
            c = cell(name)
            L = next(rates(c))
            c.deform(L, 50)
            other = CompactCell.load(c.save())
            self.assertEqual(other.save(), c.save())
            for v in (c, other):
                v.deform(-L, 50)
            self.assertEqual(other.save(), c.save())

    def test_what_is_not_a_state_is_refused(self):
        good = cell("bonded").save()
        CompactCell.load(good)
        version = bytearray(good)
        version[8] += 1
        cut = (good[:-64], "bytes"), (good[:100], "truncated"), (b"", "truncated")
        for bad, word in (*cut, (bytes(version), "version")):
            with self.assertRaisesRegex(compact_cell.UserError, word):
                CompactCell.load(bad)
        rng = np.random.default_rng(0)
        for at in rng.integers(0, len(good), 200):
            flipped = bytearray(good)
            flipped[at] ^= 1 << int(rng.integers(8))
            with self.assertRaises(compact_cell.UserError, msg=f"byte {at}"):
                CompactCell.load(bytes(flipped))

    def test_what_is_not_an_export_is_refused(self):
        good = exported("friction")
        for bad in (b"", b"something", good[:-8], good[:200], good + bytes(8)):
            with self.assertRaises(compact_cell.UserError):
                CompactCell.from_scene(bad)

    def test_yade_goes_on_from_a_compact_state_with_equal_bits(self):
        for name, spec in SPECS.items():
            ve, c = sorted_element(spec), cell(name)
            O = select(ve)
            for L in rates(c):
                c.deform(L, 30)
            compact_scene.write_back(O, c.to_scene())
            self.assertEqual(differences(c.to_scene(), compact_scene.export(O), ROUND_OFF | COUNTED_APART), [], name)
            for L, steps in zip(rates(c, seed=3), (1, 5, 30)):
                c.deform(L, steps)
                engine().deform(ve, L, steps)
                self.assertEqual(differences(c.to_scene(), compact_scene.export(O), ROUND_OFF | COUNTED_APART), [], name)

    def test_yade_goes_on_from_its_own_archive_with_equal_bits(self):
        """Forces found again would be right up to round-off: a contact that slides is scaled to its limit once more."""
        for name, spec in SPECS.items():
            ve = sorted_element(spec)
            O, c = select(ve), cell(name)
            for L in rates(c):
                engine().deform(ve, L, 30)
                archive, state = engine().save(ve), compact_scene.export(O)
                other = engine().add(archive)
                self.assertEqual(differences(state, compact_scene.export(O), ROUND_OFF | COUNTED_APART), [], name)
                engine().deform(other, L, 5)
                further = compact_scene.export(O)
                engine().remove(other)
                engine().deform(ve, L, 5)
                self.assertEqual(differences(compact_scene.export(O), further, ROUND_OFF | COUNTED_APART), [], name)

    def test_a_state_does_not_fit_a_scene_of_other_spheres(self):
        ve = element(packing(spheres=60, contact_law="friction"))
        with self.assertRaisesRegex(RuntimeError, "100 spheres does not fit"):
            compact_scene.write_back(select(ve), exported("friction"))


class Reports(unittest.TestCase):
    def test_reports_are_those_of_yades_engine(self):
        for name, spec in SPECS.items():
            ve, c = sorted_element(spec), cell(name)
            for L in rates(c, inertial_number=3e-3):
                engine().deform(ve, L, 200)
                c.deform(L, 200)
                stress, report, stretch = measure(ve)
                np.testing.assert_allclose(c.stress(), stress, rtol=0, atol=1e-12 * np.abs(stress).max())
                s = compact_scene.stress(select(ve))
                np.testing.assert_array_equal(c.stress(), 0.5 * (s + s.T))
                np.testing.assert_array_equal(c.stretch(), stretch)
                own = c.report()
                self.assertEqual(set(own), set(FIELDS))
                either_way = on_the_plateau(c) / max(own["contacts"], 1)
                self.assertAlmostEqual(own["sliding_contacts"], report["sliding_contacts"], delta=either_way + 1e-12)
                for field in set(FIELDS) - {"seconds", "engine_seconds", "sliding_contacts"}:
                    np.testing.assert_allclose(own[field], report[field], rtol=1e-11, atol=1e-13, err_msg=field)
            for key, value in engine().info(ve).items():
                np.testing.assert_allclose(c.info()[key], value, rtol=1e-12, err_msg=key)

    def test_an_element_that_sums_in_order_reports_the_bits_of_the_stress(self):
        with mock.patch.dict(os.environ, FEMXDEM_SORTED_CONTACTS="1"):
            ve = sorted_element(SPECS["adhesive"])
        c = cell("adhesive")
        for L in rates(c):
            for one in (lambda: engine().deform(ve, L, 20), lambda: c.deform(L, 20)):
                one()
            report, own = measure(ve)[1], c.report()
            for field in END_STRESS:
                self.assertEqual(report[field], own[field], field)
            self.assertAlmostEqual(report["stress_asymmetry"], own["stress_asymmetry"], delta=1e-14)
            self.assertGreater(own["stress_asymmetry"], 1e-6)

    def test_stiffnesses_of_every_kind(self):
        for name in ("friction", "adhesive", "soft, wide sizes"):
            ve, c = sorted_element(SPECS[name]), cell(name)
            L = next(rates(c))
            engine().deform(ve, L, 40)
            c.deform(L, 40)
            kinds = {kind: (mandel(c.stiffness(kind)), mandel(stiffness(ve, kind))) for kind in ("affine", "relaxed", "reduced", "sliding")}
            self.assertLess(np.trace(kinds["sliding"][0]), np.trace(kinds["affine"][0]))
            for mine, theirs in kinds.values():
                np.testing.assert_allclose(mine, theirs, rtol=0, atol=1e-10 * np.abs(theirs).max())

    def test_mean_stress_over_the_steps(self):
        c = cell("adhesive")
        L, stresses = next(rates(c)), []
        stepped = c.copy()
        for _ in range(7):
            stresses.append(stepped.stress())
            stepped.deform(L, 1)
        stresses.append(stepped.stress())
        whole = c.copy().deform(L, 7, sample_every=1)
        mean = (0.5 * stresses[0] + sum(stresses[1:-1]) + 0.5 * stresses[-1]) / 7
        np.testing.assert_allclose(whole, mean, rtol=0, atol=1e-13 * np.abs(mean).max())
        every_third = c.copy().deform(L, 7, sample_every=3)
        s = stresses
        coarse = (1.5 * (s[0] + s[3]) + 1.5 * (s[3] + s[6]) + 0.5 * (s[6] + s[7])) / 7
        np.testing.assert_allclose(every_third, coarse, rtol=0, atol=1e-13 * np.abs(mean).max())
        self.assertTrue(np.isnan(c.copy().deform(L, 7)).all())

    def test_mean_stress_of_both_engines_and_of_a_split(self):
        for name in ("friction", "adhesive"):
            ve, c = sorted_element(SPECS[name]), cell(name)
            L, halves, plain = next(rates(c)), c.copy(), c.copy()
            for every, late in ((1, 0.0), (7, 0.0), (1, 0.98)):
                theirs = np.full(9, np.nan)
                engine().deform(ve, L, 100, every, late, theirs)
                mine = c.deform(L, 100, sample_every=every, late=late)
                # YADE's getStress sums over the contacts in an order of its own: to round-off
                np.testing.assert_allclose(mine.ravel(), theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())
                plain.deform(L, 100)
                self.assertEqual(plain.save(), c.save())  # taking stresses moves nothing
                self.assertEqual(differences(c.to_scene(), compact_scene.export(select(ve))), [])
                self.assertGreater(np.abs(mine - c.stress()).max(), 1e-4 * np.abs(mine).max())
            whole = halves.copy().deform(L, 100, sample_every=1)
            first, second = halves.deform(L, 40, sample_every=1), halves.deform(L, 60, sample_every=1)
            np.testing.assert_allclose(0.4 * first + 0.6 * second, whole, rtol=0, atol=1e-13 * np.abs(whole).max())
            at_rest = c.deform(L, 0, sample_every=1)
            np.testing.assert_array_equal(at_rest, c.stress())

    def test_the_time_step_follows_the_network(self):
        ve = sorted_element(SPECS["adhesive"])
        O = select(ve)
        safe = O.dt
        for factor, kept in ((1.5, False), (0.5, False), (0.9, True)):
            O.dt = factor * safe
            with mock.patch.object(contact_laws, "constant_stiffness", return_value=None):
                c = CompactCell.from_scene(compact_scene.export(O))
                engine().follow_network(ve)
            c.follow_network()
            self.assertEqual(O.dt == factor * safe, kept)
            self.assertAlmostEqual(c.info()["time_step"] / engine().info(ve)["time_step"], 1, delta=1e-12)
        c = cell("adhesive")
        before = c.save()
        c.follow_network()
        self.assertEqual(c.save(), before, "one stiffness for ever: the step is kept")


class Flips(unittest.TestCase):
    """Simple shear to F_12 = 3: a cell flips at about 0.5, 1.5 and 2.5."""

    @staticmethod
    def shear(c):
        """Velocity gradient [1/s] and the steps in which F_12 grows by 0.1."""
        rate = 0.1 / c.info()["time_scale"]
        return np.array([[0, rate, 0], [0, 0, 0], [0, 0, 0]]), round(0.1 / (rate * c.info()["time_step"]))

    @staticmethod
    def without_flips(O, steps):
        """What deform does, but for them."""
        for _ in range(steps):
            O.step()
        contact_laws.to_forces(engine().O)

    def test_both_engines_flip_at_the_same_steps_with_equal_bits(self):
        for name in ("adhesive", "friction"):
            ve, c = sorted_element(SPECS[name]), cell(name)
            (L, steps), O, bases = self.shear(c), select(ve), set()
            H = compact_scene.Scene(c.to_scene()).H
            for _ in range(31):
                c.deform(L, steps)
                engine().deform(ve, L, steps)
                self.assertEqual(differences(c.to_scene(), compact_scene.export(O)), [], name)
                F = np.array(c.stretch())
                basis = np.linalg.solve(F @ H, compact_scene.Scene(c.to_scene()).H)
                np.testing.assert_allclose(basis, np.rint(basis), rtol=0, atol=1e-9)
                bases.add(tuple(np.rint(basis).astype(int).ravel()))
            self.assertGreater(F[0, 1], 3)
            self.assertEqual(len(bases), 4, "three flips")

    def test_stress_is_continuous_across_every_flip(self):
        """Of YADE's cell and of a compact one made from it, at once and over the steps after it, within 1e-9."""
        for name in ("adhesive", "friction"):
            ve = sorted_element(SPECS[name])
            (L, steps), O, flips = self.shear(cell(name)), select(ve), 0
            for _ in range(31):
                engine().deform(ve, L, 1)
                self.without_flips(O, steps)
                long = CompactCell.from_scene(compact_scene.export(O))
                short, before = long.copy(), measure(ve)[0]
                if not short.flip():
                    continue
                flips += 1
                atol = 1e-9 * np.abs(before).max()
                np.testing.assert_allclose(short.stress(), before, rtol=0, atol=atol)
                self.assertEqual(len(short), len(long))
                archive = engine().save(ve)
                self.without_flips(O, 5)
                beside = measure(ve)[0]
                engine().replace(ve, archive)
                self.assertNotEqual(np.array(O.cell.flipCell()).tolist(), np.eye(3).tolist())
                np.testing.assert_allclose(measure(ve)[0], before, rtol=0, atol=atol)
                engine().deform(ve, L, 5)
                short.deform(L, 5)
                np.testing.assert_allclose(measure(ve)[0], beside, rtol=0, atol=atol)
                np.testing.assert_allclose(short.stress(), beside, rtol=0, atol=atol)
            self.assertEqual(flips, 3, name)

    def test_a_short_cell_stays(self):
        c = cell("adhesive")
        self.assertFalse(c.flip())


class Limits(unittest.TestCase):
    def test_a_cell_that_becomes_too_narrow_is_a_failure(self):
        c = cell("friction")
        with self.assertRaisesRegex(RuntimeError, "too narrow"):
            for _ in range(500):
                c.deform(np.diag([-1.0, 1.0, 0.0]) * 0.3 / c.info()["time_scale"], 100)

    def test_no_steps_change_nothing(self):
        c = cell("friction")
        before = c.save()
        c.deform(np.eye(3), 0)
        self.assertEqual(c.save(), before)

    def test_what_is_not_covered_is_said(self):
        def prepared(change):
            O = select(sorted_element(SPECS["adhesive"]))
            change(O)
            return compact_scene.covered(O)

        def functor(O, k):
            loop = O.engines[2]
            return (loop.geomDispatcher, loop.physDispatcher, loop.lawDispatcher)[k].functors[0]

        changes = {
            "interactionDetectionFactor": lambda O: setattr(functor(O, 0), "interactionDetectionFactor", 1.1),
            "setCohesionOnNewContacts": lambda O: setattr(functor(O, 1), "setCohesionOnNewContacts", True),
            "always_use_moment_law": lambda O: setattr(functor(O, 2), "always_use_moment_law", True),
            "momentRotationLaw": lambda O: setattr(O.bodies[3].mat, "momentRotationLaw", True),
            "the contact of bodies .* momentRotationLaw": lambda O: setattr(
                next(iter(O.interactions)).phys, "momentRotationLaw", True
            ),
            "body 4 has blockedDOFs": lambda O: setattr(O.bodies[4].state, "blockedDOFs", "z"),
            "three moments of inertia": lambda O: setattr(O.bodies[5].state, "inertia", (1, 2, 3)),
            "gravity": lambda O: setattr(O.engines[-1], "gravity", (0, 0, -9.81)),
            "homoDeform": lambda O: setattr(O.cell, "homoDeform", 1),
            "does not rest": lambda O: O.step(),
        }
        self.assertIsNone(prepared(lambda O: None))
        for sentence, change in changes.items():
            self.assertRegex(prepared(change) or "covered", sentence)


if __name__ == "__main__":
    unittest.main()
