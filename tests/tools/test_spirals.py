"""Measure of spiral bands on fields of known bands."""

import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "fe_master" / "program"))
from results import ResultsError
from sample_run import write_run
from spirals import measure_spirals, spirals_of_run


def quarter(nr=40, nt=60, outer=6.0):
    """Points of a quarter of an annulus of inner radius 1, graded so that they are about as wide as long."""
    xi, theta = np.meshgrid((np.arange(nr) + 0.5) / nr * np.log(outer), (np.arange(nt) + 0.5) / nt * np.pi / 2, indexing="ij")
    return (np.exp(xi)[..., None] * np.stack([np.cos(theta), np.sin(theta)], axis=-1)).reshape(-1, 2)


def spiral(x, start, inclination, thickness, reach=3.0):
    """Height 1 on a logarithmic spiral from the wall to a radius, full width `thickness` at half height along the normal."""
    xi, theta = np.log(np.linalg.norm(x, axis=1)), np.arctan2(x[:, 1], x[:, 0])
    angle = np.radians(inclination)
    off = (theta - np.radians(start)) * np.cos(angle) - xi * np.sin(angle)  # distance / r
    return np.exp(-4 * np.log(2) * (off * np.exp(xi) / thickness) ** 2) / (1 + np.exp(40 * (xi - np.log(reach))))


class Synthetic(unittest.TestCase):
    def test_one_band(self):
        for start, inclination, thickness in ((20, 35, 0.25), (70, -30, 0.3), (45, 20, 0.3)):
            with self.subTest(start=start, inclination=inclination):
                x = quarter()
                found = measure_spirals(x, spiral(x, start, inclination, thickness))
                self.assertEqual(len(found), 1)
                self.assertLess(abs(found[0].start - start), 1.5)
                self.assertLess(abs(found[0].inclination - inclination), 1.0)
                self.assertLess(abs(found[0].thickness / thickness - 1), 0.05)
                self.assertLess(abs(found[0].reach / 3.0 - 1), 0.15)
                self.assertGreater(found[0].stations, 10)

    def test_two_bands_strongest_first(self):
        x = quarter()
        found = measure_spirals(x, spiral(x, 10, 35, 0.2) + 0.7 * spiral(x, 80, -35, 0.2, reach=1.5))
        self.assertEqual(len(found), 2)
        self.assertLess(abs(found[0].start - 10), 1.5)
        self.assertLess(abs(found[1].start - 80), 1.5)
        self.assertLess(found[1].reach, found[0].reach)

    def test_a_band_that_starts_inside_the_body_is_none(self):
        x = quarter()
        inside = spiral(x, 20, 35, 0.2) * (np.linalg.norm(x, axis=1) > 1.8)
        with self.assertRaisesRegex(ResultsError, "no band starts at the wall"):
            measure_spirals(x, inside)

    def test_an_axisymmetric_field_has_none(self):
        x = quarter()
        with self.assertRaisesRegex(ResultsError, "no band"):
            measure_spirals(x, np.linalg.norm(x, axis=1) ** -2.0)

    def test_a_coarser_mesh_finds_the_same(self):
        x = quarter(20, 30)
        found = measure_spirals(x, spiral(x, 20, 35, 0.3))
        self.assertEqual(len(found), 1)
        self.assertLess(abs(found[0].thickness / 0.3 - 1), 0.12)

    def test_thickness_over_a_wall_that_strains_all_round(self):
        x = quarter()
        found = measure_spirals(x, spiral(x, 20, 35, 0.25) + 0.8)
        self.assertLess(abs(found[0].thickness / 0.25 - 1), 0.05)

    def test_files_of_a_run(self):
        """A body without an annulus has no band that starts at its wall."""
        with tempfile.TemporaryDirectory() as folder:
            write_run(Path(folder), lambda x, step: np.zeros_like(x), lambda x, step: np.zeros((len(x), 2, 2)), [1], nx=8, ny=16)
            with self.assertRaises(ResultsError):
                spirals_of_run(folder)


if __name__ == "__main__":
    unittest.main()
