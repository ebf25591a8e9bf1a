"""What YADE's archive drops, found by saving and restoring: a volume element lives in archives (templates, checkpoints).

Some laws keep a part of their state in attributes that YADE does not save (2023.02a: the shear force of CpmPhys), and
forces of O.forces.setPermF are in no archive at all. So every template is restored and compared with itself.
"""

from dataclasses import dataclass

import numpy as np

from contact_loop import contacts

TOLERANCE = 1e-6  # relative; a restored scene repeats itself to 1e-13


@dataclass
class State:
    """What a scene answers at rest inside a step, its contact forces being found."""

    stress: np.ndarray  # (3, 3) [Pa], tension positive
    pairs: list  # (id1, id2) of the m real contacts, sorted
    normal: np.ndarray  # (m, 3) normal forces [N]; zeros for laws that do not tell them
    shear: np.ndarray  # (m, 3) shear forces [N]
    unbalanced: float
    kinetic: float  # energy [J]
    elastic: float  # energy of the contacts that know kn and ks [J]


def state(O):
    """The State of YADE's current scene."""
    from yade._utils import getStress, kineticEnergy, unbalancedForce

    contacts = sorted(O.interactions, key=lambda i: (i.id1, i.id2))
    forces = {name: np.zeros((len(contacts), 3)) for name in ("normalForce", "shearForce")}
    elastic = 0.0
    for k, contact in enumerate(contacts):
        phys = contact.phys
        for (name, rows), stiffness in zip(forces.items(), ("kn", "ks")):
            rows[k] = getattr(phys, name, (0.0, 0.0, 0.0))
            if getattr(phys, stiffness, 0.0) > 0:
                elastic += rows[k] @ rows[k] / (2 * getattr(phys, stiffness))
    stress = np.array(getStress()).reshape(3, 3)
    pairs = [(i.id1, i.id2) for i in contacts]
    return State(stress, pairs, *forces.values(), unbalancedForce(), kineticEnergy(), elastic)


def differences(a, b):
    """{what: size} by which State b differs from a: stress over its norm, forces over the norm of all contact forces (those
    of contacts that only one has count in full), unbalanced force as it is (it is a ratio), contacts as a number, energies
    over the elastic one of a."""
    scale = _positive(np.hypot(np.linalg.norm(a.normal), np.linalg.norm(a.shear)))
    energy = _positive(a.elastic)
    return {
        "stress": float(np.linalg.norm(b.stress - a.stress) / _positive(np.linalg.norm(a.stress))),
        "normal forces": float(_distance(a, b, "normal") / scale),
        "shear forces": float(_distance(a, b, "shear") / scale),
        "unbalanced force": abs(b.unbalanced - a.unbalanced),
        "contacts": len(set(a.pairs) ^ set(b.pairs)),
        "elastic energy": abs(b.elastic - a.elastic) / energy,
        "kinetic energy": abs(b.kinetic - a.kinetic) / energy,
    }


def _positive(x):
    return float(x) if x > 0 else 1.0


def _distance(a, b, name):
    if a.pairs == b.pairs:
        return np.linalg.norm(getattr(b, name) - getattr(a, name))
    theirs = dict(zip(b.pairs, getattr(b, name)))
    mine = dict(zip(a.pairs, getattr(a, name)))
    zero = np.zeros(3)
    return np.linalg.norm([theirs.get(p, zero) - mine.get(p, zero) for p in mine.keys() | theirs.keys()])


def refuse_not_finite(O, when):
    """Raises ValueError, naming the law, where stress, contact forces or cell are not numbers."""
    if O.interactions.countReal() == 0:
        raise ValueError(f"The YADE scene has no contacts {when}: a volume element must carry a stress.")
    now = state(O)
    numbers = (now.stress, now.normal, now.shear, np.array(O.cell.hSize), now.unbalanced)
    if all(np.isfinite(x).all() for x in numbers):
        return
    raise ValueError(
        f"The YADE scene answers with what is not a number {when} (contact law {law_names(O)}): a volume element must have "
        "a finite stress; check the attributes of the contacts' physics and the law in the script."
    )


