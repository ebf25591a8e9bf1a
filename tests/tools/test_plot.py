"""Curves and figures from the files of a run."""

import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2] / "fe_master" / "program"))
from plot import plot_run, quarters
from results import (ResultsError, axial_curve, deformed_points, logarithmic_strain, natural_coordinates, path_curve, pressure_curve, read_mesh,
                     read_step, run_curve, shape_functions, strain_invariant)
from sample_run import write_run

G = np.array([[0.02, 0.1], [0.0, -0.05]])


def affine(x, step):
    return step * x @ G.T


def affine_gradient(x, step):
    return np.tile(step * G, (len(x), 1, 1))


class Files(unittest.TestCase):
    def setUp(self):
        self.temporary = tempfile.TemporaryDirectory()
        self.addCleanup(self.temporary.cleanup)
        self.folder = Path(self.temporary.name)
        write_run(self.folder, affine, affine_gradient, [1, 3], nx=3, ny=5)

    def test_curve_is_reaction_over_initial_width_and_pressure_against_nominal_strain(self):
        curve = axial_curve(self.folder)
        np.testing.assert_allclose(curve.strain, [0.01, 0.03], rtol=1e-14)
        np.testing.assert_allclose(curve.stress, [1.0, 3.0], rtol=1e-14)

    def test_curve_takes_the_current_width_where_it_is_monitored(self):
        case = self.folder / "case.toml"
        case.write_text(case.read_text() + '[[monitor]]\nname = "evaluations"\nquantity = "length"\nedge = "top"\n')
        np.testing.assert_allclose(axial_curve(self.folder).stress, [1.0, 1.0], rtol=1e-14)
        np.testing.assert_allclose(axial_curve(self.folder, nominal=True).stress, [1.0, 3.0], rtol=1e-14)

    def test_curve_without_confinement_is_in_pascals(self):
        case = self.folder / "case.toml"
        case.write_text(case.read_text().replace("value = 2e5", "value = 0.0"))
        curve = axial_curve(self.folder)
        self.assertEqual(curve.unit, "[Pa]")
        np.testing.assert_allclose(curve.stress, [2e5, 6e5], rtol=1e-14)

    def test_a_missing_monitor_is_named(self):
        with self.assertRaisesRegex(ResultsError, 'quantity = "reaction_y" on edge "bottom"; add it'):
            axial_curve(self.folder, edge="bottom")

    def test_path_curve_turns_logarithmic_into_nominal_strain(self):
        (self.folder / "history.csv").write_text("step,strain_yy,stress_yy\n1,-0.1,-4e5\n")
        curve = path_curve(self.folder)
        np.testing.assert_allclose(curve.strain, [1 - np.exp(-0.1)], rtol=1e-14)
        np.testing.assert_allclose(curve.stress, [2.0], rtol=1e-14)

    def test_path_curve_as_force_over_initial_width(self):
        (self.folder / "history.csv").write_text("step,strain_xx,strain_yy,stress_yy\n1,0.02,-0.1,-4e5\n")
        np.testing.assert_allclose(path_curve(self.folder, nominal=True).stress, [2.0 * np.exp(0.02)], rtol=1e-14)

    def cylinder(self):
        """The folder with the monitors of a cylinder: no edge has a top's."""
        case = self.folder / "case.toml"
        monitors = "".join(f'[[monitor]]\nname = "{n}"\nquantity = "{q}"\nedge = "inner"\n' for n, q in (
            ("p", "pressure"), ("ux", "displacement_x"), ("uy", "displacement_y")))
        case.write_text(case.read_text().split("[[monitor]]")[0] + monitors)
        (self.folder / "history.csv").write_text("step,time,load_factor,evaluations,residual,p,ux,uy\n"
                                                 "1,0.1,0.1,2,1e-3,4e5,0.03,0.04\n2,0.2,0.2,2,1e-3,6e5,0.3,0.4\n")

    def test_curve_of_a_cylinder_is_pressure_against_displacement_of_the_wall(self):
        self.cylinder()
        for curve in (pressure_curve(self.folder), run_curve(self.folder)):
            np.testing.assert_allclose(curve.strain, [0.05, 0.5], rtol=1e-14)
            np.testing.assert_allclose(curve.stress, [2.0, 3.0], rtol=1e-14)
            self.assertEqual(curve.of, "pressure on inner")

    def test_the_pressure_that_is_kept_is_sigma_0_wherever_it_stands(self):
        self.cylinder()
        case = self.folder / "case.toml"
        loaded = '[[load]]\nedge = "inner"\nkind = "pressure"\nvalue = 1.0\ntable = [[0.0, 1.0], [1.0, 4.0]]\n'
        case.write_text(case.read_text().replace("[[load]]", loaded + "[[load]]", 1))
        np.testing.assert_allclose(pressure_curve(self.folder).stress, [2.0, 3.0], rtol=1e-14)

    def test_curve_without_monitors_is_the_load_factor(self):
        case = self.folder / "case.toml"
        case.write_text(case.read_text().split("[[monitor]]")[0])
        np.testing.assert_allclose(run_curve(self.folder).stress, [0.0, 0.0], atol=0)
        self.assertEqual(run_curve(self.folder).of, "load factor")

    def test_a_case_without_a_top_gets_all_figures(self):
        self.cylinder()
        with tempfile.TemporaryDirectory() as out:
            files = plot_run(self.folder, Path(out), steps=[1], window=(0, 0.5, 0, 1))
            self.assertEqual([file.name for file in files], ["curve.png", "convergence.png", "maps_000001.png"])

    def test_a_volume_element_is_no_counterpart_of_a_cylinder(self):
        self.cylinder()
        with self.assertRaisesRegex(ResultsError, "leave --ve out"):
            plot_run(self.folder, self.folder / "figures", self.folder)

    def test_points_move_with_an_affine_deformation(self):
        mesh = read_mesh(self.folder)
        expected = mesh.points + mesh.points @ (3 * G).T
        np.testing.assert_allclose(deformed_points(mesh, read_step(self.folder)), expected, atol=1e-12)

    def test_the_quarters_of_the_elements_surround_their_points_and_fill_the_body(self):
        mesh, step = read_mesh(self.folder), read_step(self.folder)
        shapes = quarters(mesh, step.displacement)
        np.testing.assert_allclose(shapes.mean(axis=2).mean(axis=1), deformed_points(mesh, step).mean(axis=1), atol=1e-12)
        x, y = shapes[..., 0], shapes[..., 1]
        areas = 0.5 * np.sum(x * np.roll(y, -1, axis=-1) - y * np.roll(x, -1, axis=-1), axis=-1)
        self.assertAlmostEqual(areas.sum(), 2.0 * np.linalg.det(np.eye(2) + 3 * G), places=12)
        distance = np.linalg.norm(shapes.mean(axis=2) - deformed_points(mesh, step), axis=-1)
        self.assertLess(distance.max(), 0.05)

    def test_all_figures_are_written(self):
        with tempfile.TemporaryDirectory() as out:
            files = plot_run(self.folder, Path(out), steps=[1, 3])
            self.assertEqual([file.name for file in files], ["curve.png", "convergence.png", "maps_000001.png", "maps_000003.png"])
            self.assertTrue(all(file.stat().st_size > 5000 for file in files))


