"""The table of validation/contact_functors still holds: every law with its own physics, as the page says it."""

import re
import tempfile
import unittest
from pathlib import Path

import archive_check
import contact_functors
from cells import FRICTION, element, select

PAGE = Path(__file__).parents[2] / "validation" / "contact_functors" / "README.md"


def recorded():
    """{(law, physics): what became of it} of the page's tables."""
    rows = re.findall(r"^\| `([^`]+)` \| ([^|]+) \| ([^|]+) \|", PAGE.read_text(), re.MULTILINE)
    return {(law, physics.strip()): what.strip() for law, physics, what in rows}


class Table(unittest.TestCase):
    def test_of_all_functors_of_the_package(self):
        own, without = contact_functors.own_scenes()
        page, seen = recorded(), []
        known = {s.law for s in own} | set(without)
        self.assertEqual(known, contact_functors.derived("LawFunctor"))
        text = contact_functors.packing()
        for scene in own + contact_functors.options():
            with self.subTest(scene.name), tempfile.TemporaryDirectory() as folder:
                found = contact_functors.outcome(scene, text, folder)
                self.assertEqual(contact_functors.faults(found), [])
                law, _, physics = scene.name.partition(", ")
                self.assertEqual(contact_functors.row(scene, found).split(" | ")[2], page.get((law, physics)), found)
                seen.append((law, physics))
        self.assertEqual(len(seen), len(set(seen)), "two rows of one name")
        for law in without:
            self.assertIn(law, PAGE.read_text())

    def test_forces_that_contacts_do_not_tell(self):
        law = "Law2_ScGeom6D_InelastCohFrictPhys_CohesionMoment"
        turned = next(s for s in contact_functors.own_scenes()[0] if s.law == law)
        with tempfile.TemporaryDirectory() as folder:
            found = contact_functors.outcome(turned, contact_functors.packing(), folder)
        self.assertRegex(found["why"], f"law {law}.* are kept with the opposite sign")
        O = select(element(FRICTION))
        archive_check.refuse_other_forces(O)
        O.forces.addF(3, (1e-3, 0, 0))
        with self.assertRaisesRegex(ValueError, "are not all that act between its grains: they differ from those that act on the grains"):
            archive_check.refuse_other_forces(O)

    def test_probes_of_dashpots(self):
        """They slipped, and stiffened by their viscosity, in probes that strained too fast."""
        scene = next(s for s in contact_functors.options() if s.option == "dashpots betan, betas")
        with tempfile.TemporaryDirectory() as folder:
            self.assertLess(contact_functors.outcome(scene, contact_functors.packing(), folder)["eq2"], 0.03)

    def test_of_derived_physics_the_names(self):
        page = recorded()
        for scene in contact_functors.derived_scenes():
            law, _, physics = scene.name.partition(", ")
            self.assertIn((law, physics), page)


if __name__ == "__main__":
    unittest.main()
