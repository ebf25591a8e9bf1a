"""What makes a DEM step of a prepared packing cheaper changes nothing in it."""

import unittest

import numpy as np

from cells import ADHESIVE, element, engine, rate, select

BIAXIAL = [[0.6, 0.1, 0.0], [0.1, -1.0, 0.05], [0.0, 0.05, 0.0]]


def loop(ve):
    """YADE's contact loop of that volume element."""
    return next(e for e in select(ve).engines if type(e).__name__ == "InteractionLoop")


def motion(ve):
    """(spheres, 12) positions, velocities and spins in the scene's units, and the forces on the spheres [N]."""
    O = select(ve)
    return np.array([[*b.state.pos, *b.state.vel, *b.state.angVel, *O.forces.f(b.id)] for b in O.bodies])


class Rotations(unittest.TestCase):
    def test_the_rotations_at_the_contacts_are_not_followed_and_change_nothing(self):
        for law in ("adhesive", "bonded"):
            without, followed = element({**ADHESIVE, "contact_law": law}), element({**ADHESIVE, "contact_law": law})
            functors = [loop(ve).geomDispatcher.functors[0] for ve in (without, followed)]
            self.assertFalse(functors[0].updateRotations)
            functors[1].updateRotations = True
            contacts = select(without).interactions.countReal()
            for sign in (1, 1, -1):
                for ve in (without, followed):
                    engine().deform(ve, sign * rate(ve, 1e-2, BIAXIAL), 200)
            self.assertNotEqual(select(without).interactions.countReal(), contacts)
            np.testing.assert_array_equal(motion(without), motion(followed))
            bent = [max(i.geom.bending.norm() for i in select(ve).interactions) for ve in (without, followed)]
            self.assertTrue(bent[0] == 0 < bent[1], bent)


if __name__ == "__main__":
    unittest.main()
