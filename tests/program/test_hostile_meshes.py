"""Meshes that are damaged, or that mean something else: each is refused with its sentence, or is right in spite of it.

    test_hostile_meshes.py FEMXDEM CASES      FEMXDEM: the executable; CASES: tests/cases/mesh
"""

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

FEMXDEM, CASES = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
FOLDER = Path(tempfile.mkdtemp(prefix="femxdem_meshes_"))
MESH = (CASES / "z_of_round_off.msh").read_text()
PLATE = (CASES / "plate.toml").read_text().replace('"plain.geo"', '"theirs.msh"')
RIGHT = -107347.75  # force of the plate [N/m]
NODE_1, ELEMENT_9 = "1 0 0 0\n", "9 16 2 5 1 1 5 17 14 6 18 19 16\n"

# What is changed: (old, new) ..., and what is said of it.
REFUSED = {
    "inside_out": ([("5 0.4999999999986921 0 0", "5 -0.2 0.9 0")], "turned inside out at a Gauss point|folded"),
    "middle_beyond_its_corner": ([("6 0.2499999999994184 0", "6 1.7 0")], "turned inside out|folded"),
    "twisted": ([(ELEMENT_9, "9 16 2 5 1 1 5 14 17 6 18 19 16\n")], "turned inside out|folded|side of|lie at one place|middle"),
    "no_area": ([("3 1 1 0", "3 1 0 0"), ("10 1 0.7499999999993461", "10 1 0.2")], "turned inside out|one place|folded"),
    "two_nodes_at_one_place": ([("2 1 0 1.1102230246251565e-16", "2 0.4999999999986921 0 0")], "is folded: its Jacobian"),
    "node_twice_in_an_element": ([(ELEMENT_9, "9 16 2 5 1 1 5 17 14 6 18 19 6\n")], "node|side|inside out"),
    "unknown_node": ([(ELEMENT_9, "9 16 2 5 1 1 5 17 99 6 18 19 16\n")], "Gmsh cannot read it|node"),
    "node_of_no_number": ([(NODE_1, "1 0 nan 0\n")], "number|node 1|Gmsh cannot read it"),
    "node_of_infinity": ([("3 1 1 0\n", "3 inf 1 0\n")], "is folded: its Jacobian"),
    "lifted": ([("3 1 1 0\n", "3 1 1 0.5\n")], "node 3 lies at z = 0.5"),
    "triangle_among_quadrilaterals": ([("12\n1 8", "13\n13 9 2 5 1 1 5 17 6 18 16\n1 8")], "elements of type '.*6.*only 8-node"),
    "four_nodes": ([(ELEMENT_9, "9 3 2 5 1 1 5 17 14\n")], "elements of type 'Quadrilateral 4'.*only 8-node"),
    "nine_nodes": ([(ELEMENT_9, "9 10 2 5 1 1 5 17 14 6 18 19 16 20\n")], "elements of type 'Quadrilateral 9'.*only 8-node"),
    "straight_lines": ([("1 8 2 1 1 1 5 6", "1 1 2 1 1 1 5")], "elements of type 'Line 2'"),
    "no_surfaces": ([(line + "\n", "") for line in MESH.splitlines() if " 16 2 5 1 " in line] + [("12\n1 8", "8\n1 8")], "no surface elements"),
    "edge_that_is_none": ([('1 3 "top"', '1 3 "lid"')], "edge 'top'"),
    "edge_within": ([("5 8 2 3 3 3 11 12", "5 8 2 3 3 5 17 18")], "physical curve 'top' is a side of 2 elements"),
    "edge_beside": ([("5 8 2 3 3 3 11 12", "5 8 2 3 3 3 11 6")], "line 5 of physical curve 'top' has the middle of an element's side but not its ends"),
    "edge_without_lines": ([(f"{k} 8 2 3 3 {rest}\n", "") for k, rest in ((5, "3 11 12"), (6, "11 4 13"))] + [("12\n1 8", "10\n1 8")],
                           "edge 'top'|physical curve 'top' has no lines"),
    "hole_of_a_missing_element": ([("12 16 2 5 1 17 8 3 11 21 10 12 20\n", ""), ("12\n1 8", "11\n1 8")], "side of 0 elements"),
    "hanging": ([("12 16 2 5 1 17 8 3 11 21 10 12 20\n", "12 16 2 5 1 18 8 3 11 21 10 12 20\n")], "hanging|side|inside out|middle"),
    "cut_in_the_nodes": ([(MESH[MESH.index("11 0.5"):], "")], "Gmsh cannot read it|no surface elements"),
    "cut_in_the_elements": ([(MESH[MESH.index("9 16 2"):], "")], "Gmsh cannot read it|no surface elements"),
    "more_nodes_than_there_are": ([("$Nodes\n21", "$Nodes\n2100")], "Gmsh cannot read it|no surface elements"),
    "billions_of_nodes": ([("$Nodes\n21", "$Nodes\n99999999999")], "Gmsh"),
    "negative_count": ([("$Nodes\n21", "$Nodes\n-21")], "Gmsh cannot read it|no surface elements"),
    "unknown_kind": ([("9 16 2", "9 777 2")], "Gmsh cannot read it|elements"),
    "no_header": ([("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", "")], "Gmsh cannot read it|no surface elements"),
    "of_the_future": ([("2.2 0 8", "7.3 0 8")], "Gmsh cannot read it|format"),
    "binary_by_its_header": ([("2.2 0 8", "2.2 1 8")], "Gmsh cannot read it"),
    "empty": ([(MESH, "")], "Gmsh cannot read it|no surface elements"),
    "words": ([(MESH, "Dear colleague,\nthe mesh is attached.\n")], "Gmsh cannot read it|no surface elements"),
    "zeros": ([(MESH, "\0" * 3000)], "Gmsh cannot read it|no surface elements"),
}
# The force is that of the plate.
RIGHT_ALL_THE_SAME = {
    "clockwise": [(ELEMENT_9, "9 16 2 5 1 1 14 17 5 16 19 18 6\n")],
    "listed_twice": [("12\n1 8", "13\n13 16 2 5 1 5 17 14 1 18 19 16 6\n1 8")],
    "orphan_node": [("$Nodes\n21\n", "$Nodes\n22\n900 7 7 3\n")],
    "line_listed_twice": [("12\n1 8", "13\n77 8 2 3 3 11 3 12\n1 8")],
    "points_too": [("12\n1 8", "13\n77 15 2 9 9 1\n1 8")],
    "numbers_with_gaps": [("9 16 2 5", "90000 16 2 5")],
    "tabs_and_dos": [("\n", "\r\n")],
}


