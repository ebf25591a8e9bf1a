"""The engine of protocol.py on YADE: where a trial ends, what it measures there, and what a saved state is worth."""

import unittest

import numpy as np

import contact_laws
import contact_loop

from cells import ADHESIVE, FIELDS, FRICTION, element, engine, measure, rate, select, template

STEPS = 200
BIAXIAL = [[0.6, 0.1, 0.0], [0.1, -1.0, 0.05], [0.0, 0.05, 0.0]]


class Deform(unittest.TestCase):
    def test_ends_exactly_where_it_was_sent(self):
        ve = element(FRICTION)
        dt, F = engine().info(ve)["time_step"], np.eye(3)
        for steps, sign in ((7, 1.0), (1, -2.0), (20, 0.5)):
            L = sign * rate(ve, 5e-3, BIAXIAL)
            engine().deform(ve, L, steps)
            F = np.linalg.matrix_power(np.eye(3) + L * dt, steps) @ F
            np.testing.assert_allclose(measure(ve)[2], F, rtol=0, atol=1e-14)

    def test_stress_belongs_to_the_positions_and_the_cell_at_the_end(self):
        ve = element(FRICTION)
        engine().deform(ve, rate(ve, 5e-3, BIAXIAL), 30)
        O = select(ve)
        c = contact_loop.contacts(O)
        radius = np.array([b.shape.radius for b in O.bodies])
        overlap = radius[c.ids].sum(axis=1) - c.length
        force = (contact_loop.values(c, "kn") * overlap)[:, None] * c.normal
        force += np.array([list(p.shearForce) for p in c.phys])
        s = -np.einsum("ci,cj->ij", force, c.normal * c.length[:, None]) / O.cell.volume
        np.testing.assert_allclose(measure(ve)[0], 0.5 * (s + s.T), rtol=0, atol=1e-10 * np.abs(s).max())

    def test_equal_histories_give_equal_bits(self):
        one, other = element(ADHESIVE), element(ADHESIVE)
        L = rate(one, 5e-3, BIAXIAL)
        for ve in (one, other, one, other):
            engine().deform(ve, L, 25)
        self.assertTrue((measure(one)[0] == measure(other)[0]).all())

    def test_splitting_an_increment_changes_nothing(self):
        one, other = element(FRICTION), element(FRICTION)
        L = rate(one, 5e-3, BIAXIAL)
        engine().deform(one, L, 60)
        for _ in range(6):
            engine().deform(other, L, 10)
        a, b = measure(one)[0], measure(other)[0]
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-12 * np.abs(a).max())

    def test_ten_increments_against_one_at_the_same_rate(self):
        """The step counts are those of the whole; only round-off may differ, also with adhesion."""
        one, other = element(ADHESIVE), element(ADHESIVE)
        L = rate(one, 5e-3, BIAXIAL)
        engine().deform(one, L, 40)
        for _ in range(4):
            engine().deform(other, L, 10)
        np.testing.assert_allclose(measure(one)[0], measure(other)[0], rtol=0, atol=1e-10 * 1e5)


class States(unittest.TestCase):
    def test_add_and_replace_of_a_saved_state_continue_with_equal_bits(self):
        for spec in (FRICTION, ADHESIVE):
            ve = element(spec)
            L = rate(ve, 5e-3, BIAXIAL)
            engine().deform(ve, L, 30)
            state = engine().save(ve)
            engine().replace(ve, state)
            other = engine().add(state)
            for v in (ve, other):
                engine().deform(v, -L, 20)
            self.assertTrue((measure(ve)[0] == measure(other)[0]).all())
            self.assertTrue((measure(ve)[2] == measure(other)[2]).all())

    def test_a_restored_state_has_the_stress_and_the_forces_it_was_saved_with(self):
        for spec in (FRICTION, ADHESIVE):
            ve = element(spec)
            engine().deform(ve, rate(ve, 5e-3, BIAXIAL), STEPS)
            stress, report, F = measure(ve)
            other = engine().add(engine().save(ve))
            again, report_again, F_again = measure(other)
            np.testing.assert_allclose(again, stress, rtol=0, atol=1e-12 * np.abs(stress).max())
            np.testing.assert_array_equal(F_again, F)
            for name in ("unbalanced_force", "coordination", "sliding_contacts", "mean_rotation", "fabric_xy"):
                self.assertAlmostEqual(report_again[name], report[name], delta=1e-9, msg=name)

    def test_restoring_does_not_disturb_the_path(self):
        for spec in (FRICTION, ADHESIVE):
            ve = element(spec)
            L = rate(ve, 5e-3, BIAXIAL)
            engine().deform(ve, L, 50)
            other = engine().add(engine().save(ve))
            for v in (ve, other):
                engine().deform(v, L, 30)
            a, b = measure(ve)[0], measure(other)[0]
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * np.abs(a).max())

    def test_contacts_become_adhesive_in_the_same_steps_however_often_a_state_is_restored(self):
        spec = {**ADHESIVE, "new_contacts": "adhesive", "compaction_friction": 0.5}
        one, other = element(spec), element(spec)
        L = rate(one, 2e-2, BIAXIAL)
        sticking = lambda ve: {(i.id1, i.id2) for i in select(ve).interactions if i.phys.normalAdhesion > 0}
        before = sticking(one)
        for steps in 6 * (1, 3, 1, 2, 1, 1, 0, 0, 0, 0, 0, 1, 7):
            for ve in (one, other) if steps else ():
                engine().deform(ve, L, steps)
            engine().replace(other, engine().save(other))
            self.assertEqual(*(contact_laws.steps_made(select(ve)) for ve in (one, other)))
            self.assertEqual(sticking(one), sticking(other))
        self.assertEqual(select(other).iter - select(one).iter, 6 * 13)
        late = sticking(one) - before
        print(f"{len(late)} contacts of {len(before)} formed and became adhesive on the way")
        self.assertGreater(len(late), 5)
        a, b = measure(one)[0], measure(other)[0]
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * np.abs(a).max())

    def test_a_removed_element_leaves_its_place_and_the_others_alone(self):
        keep, gone = element(FRICTION), element(FRICTION)
        before = measure(keep)[0]
        engine().remove(gone)
        self.assertEqual(element(FRICTION), gone)
        np.testing.assert_array_equal(measure(keep)[0], before)


