"""The automatic time step against the cliff beyond which YADE's answers are silently wrong."""

import unittest

import numpy as np

import contact_loop
import contact_models_test as contact_models
from cells import FRICTION, engine, measure, rate, select, template
from time_step import critical_time_step

BIAXIAL = [[0.5, 0, 0], [0, -1, 0], [0, 0, 0]]
CELLS = (
    FRICTION,
    {**FRICTION, "kappa": 100.0, "stiffness_ratio": 0.5},
    {**FRICTION, "kappa": 5000.0, "stiffness_ratio": 5.0},
    {**FRICTION, "kappa": 100.0, "stiffness_ratio": 0.2, "size_ratio": 1.0},
)


def unbalanced(spec, factor):
    """Unbalanced force after 200 steps of `factor` times the critical time step of the network."""
    ve = engine().add(template(spec)["state"])
    O = select(ve)
    O.dt = factor * critical_time_step(O, contact_loop.contacts(O))
    engine().deform(ve, rate(ve, 5e-3, BIAXIAL), 200)
    result = measure(ve)[1]["unbalanced_force"]
    engine().remove(ve)
    return result


def compressed(state, follow, factor):
    """Pressure [Pa], unbalanced force and time step over the critical one after 6 % of isotropic compression, begun with
    `factor` times the state's time step."""
    ve = engine().add(state)
    O = select(ve)
    O.dt *= factor
    strain_rate = 5e-3 / engine().info(ve)["time_scale"]
    for _ in range(40):
        dt = engine().info(ve)["time_step"]
        steps = int(np.ceil(0.06 / 40 / (strain_rate * dt)))
        engine().deform(ve, -np.eye(3) * 0.06 / 40 / (steps * dt), steps)
        if follow:
            engine().follow_network(ve)
    stress, report, _ = measure(ve)
    over = O.dt / critical_time_step(O, contact_loop.contacts(O))
    engine().remove(ve)
    return -np.trace(stress) / 3, report["unbalanced_force"], over


class TimeStep(unittest.TestCase):
    def test_automatic_step_is_stable_and_at_least_0_7_of_the_largest_stable_one(self):
        """0.8 times critical against 1.14 times critical = 0.8/0.7, which is over the cliff."""
        for spec in CELLS:
            with self.subTest(spec):
                stable = unbalanced(spec, 0.8)
                self.assertLess(stable, 0.06)
                self.assertGreater(unbalanced(spec, 0.8 / 0.7), 3 * stable)

    def test_cliff(self):
        spec = CELLS[0]
        below = [unbalanced(spec, f) for f in (0.4, 0.8, 1.0)]
        self.assertLess(max(below), 1.5 * min(below) + 0.02)
        self.assertGreater(unbalanced(spec, 1.5), 0.3)

    def test_hertzian_contacts_stiffen_and_the_step_follows(self):
        """6 % of isotropic compression, the pressure grows thirtyfold: the first step ends up far beyond the cliff."""
        state = engine().save(contact_models.element("Hertz-Mindlin")[0])
        followed, fixed, finer = (compressed(state, *how) for how in ((True, 1.0), (False, 1.0), (False, 0.3)))
        print("pressure [Pa], unbalanced force, time step over the critical one")
        for name, values in (("step followed", followed), ("step kept", fixed), ("0.3 of the first step", finer)):
            print(f"{name:22} {values[0]:.4g} {values[1]:.1e} {values[2]:.2f}")
        self.assertAlmostEqual(followed[0] / finer[0], 1, delta=2e-3)
        self.assertLess(followed[1], 2e-3)
        self.assertLess(followed[2], 0.88 + 1e-9)
        self.assertLess(fixed[0], 0.7 * finer[0])
        self.assertGreater(fixed[1], 0.2)

    def test_linear_contacts_can_keep_their_step(self):
        """Loose packings gain a third of their contacts, and the step that they keep stays below the critical one, below 0.9
        of it in the mean of eight (standard deviation of one: 0.04)."""
        pressure, unbalanced, over = np.transpose(
            [compressed(template({**CELLS[0], "compaction_friction": 0.5, "seed": s})["state"], True, 1.0) for s in range(1, 9)]
        )
        print(f"pressure {pressure.mean():.3g} Pa, unbalanced force {unbalanced.max():.1e}, "
              f"time step over the critical one {over.mean():.3f}, at most {over.max():.3f}")
        self.assertGreater(pressure.min(), 1e6)
        self.assertLess(unbalanced.max(), 0.02)
        self.assertLess(over.mean(), 0.9)
        self.assertLess(over.max(), 1.0)
        self.assertNotIn(0.8, over)

    def test_time_step_of_a_template_is_the_safety_factor_times_the_critical_one(self):
        half = template({**CELLS[0], "time_step_safety": 0.4})["manifest"]["time_step"]
        self.assertAlmostEqual(half, 0.5 * template(CELLS[0])["manifest"]["time_step"], delta=1e-12 * half)

    def test_erased_bodies_leave_a_gap_in_the_numbers(self):
        whole = contact_models.element("frictional")[1]
        erased = contact_models.element("frictional", grains=contact_models.SPHERES + "\nfor k in (0, 7, 20): O.bodies.erase(k)")[1]
        self.assertEqual((whole["spheres"], erased["spheres"]), (60, 57))
        self.assertEqual(erased["time_step_from"], "contact network")
        self.assertAlmostEqual(erased["time_step"] / whole["time_step"], 1, delta=0.1)

    def test_power_iteration_has_converged(self):
        import time_step

        ve = engine().add(template(CELLS[0])["state"])
        O = select(ve)
        c = contact_loop.contacts(O)
        coarse = critical_time_step(O, c)
        iterations, time_step.ITERATIONS = time_step.ITERATIONS, 1000
        fine = critical_time_step(O, c)
        time_step.ITERATIONS = iterations
        self.assertLess(coarse / fine - 1, 0.02)
        self.assertGreaterEqual(coarse, fine * (1 - 1e-9))


if __name__ == "__main__":
    unittest.main()