def changed(edits):
    text = MESH
    for old, new in edits:
        assert old in text, old
        text = text.replace(old, new) if old == "\n" else text.replace(old, new, 1)
    return text


def run(text):
    """(exit status, what it said, force at the end or None)."""
    (FOLDER / "theirs.msh").write_bytes(text.encode() if isinstance(text, str) else text)
    (FOLDER / "plate.toml").write_text(PLATE)
    done = subprocess.run([str(FEMXDEM), "run", "plate.toml", "--out", "o", "--overwrite"], cwd=FOLDER, capture_output=True,
                          text=True, errors="replace", timeout=120)
    rows = (FOLDER / "o/history.csv").read_text().splitlines() if done.returncode == 0 else []
    force = float(dict(zip(rows[0].split(","), rows[-1].split(",")))["force"]) if rows else None
    return done.returncode, done.stdout + done.stderr, force


class Meshes(unittest.TestCase):
    def test_refused(self):
        for name, (edits, sentence) in REFUSED.items():
            with self.subTest(name):
                status, said, _ = run(changed(edits))
                self.assertEqual(status, 2, said)
                self.assertRegex(said.strip().splitlines()[-1], sentence)

    def test_right(self):
        for name, edits in RIGHT_ALL_THE_SAME.items():
            with self.subTest(name):
                status, said, force = run(changed(edits))
                self.assertEqual(status, 0, said)
                self.assertAlmostEqual(force, RIGHT, delta=0.01, msg=said)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
