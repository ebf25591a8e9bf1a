"""Contacts with moments: their rolling and twisting stiffness, for the largest stable time step, and a scene without them."""

import numpy as np

from contact_loop import values


def stiffness(c):
    """kr and ktw of the contacts `c` (contact_loop.Contacts), (m, 1) each [N m], 0 where a law has none; None where all are."""
    from yade.wrapper import Omega

    acts = np.array(_acts(Omega(), c.phys), dtype=bool)
    found = []
    for name in ("kr", "ktw"):
        known = all(hasattr(p, name) for p in c.phys)
        k = values(c, name) if known else np.array([getattr(p, name, 0.0) for p in c.phys])
        found.append(np.where(np.isfinite(k) & (k > 0) & acts, k, 0.0)[:, None])
    return tuple(found) if any(k.any() for k in found) else None


def _acts(O, phys):
    """Whether the law of each contact has moments: YADE fills kr and ktw of CohFrictPhys where momentRotationLaw is off too."""
    if any(getattr(law, "always_use_moment_law", False) for law in _laws(O)):
        return [True] * len(phys)
    return [getattr(p, "momentRotationLaw", True) for p in phys]


def _laws(O):
    return [law for e in O.engines if type(e).__name__ == "InteractionLoop" for law in e.lawDispatcher.functors]


def pass_moments(O):
    """Whether a contact of the scene passes a moment that its rotation calls for."""
    phys = [i.phys for i in O.interactions]
    return any(acts and any(getattr(p, name, 0) > 0 for name in ("kr", "ktw", "mR")) for p, acts in zip(phys, _acts(O, phys)))


def take_moments(O):
    """Contacts of the scene, those that form later too, pass no moments any more. Raises ValueError where their law has no switch
    for them."""
    for law in _laws(O):
        _set(law, always_use_moment_law=False, includeMoment=False)
    for b in O.bodies:
        _set(b.mat, momentRotationLaw=False, mR=0.0)
    for i in O.interactions:
        zero = 0 * i.geom.normal
        _set(i.phys, momentRotationLaw=False, kr=0.0, ktw=0.0, mR=0.0, moment_bending=zero, moment_twist=zero, momentBend=zero, momentTwist=zero)
    if pass_moments(O):
        laws = ", ".join(type(law).__name__ for law in _laws(O))
        raise ValueError(f"ve.moments = false: the moments of {laws} cannot be taken away; write the script without them.")


def _set(thing, **values):
    for name, value in values.items():
        if hasattr(thing, name):
            setattr(thing, name, value)


def moments(c, k, w):
    """(m, 3) moments that the spins w (n, 3) of a unit of time put on the first bodies of the contacts; the second bodies
    get the opposite. k: (kr, ktw) of stiffness()."""
    turn = w[c.ids[:, 1]] - w[c.ids[:, 0]]
    twist = np.einsum("ci,ci->c", turn, c.normal)[:, None] * c.normal
    return k[0] * (turn - twist) + k[1] * twist
