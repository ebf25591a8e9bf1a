"""Tells when the YADE that is installed has another cohesive law than the one that the volume elements were made with.

YADE 2025.2, for one, no longer takes the normal force of a contact that slides under attraction: packings and curves of
adhesive volume elements would be other ones without a word.
"""

import unittest
from dataclasses import dataclass

import numpy as np

import yade_modules
from two_spheres import DIAMETER, F_C, FRICTION, KN, STEP, Pair

KNOWN = "2023.02a"
TOLERANCE = 1e-6 * F_C
# By name: the first overlap [m] and increments of the overlap and along the contact in STEPs; f_c/kn is 20 of them
PATHS = {
    "sliding under pressure": (5.05e-6, [(0, s) for s in 90 * [1] + 150 * [-1]]),
    "sliding under attraction": (1.05e-6, [(0, s) for s in 30 * [1] + 60 * [-1] + 30 * [1]]),
    "opening to a gap and closing": (1.05e-6, 20 * [(-1, 0)] + 40 * [(1, 0)]),
    "sliding in a gap": (1.05e-6, 15 * [(-1, 0)] + 20 * [(0, 1)] + 60 * [(0.5, -1)]),
    "opening until it parts, closing again": (1.05e-6, 40 * [(-1, 0)] + 60 * [(1, 0)]),
}


@dataclass
class AdhesiveContact:
    """An implementation of its own of CohFrict as contact_laws.py sets it: overlap and slip to forces."""

    keeps_normal_force: bool = False  # of a contact that slides under attraction: not so in 2023.02a
    adhesion: float = F_C
    opening: float = F_C / KN  # what the elastic overlap lacks
    shear: float = 0.0
    real: bool = True

    def go(self, overlap, slip):
        """Normal force (compression positive), size of the shear force [N], and whether there is a contact."""
        if not self.real and overlap >= 0:  # formed anew: friction alone
            self.real, self.adhesion, self.opening, self.shear = True, 0.0, 0.0, 0.0
        normal = KN * (overlap - self.opening)
        if normal < -self.adhesion:  # the plateau, and its end
            normal, self.opening = -self.adhesion, overlap + self.adhesion / KN
            self.real = self.opening >= 0
        if not self.real:
            return 0.0, 0.0, False
        limit = max(0.0, FRICTION * (self.adhesion + normal))
        self.shear += KN * slip * DIAMETER / (DIAMETER - overlap)
        if abs(self.shear) > limit:
            self.shear = np.copysign(limit, self.shear)
            if normal < 0 and not self.keeps_normal_force:
                normal = 0.0
        return normal, abs(self.shear), True


def curves(**law):
    """By the name of the path, rows (steps, 3) of AdhesiveContact.go: YADE's, and those of the known or another law."""
    yades, known = {}, {}
    for name, (overlap, path) in PATHS.items():
        pair, contact, yades[name], known[name] = Pair("adhesive", overlap), AdhesiveContact(**law), [], []
        for closing, slip in path:
            pair.move(-closing * STEP, slip * STEP)
            yades[name].append((pair.normal_force, pair.shear_force, pair.contact is not None))
            known[name].append(contact.go(pair.overlap, slip * STEP))
    return yades, known


def differences(found, known):
    """Sentences on the curves that are not the known ones."""
    said = []
    for name in known:
        rows, expected = np.array(found[name], dtype=float), np.array(known[name], dtype=float)
        off = np.abs(rows - expected).max(axis=1) > TOLERANCE
        if off.any():
            k = int(np.argmax(off))
            (n, s, c), (n0, s0, c0) = rows[k] / (F_C, F_C, 1), expected[k] / (F_C, F_C, 1)
            said.append(
                f"{name}: {off.sum()} of {len(rows)} steps are others, in step {k + 1} the normal force is {n:.4g} f_c "
                f"instead of {n0:.4g}, the shear force {s:.4g} f_c instead of {s0:.4g}, contacts {c:.0f} instead of {c0:.0f}"
            )
    return said


def verdict(said, version):
    return (
        f"YADE {version} has another cohesive law than {KNOWN}, with which adhesive volume elements have been validated. "
        f"{'; '.join(said)}. Find out with validation/contact_laws what it does, and say it in contact_laws.py, "
        "before it is used."
    )


class Canary(unittest.TestCase):
    def test_the_cohesive_law_is_the_known_one(self):
        said = differences(*curves())
        self.assertEqual(said, [], verdict(said, yade_modules.versions()["yade"]))

    def test_the_law_of_2025_would_be_noticed(self):
        """Seen from it, what is installed is another one: it takes the normal force while a contact slides."""
        said = verdict(differences(*curves(keeps_normal_force=True)), "2025.2")
        self.assertIn("YADE 2025.2 has another cohesive law than 2023.02a", said)
        self.assertRegex(said, r"sliding under attraction: \d+ of 120 steps .* normal force is 0 f_c instead of -0\.47")
        self.assertIn("sliding in a gap", said)
        self.assertNotIn("sliding under pressure", said)
        self.assertNotIn("opening", said)


if __name__ == "__main__":
    unittest.main()