class Formulas(unittest.TestCase):
    def test_shape_functions_are_one_at_their_node(self):
        nodes = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)], dtype=float)
        np.testing.assert_allclose(shape_functions(nodes[:, 0], nodes[:, 1]), np.eye(8), atol=1e-15)

    def test_natural_coordinates_are_found_in_a_distorted_element(self):
        nodes = np.array([(0, 0), (2, 0.2), (2.3, 1.9), (-0.1, 1.5), (1, -0.2), (2.2, 1), (1, 1.8), (0.1, 0.8)])
        natural = np.array([[(-0.57, -0.57), (0.57, -0.57), (-0.57, 0.57), (0.9, 0.8)]])
        positions = shape_functions(natural[..., 0], natural[..., 1]) @ nodes
        np.testing.assert_allclose(natural_coordinates(nodes[None], positions), natural, atol=1e-12)

    def test_strain_invariant_of_a_rotated_stretch(self):
        angle = 1.1
        R = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        F = R @ np.diag(np.exp([0.2, -0.2, 0.0]))
        np.testing.assert_allclose(strain_invariant(F), 0.2 * np.sqrt(2), rtol=1e-14)
        np.testing.assert_allclose(logarithmic_strain(F), np.diag([0.2, -0.2, 0.0]), atol=1e-15)


if __name__ == "__main__":
    unittest.main()
