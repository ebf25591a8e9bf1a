"""The elastic stiffness of volume elements whose contacts do not tell it, or whose grains are clumps: by small strains."""

from contextlib import suppress

import numpy as np

from contact_laws import resting_time_step, to_forces
from contact_loop import PLACE
from continuation import Copy

STRAIN = 1e-7  # each way; overlaps are thousands of times larger
SHORT = 3e-2  # of the time step: the grains are carried by the cell and have little time to move on their own; dashpots stay small


def stiffness(O, stress):
    """Affine stiffness of YADE's current scene, which rests at its contact forces; (3, 3, 3, 3) [Pa].

    stress() -> (3, 3). The grains follow the cell, as in Eq. (2); a contact at its Coulomb limit slips in one of the two
    directions of a probe and counts by half its tangential stiffness. Done in a forked process: the scene is not touched.
    """
    C = np.full((6, 6), np.nan)
    with suppress(RuntimeError):
        C = Copy(lambda _: _probed(O, stress)).ask(None)
    if not np.isfinite(C).all():
        raise RuntimeError("the stiffness of this volume element cannot be probed: its contact law fails at small strains.")
    return (0.5 * (C + C.T))[PLACE[:, :, None, None], PLACE]


def _probed(O, stress):
    from yade._utils import calm
    from yade.utils import Matrix3

    short, rest = SHORT * O.dt, resting_time_step(O)

    def strain(L, dt):
        O.cell.velGrad, O.dt = Matrix3(*L.ravel()), dt
        O.step()

    def at(L):
        """Stress after the strain L * short, without velocities: viscous forces are none of the stiffness."""
        strain(L, short)
        to_forces(O)
        for _ in range(2):  # dashpots across the cell's boundary see the velocity gradient of a step before
            strain(np.zeros((3, 3)), rest)
            calm()
            to_forces(O)
        s = stress()
        return 0.5 * (s + s.T)

    at(np.zeros((3, 3)))
    C = np.empty((6, 6))
    for a in range(6):
        L = (PLACE == a) * (STRAIN / short) / (PLACE == a).sum()
        forth, back = at(L), at(-2 * L)
        at(L)
        for b in range(6):
            C[b, a] = (forth - back)[PLACE == b][0] / (2 * STRAIN)
    return C