class Report(unittest.TestCase):
    def test_every_entry_is_a_number_and_says_what_it_should(self):
        ve = element(ADHESIVE)
        L = rate(ve, 4e-3, BIAXIAL)
        _, start, _ = measure(ve)
        self.assertEqual((start["dem_steps"], start["adhesive_contacts"]), (0, 1.0))
        self.assertLess(start["sliding_contacts"], 0.01)
        self.assertAlmostEqual(start["mean_rotation"], 0.0, delta=1e-12)
        time_scale = engine().info(ve)["time_scale"]
        engine().deform(ve, L, STEPS)
        stress, r, F = measure(ve)
        self.assertTrue(np.isfinite(list(r.values())).all())
        self.assertEqual(r["dem_steps"], STEPS)
        self.assertAlmostEqual(r["fabric_xx"] + r["fabric_yy"] + r["fabric_zz"], 1.0, delta=1e-12)
        now = 4e-3 * np.sqrt(1e5 / (-np.trace(stress) / 3))
        self.assertAlmostEqual(r["inertial_number"], now, delta=2e-3 * now)
        self.assertEqual(engine().info(ve)["time_step"], r["time_step"])
        self.assertAlmostEqual(1 - r["porosity"], (1 - start["porosity"]) / np.linalg.det(F), delta=1e-12)
        self.assertTrue(0 < r["engine_seconds"] <= r["seconds"])
        self.assertGreater(r["mean_rotation"], 1e-4)
        self.assertTrue(0 < r["sliding_contacts"] < 1 and 0.5 < r["adhesive_contacts"] <= 1)
        per_grain = np.bincount(contact_loop.contacts(select(ve)).ids.ravel())
        self.assertEqual(r["coordination_backbone"], per_grain[per_grain > 1].mean())
        self.assertEqual(r["coordination"], per_grain.sum() / len(select(ve).bodies))
        self.assertAlmostEqual(time_scale, 1e-3 * np.sqrt(2600 / 1e5), delta=2e-3 * time_scale)

    def test_a_trial_reports_what_judges_and_counts_it_and_a_field_the_rest(self):
        ve = element(ADHESIVE)
        engine().deform(ve, rate(ve, 4e-3, BIAXIAL), 10)
        report = np.full(len(FIELDS), -1.0)
        engine().measure(ve, np.empty(9), report, np.empty(9))
        of_trial = dict(zip(FIELDS, report))
        engine().complete_report(ve, report)
        complete = dict(zip(FIELDS, report))
        left = {name for name in FIELDS if np.isnan(of_trial[name])}
        costly = {"coordination_backbone", "mean_rotation", "sliding_contacts", "adhesive_contacts"}
        self.assertEqual(left, costly | {name for name in FIELDS if name.startswith("fabric")})
        for name in FIELDS:
            self.assertTrue(np.isfinite(complete[name]), name)
            self.assertTrue(name in left or complete[name] == of_trial[name], name)

    def test_contacts_that_slide_or_adhere_are_those_of_now(self):
        for spec in (FRICTION, ADHESIVE):
            ve = element(spec)
            L, sliding = rate(ve, 5e-3, BIAXIAL), []
            for _ in range(5):
                engine().deform(ve, L, 20)
                report, contacts = measure(ve)[1], [i.phys for i in select(ve).interactions]
                adhere = sum(getattr(p, "normalAdhesion", 0) > 0 and not p.cohesionBroken for p in contacts)
                self.assertEqual(report["adhesive_contacts"], adhere / len(contacts))
                sliding.append(report["sliding_contacts"])
                if spec is FRICTION:
                    at_limit = [p.shearForce.norm() >= (1 - 1e-6) * p.tangensOfFrictionAngle * p.normalForce.norm() for p in contacts]
                    self.assertEqual(sliding[-1], sum(at_limit) / len(contacts))
            self.assertEqual(len(set(sliding)), 5)

    def test_template_says_what_it_is(self):
        m = template(FRICTION)["manifest"]
        for key in "porosity coordination fabric stress unbalanced_force spheres seconds versions".split():
            self.assertIn(key, m)
        self.assertEqual(m["time_step_from"], "contact network")

    def test_an_unknown_source_is_refused(self):
        with self.assertRaisesRegex(ValueError, 've.source = "magic" is unknown'):
            engine().make_template({"source": "magic"})


if __name__ == "__main__":
    unittest.main()
