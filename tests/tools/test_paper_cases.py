"""Cases that are compared with one another differ in nothing but what the comparison is about."""

import tomllib
import unittest
from pathlib import Path

VALIDATION = Path(__file__).parents[2] / "validation"


def case(name):
    return tomllib.loads((VALIDATION / name).read_text())


def without(one, *keys):
    """The case without tables of these names, gradients (they need v_ij) left out."""
    left = {key: value for key, value in one.items() if key not in keys}
    left["load"] = [load for load in left["load"] if load["kind"] != "gradient"]
    return left


class Paper(unittest.TestCase):
    def test_biaxial_meshes_have_the_same_body_and_imperfection(self):
        reference = case("biaxial/128.toml")
        for name in ("512", "first_gradient_128", "first_gradient_512"):
            other = case(f"biaxial/{name}.toml")
            self.assertEqual(without(reference, "mesh", "element"), without(other, "mesh", "element"), name)
            self.assertEqual(reference["mesh"]["width"], other["mesh"]["width"])
            self.assertEqual(reference["mesh"]["height"], other["mesh"]["height"])
        self.assertEqual(reference["element"], case("biaxial/512.toml")["element"])

    def test_the_imperfection_covers_whole_elements_of_every_mesh(self):
        for name in ("128", "512"):
            one = case(f"biaxial/{name}.toml")
            x0, y0, x1, y1 = one["region"][0]["box"]
            for value, count, length in ((x0, "nx", 1), (x1, "nx", 1), (y0, "ny", 2), (y1, "ny", 2)):
                self.assertEqual(value * one["mesh"][count] / length % 1, 0)

    def test_cylinders_differ_in_mesh_and_element_alone(self):
        reference = case("hollow_cylinder/870.toml")
        for name in ("1280", "952"):
            self.assertEqual(without(reference, "mesh", "element"), without(case(f"hollow_cylinder/{name}.toml"), "mesh", "element"), name)
        self.assertEqual(reference["element"], case("hollow_cylinder/1280.toml")["element"])

    def test_no_stand_in(self):
        for name in ("biaxial/128", "biaxial/512", "biaxial/ve", "hollow_cylinder/870", "hollow_cylinder/1280", "hollow_cylinder/952"):
            self.assertEqual(case(f"{name}.toml")["ve"]["spheres"], 1000)

    def test_specimen_and_volume_element_are_of_one_packing_and_the_cylinder_of_a_denser_one(self):
        cells = [case(f"{name}.toml")["ve"] for name in ("biaxial/128", "biaxial/ve", "hollow_cylinder/870")]
        for cell in cells:
            cell.pop("region", None)
        self.assertEqual(cells[0], cells[1])
        self.assertEqual(cells[0] | {"compaction_friction": 0.0}, cells[2])


if __name__ == "__main__":
    unittest.main()
