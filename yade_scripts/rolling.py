"""Rolling and twisting stiffness of contacts with moments, for the largest stable time step."""

import numpy as np

from contact_loop import values


def stiffness(c):
    """kr and ktw of the contacts `c` (contact_loop.Contacts), (m, 1) each [N m], 0 where a law has none; None where all are."""
    acts = _acts(c)
    found = []
    for name in ("kr", "ktw"):
        known = all(hasattr(p, name) for p in c.phys)
        k = values(c, name) if known else np.array([getattr(p, name, 0.0) for p in c.phys])
        found.append(np.where(np.isfinite(k) & (k > 0) & acts, k, 0.0)[:, None])
    return tuple(found) if any(k.any() for k in found) else None


def _acts(c):
    """(m,) whether a contact's law has moments: YADE fills kr and ktw of CohFrictPhys where momentRotationLaw is off too."""
    from yade.wrapper import Omega

    loop = next(e for e in Omega().engines if type(e).__name__ == "InteractionLoop")
    if any(getattr(law, "always_use_moment_law", False) for law in loop.lawDispatcher.functors):
        return np.full(len(c.phys), True)
    return np.array([getattr(p, "momentRotationLaw", True) for p in c.phys], dtype=bool)


def moments(c, k, w):
    """(m, 3) moments that the spins w (n, 3) of a unit of time put on the first bodies of the contacts; the second bodies
    get the opposite. k: (kr, ktw) of stiffness()."""
    turn = w[c.ids[:, 1]] - w[c.ids[:, 0]]
    twist = np.einsum("ci,ci->c", turn, c.normal)[:, None] * c.normal
    return k[0] * (turn - twist) + k[1] * twist
