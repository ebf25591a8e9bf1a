"""Band measure on fields of known thickness and inclination."""

import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "fe_master" / "program"))
from band import axes_of, band_of_run, mean_profile, measure_band
from results import ResultsError
from sample_run import gauss_points, rectangle, write_run


def gaussian(positions, inclination, thickness, centre=(0.5, 1.0)):
    """Height 1 and full width `thickness` at half height across a line."""
    _, across = axes_of(inclination)
    return np.exp(-4 * np.log(2) * ((positions - np.array(centre)) @ across / thickness) ** 2)


def structured(nx=16, ny=32):
    return gauss_points(*rectangle(nx, ny, 1.0, 2.0)).reshape(-1, 2)


class Synthetic(unittest.TestCase):
    def expect(self, band, inclination, thickness, relative=0.02, degrees=0.1):
        self.assertLess(abs(band.thickness / thickness - 1), relative)
        self.assertLess(abs(band.inclination - inclination), degrees)

    def test_thickness_and_inclination_on_a_structured_mesh(self):
        for inclination, thickness in ((51, 0.3), (-55, 0.2), (0, 0.43), (45, 0.2)):
            with self.subTest(inclination=inclination):
                self.expect(measure_band(structured(), gaussian(structured(), inclination, thickness)), inclination, thickness)

    def test_error_of_the_interpolation_falls_with_the_square_of_the_element_size(self):
        errors = [measure_band(x, gaussian(x, 51, 0.3)).thickness / 0.3 - 1 for x in (structured(8, 16), structured(16, 32))]
        self.assertGreater(errors[0] / errors[1], 3)
        self.assertLess(errors[0] / errors[1], 6)

    def test_scattered_points_as_on_an_unstructured_mesh(self):
        x = np.random.default_rng(1).uniform(size=(2048, 2)) * (1, 2)
        self.expect(measure_band(x, gaussian(x, 51, 0.3, (0.45, 0.8))), 51, 0.3)

    def test_any_profile(self):
        _, across = axes_of(60)
        x = structured(32, 64)
        triangle = np.maximum(0, 1 - np.abs((x - (0.5, 1.0)) @ across) / 0.25)
        self.expect(measure_band(x, triangle), 60, 0.25)

    def test_a_fainter_conjugate_band_does_not_mislead(self):
        x = structured()
        values = gaussian(x, -55, 0.2) + 0.4 * gaussian(x, 55, 0.2)
        self.expect(measure_band(x, values), -55, 0.2, relative=0.08, degrees=0.5)

    def test_a_hot_corner_does_not_mislead(self):
        x = structured()
        corner = np.linalg.norm(x - (1, 0), axis=1)
        values = gaussian(x, -52, 0.5, (0.5, 0.7)) + 4 * np.exp(-((corner / 0.3) ** 2))
        self.expect(measure_band(x, values), -52, 0.5, relative=0.08, degrees=3)

    def test_noise(self):
        x = structured()
        values = gaussian(x, 51, 0.3) + 0.1 * np.random.default_rng(2).normal(size=len(x))
        self.expect(measure_band(x, values), 51, 0.3, relative=0.08, degrees=1)

    def test_mean_profile_is_the_profile(self):
        x = structured()
        values = gaussian(x, 51, 0.3)
        s, profile = mean_profile(x, values, measure_band(x, values), 0.4)
        np.testing.assert_allclose(profile, np.exp(-4 * np.log(2) * (s / 0.3) ** 2), atol=0.03)

    def test_a_homogeneous_field_has_no_band(self):
        for values in (np.ones(len(structured())), 1 + 0.2 * structured()[:, 1]):
            with self.assertRaises(ResultsError):
                measure_band(structured(), values)


class Run(unittest.TestCase):
    """Shear displacement along a band, u = step * t * erf-like step across it: the strain is Gaussian in the reference."""

    INCLINATION, THICKNESS, SHEAR = 51.0, 0.3, 0.02

    def displacement(self, x, step):
        along, across = axes_of(self.INCLINATION)
        grid = np.linspace(-3, 3, 6001)
        slip = np.cumsum(np.exp(-4 * np.log(2) * (grid / self.THICKNESS) ** 2)) * (grid[1] - grid[0])
        return self.SHEAR * step * np.interp((x - (0.5, 1.0)) @ across, grid, slip)[:, None] * along

    def gradient(self, x, step):
        along, across = axes_of(self.INCLINATION)
        return self.SHEAR * step * gaussian(x, self.INCLINATION, self.THICKNESS)[:, None, None] * np.outer(along, across)

    def homogeneous_then_band(self, x, step):
        compression = np.diag([0.02, -0.02])
        return np.tile(compression, (len(x), 1, 1)) + self.gradient(x, step - 1) @ (np.eye(2) + compression)

    def test_total_strain(self):
        with tempfile.TemporaryDirectory() as folder:
            write_run(Path(folder), self.displacement, self.gradient, [1, 2])
            band = band_of_run(folder)
        self.assertLess(abs(band.thickness / self.THICKNESS - 1), 0.01)
        self.assertLess(abs(band.inclination - self.INCLINATION), 0.2)

    def test_strain_between_two_steps_leaves_out_what_came_before(self):
        with tempfile.TemporaryDirectory() as folder:
            still = lambda x, step: np.zeros_like(x)
            write_run(Path(folder), still, self.homogeneous_then_band, [1, 2])
            increment = band_of_run(folder, first=1, last=2)
        self.assertLess(abs(increment.thickness / self.THICKNESS - 1), 0.01)
        self.assertLess(abs(increment.inclination - self.INCLINATION), 0.2)

    def test_a_step_without_fields_is_named(self):
        with tempfile.TemporaryDirectory() as folder:
            write_run(Path(folder), self.displacement, self.gradient, [1, 2])
            with self.assertRaisesRegex(ResultsError, r"no fields of step 7; it has \[1, 2\]"):
                band_of_run(folder, first=7)


if __name__ == "__main__":
    unittest.main()
