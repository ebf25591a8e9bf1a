"""The automatic time step against the cliff beyond which YADE's answers are silently wrong."""

import unittest

import contact_loop
from cells import engine, measure, rate, select, template
from time_step import critical_time_step

BIAXIAL = [[0.5, 0, 0], [0, -1, 0], [0, 0, 0]]
CELLS = (
    {"spheres": 60, "contact_law": "friction"},
    {"spheres": 60, "contact_law": "friction", "kappa": 100.0, "stiffness_ratio": 0.5},
    {"spheres": 60, "contact_law": "friction", "kappa": 5000.0, "stiffness_ratio": 5.0},
    {"spheres": 60, "contact_law": "friction", "kappa": 100.0, "stiffness_ratio": 0.2, "size_ratio": 1.0},
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

    def test_time_step_of_a_template_is_the_safety_factor_times_the_critical_one(self):
        half = template({**CELLS[0], "time_step_safety": 0.4})["manifest"]["time_step"]
        self.assertAlmostEqual(half, 0.5 * template(CELLS[0])["manifest"]["time_step"], delta=1e-12 * half)

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
