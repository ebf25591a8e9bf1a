"""What validation/quasi_static/roughness.py calls rough, on lines whose noise is known."""

import sys
import unittest
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "validation" / "quasi_static"))
import roughness

STATES = 200


def lines(noise):
    """(states, strains, 9): a parabola in one component of a stress of norm 1, and noise (states, strains) in another."""
    found = np.zeros((len(noise), len(roughness.AROUND), 9))
    found[:, :, 0] = 1 + 0.3 * roughness.AROUND + 2 * roughness.AROUND**2
    found[:, :, 4] = noise
    return found / np.linalg.norm(found.mean(axis=1), axis=1)[:, None, None]


class Roughness(unittest.TestCase):
    def setUp(self):
        self.rng = np.random.default_rng(1)

    def white(self):
        return 1e-3 * self.rng.standard_normal((STATES, len(roughness.AROUND)))

    def test_of_a_parabola_there_is_none(self):
        self.assertLess(roughness.size(roughness.rough_part(lines(np.zeros((3, len(roughness.AROUND)))))), 1e-12)

    def test_of_noise_it_is_the_standard_deviation(self):
        self.assertAlmostEqual(roughness.size(roughness.rough_part(lines(self.white()))), 1e-3, delta=5e-5)

    def test_one_jump_stands_out_of_noise(self):
        jump = np.broadcast_to(1e-2 * (roughness.AROUND > 0.045), (STATES, len(roughness.AROUND)))
        of_noise, of_jump = (roughness.largest_jump(roughness.rough_part(lines(n))) for n in (self.white(), jump + 0.1 * self.white()))
        self.assertTrue(1.7 < of_noise < 2.6, of_noise)
        self.assertGreater(of_jump, 3.5)

    def test_copies_that_jump_alike_are_correlated(self):
        one, other = self.white(), self.white()
        rough = lambda noise: roughness.rough_part(lines(noise))
        self.assertAlmostEqual(roughness.alike(rough(one), rough(one + other)), 0.5**0.5, delta=0.05)
        self.assertAlmostEqual(roughness.alike(rough(one), rough(other)), 0, delta=0.05)


if __name__ == "__main__":
    unittest.main()