def refuse_lost_grains(O):
    """Raises ValueError where a grain's position is not a number: the simulation has diverged."""
    if not len(O.bodies):
        raise ValueError("The YADE scene has no bodies: a volume element is made of grains.")
    lost = [b.id for b in O.bodies if not np.isfinite(b.state.pos).all()]
    if lost:
        raise ValueError(
            f"The positions of {len(lost)} bodies of the YADE scene, body {lost[0]} among them, are not numbers: its "
            "simulation has diverged; lower O.dt in the script."
        )


def refuse_other_forces(O):
    """Raises ValueError where other forces act on grains at rest than those that their contacts tell as normalForce and
    shearForce, or YADE's stress is not the sum of these: the stress of the volume element would be wrong without a word.
    (Capillary bridges; laws that keep their forces with the opposite sign.)"""
    now = state(O)
    forces = now.normal + now.shear
    scale = _positive(np.linalg.norm(forces))
    told = np.zeros((len(O.bodies), 3))
    for (first, second), f in zip(now.pairs, forces):
        told[first] -= f
        told[second] += f
    acting = np.array([O.forces.f(id) for id in range(len(O.bodies))])
    off = {"those that act on the grains": np.linalg.norm(acting - told) / scale}
    if not any(b.isClump for b in O.bodies):
        off["YADE's stress"] = _distance_of_stress(O, now, forces)
    parts = [f"{what} by {size:.1e}" for what, size in off.items() if not size <= TOLERANCE]
    if not parts:
        return
    turned = np.linalg.norm(acting + told) <= TOLERANCE * scale
    why = "are kept with the opposite sign: they differ from " if turned else "are not all that act between its grains: they differ from "
    raise ValueError(
        f"The normalForce and shearForce of the contacts of this scene (law {law_names(O)}) {why}{' and from '.join(parts)} "
        f"(relative, limit {TOLERANCE:.0e}). The stress of a volume element is their sum: use another law."
    )


def _distance_of_stress(O, now, forces):
    """How far YADE's stress is from that of the contacts' `forces` (m, 3), relative."""
    c = contacts(O)
    of_pair = dict(zip(now.pairs, forces))
    f = np.array([of_pair[tuple(pair)] for pair in c.ids.tolist()])
    stress = -np.einsum("ci,cj->ij", f, c.normal * c.length[:, None]) / O.cell.volume
    return np.linalg.norm(stress - now.stress) / _positive(np.linalg.norm(stress))


UNREST = 0.2  # unbalanced force of a scene that is not one in equilibrium
LOUD = 0.02  # a change by which adoption is to be read about: grains that go on moving for a step change less


def notes_on_adoption(left, made, dropped):
    """Sentences where the State `made` by adoption is not the one that the script `left` behind: its engines did more than
    strain and watch."""
    if left is None:
        return []
    found = differences(left, made)
    loud = [f"{what} {found[what]:.1e}" for what in ("stress", "normal forces", "shear forces", "unbalanced force")
            if not found[what] <= LOUD]
    if not loud:
        return []
    return [
        f"adoption itself changed the scene: {', '.join(loud)}; unbalanced force {left.unbalanced:.1e} as the script left it, "
        f"{made.unbalanced:.1e} now: forces of what was dropped ({', '.join(dropped) or 'nothing'}) are missing"
    ]


def refuse_dropped(before, after, O, when):
    """Raises ValueError where the restored State `after` is not that of `before`: names the law and what differs."""
    found = differences(before, after)
    parts = [
        f"{what} by {size:.1e}"
        for what, size in found.items()
        if not size <= TOLERANCE and what not in ("elastic energy", "kinetic energy")
    ]
    if not parts:
        return
    hint = "use another law"
    if before.unbalanced > UNREST:
        hint += ", or let the scene come to rest before its script ends, as by running until unbalancedForce() < 0.01"
    raise ValueError(
        f"YADE's archive does not keep the whole state of this scene (contact law {law_names(O)}): saved and restored "
        f"{when}, it differs in {', '.join(parts)} (relative, limit {TOLERANCE:.0e}; unbalanced force {before.unbalanced:.1e} "
        f"before, {after.unbalanced:.1e} after). A volume element is restored from such archives: {hint}."
    )


def law_names(O):
    """Names of the scene's contact laws."""
    loop = next((e for e in O.engines if type(e).__name__ == "InteractionLoop"), None)
    names = [type(f).__name__ for f in loop.lawDispatcher.functors] if loop else []
    own = [type(e).__name__ for e in O.engines if type(e).__name__.startswith("Law2_")]
    return ", ".join(names + own) or "none"
