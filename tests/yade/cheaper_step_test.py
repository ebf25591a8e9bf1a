"""What makes a DEM step of a prepared packing cheaper changes nothing in it."""

import unittest
from unittest import mock

import numpy as np

import unit_of_time
from cells import ADHESIVE, FRICTION, element, engine, measure, rate, select

BIAXIAL = [[0.6, 0.1, 0.0], [0.1, -1.0, 0.05], [0.0, 0.05, 0.0]]


def loop(ve):
    """YADE's contact loop of that volume element."""
    return next(e for e in select(ve).engines if type(e).__name__ == "InteractionLoop")


def motion(ve):
    """(spheres, 12) positions, velocities and spins in the scene's units, and the forces on the spheres [N]."""
    O = select(ve)
    return np.array([[*b.state.pos, *b.state.vel, *b.state.angVel, *O.forces.f(b.id)] for b in O.bodies])


class Rotations(unittest.TestCase):
    def test_the_rotations_at_the_contacts_are_not_followed_and_change_nothing(self):
        for law in ("adhesive", "bonded"):
            without, followed = element({**ADHESIVE, "contact_law": law}), element({**ADHESIVE, "contact_law": law})
            functors = [loop(ve).geomDispatcher.functors[0] for ve in (without, followed)]
            self.assertFalse(functors[0].updateRotations)
            functors[1].updateRotations = True
            contacts = select(without).interactions.countReal()
            for sign in (1, 1, -1):
                for ve in (without, followed):
                    engine().deform(ve, sign * rate(ve, 1e-2, BIAXIAL), 200)
            self.assertNotEqual(select(without).interactions.countReal(), contacts)
            np.testing.assert_array_equal(motion(without), motion(followed))
            bent = [max(i.geom.bending.norm() for i in select(ve).interactions) for ve in (without, followed)]
            self.assertTrue(bent[0] == 0 < bent[1], bent)


def runs_of_the_collider(ve, inertial_number, steps):
    """How often it ran in so many steps."""
    collider = next(e for e in select(ve).engines if type(e).__name__ == "InsertionSortCollider")
    before = collider.numAction
    engine().deform(ve, rate(ve, inertial_number, BIAXIAL), steps)
    return collider.numAction - before


def in_seconds(state):
    """The same volume element in a scene that counts time in seconds; it must be at rest."""
    ve = engine().add(state)
    O = select(ve)
    unit = unit_of_time.of(O)
    for b in O.bodies:
        assert b.state.vel.norm() == b.state.angVel.norm() == 0.0
        b.state.mass, b.state.inertia = unit.density(b.state.mass), unit.density(b.state.inertia)
        b.mat.density = unit.density(b.mat.density)
    O.dt = unit.seconds(O.dt)
    unit_of_time.note(O, unit_of_time.SECOND)
    return engine().add(engine().save(ve))


class UnitOfTime(unittest.TestCase):
    PRESSURES = (1e3, 1e5, 1e8)  # [Pa]

    def test_the_collider_runs_seldom_at_any_pressure(self):
        for pressure in self.PRESSURES:
            ve = element({**FRICTION, "confining_stress": pressure})
            self.assertLess(runs_of_the_collider(ve, 2e-2, 100), 8, pressure)
        seconds = in_seconds(engine().save(element({**FRICTION, "confining_stress": 1e8})))
        self.assertEqual(runs_of_the_collider(seconds, 2e-2, 100), 100)

    def test_the_boundary_stays_slow_at_any_rate_that_a_case_may_ask_for(self):
        for pressure in self.PRESSURES:
            for spheres in (20, 10**6):
                unit = unit_of_time.suited(pressure, 2600.0, spheres)
                self.assertEqual(np.frexp(unit.in_a_second)[0], 0.5, "a power of two")
                strain_rate, side = np.sqrt(pressure / 2600.0) / 1e-3, 1e-3 * spheres ** (1 / 3)
                self.assertLess(unit.scene_rate(np.sqrt(3) * side * strain_rate), 0.25)

    def test_answers_are_those_of_a_scene_in_seconds_to_the_bit(self):
        for spec in (FRICTION, ADHESIVE, {**ADHESIVE, "confining_stress": 1e8}):
            prepared = element(spec)
            seconds = in_seconds(engine().save(prepared))
            prepared, both = engine().add(engine().save(prepared)), []
            self.assertGreater(unit_of_time.of(select(prepared)).in_a_second, 100)
            for ve in (prepared, seconds):
                loop(ve).loopOnSortedInteractions = True  # the collider, running at other times, changes YADE's own order
            for steps, sign in ((60, 1), (140, -1), (50, 1)):
                for ve in (prepared, seconds):
                    engine().deform(ve, sign * rate(seconds, 2e-2, BIAXIAL), steps)
                (stress, report, F), (stress_s, report_s, F_s) = measure(prepared), measure(seconds)
                np.testing.assert_array_equal(stress, stress_s)
                np.testing.assert_array_equal(F, F_s)
                for name in report:
                    if "seconds" not in name:
                        self.assertEqual(report[name], report_s[name], name)
            self.assertEqual(engine().info(prepared), engine().info(seconds))

    def test_in_yades_own_order_of_the_contacts_the_first_60_steps_are_the_same_to_the_bit(self):
        """Over 480 steps the stress differs by 1e-15 to 1e-14, as the collider drops potential contacts at other times."""
        prepared = element({**ADHESIVE, "confining_stress": 1e8})
        seconds = in_seconds(engine().save(prepared))
        prepared = engine().add(engine().save(prepared))
        seldom, often = (runs_of_the_collider(ve, 2e-2, 60) for ve in (prepared, seconds))
        self.assertTrue(seldom < 5 and often == 60)
        np.testing.assert_array_equal(measure(prepared)[0], measure(seconds)[0])

    def test_what_is_said_is_in_seconds(self):
        made = engine().make_template(FRICTION)["manifest"]
        with mock.patch.object(unit_of_time, "suited", lambda *_: unit_of_time.SECOND):
            plain = engine().make_template(FRICTION)["manifest"]
        self.assertEqual(plain["scene_unit_of_time"], 1.0)
        self.assertLess(made["scene_unit_of_time"], 0.01)
        self.assertAlmostEqual(made["time_scale"], 1e-3 * np.sqrt(2600 / 1e5), delta=2e-3 * made["time_scale"])
        for name in ("time_step", "time_scale"):
            self.assertAlmostEqual(made[name] / plain[name], 1, delta=0.1, msg=name)

    def test_no_scene_inherits_the_unit_of_another(self):
        engine().make_template(FRICTION)
        O = engine().O
        self.assertNotEqual(unit_of_time.of(O), unit_of_time.SECOND)
        O.resetThisScene()  # as before every template
        self.assertEqual(unit_of_time.of(O), unit_of_time.SECOND)


if __name__ == "__main__":
    unittest.main()
