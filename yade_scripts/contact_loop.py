"""One pass over the contacts of YADE's current scene, and the sums that a volume element needs of it.

Reading an attribute of a YADE object costs 0.25 us and more for a vector, whoever asks; so the pass reads as few as it
can, and the geometry comes from the positions of the bodies, which YADE hands over in bulk.
"""

from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter, methodcaller

import numpy as np

import contact_laws


@dataclass
class Contacts:
    """The m real contacts; the branch vector runs from the centre of the first body to that of the second."""

    ids: np.ndarray  # (m, 2) bodies
    normal: np.ndarray  # (m, 3) unit, along the branch vector
    length: np.ndarray  # (m,) of the branch vector [m]
    pairs: list  # YADE's objects

    @cached_property
    def phys(self):
        """YADE's objects with the stiffnesses and forces."""
        return list(map(attrgetter("phys"), self.pairs))


def contacts(O):
    """The real contacts of the scene of `O`. The cell must be wider than two branch vectors."""
    from yade._utils import coordsAndDisplacements

    pairs = list(O.interactions)
    ids = np.array([np.fromiter(map(attrgetter(name), pairs), int, len(pairs)) for name in ("id1", "id2")])
    x = np.column_stack([coordsAndDisplacements(axis)[0] for axis in range(3)])
    if len(x) != len(O.bodies):
        x = _positions_by_id(O)
    H = np.array(O.cell.hSize).reshape(3, 3)
    branch = x.take(ids[1], axis=0) - x.take(ids[0], axis=0)
    branch -= np.round(branch @ np.linalg.inv(H).T) @ H.T
    length = np.sqrt(np.einsum("ci,ci->c", branch, branch))
    return Contacts(ids.T, branch / length[:, None], length, pairs)


def _positions_by_id(O):
    """(n, 3) positions when bodies have been erased, NaN in their place."""
    x = np.full((len(O.bodies), 3), np.nan)
    for b in O.bodies:
        x[b.id] = b.state.pos
    return x


def has_stiffness(O, c):
    """Whether the physics of all contacts know their stiffnesses kn and ks, and have filled them in."""
    if not c.pairs or _all_alike(O, c):
        return bool(c.pairs)
    return all(hasattr(p, name) for p in c.phys for name in ("kn", "ks")) and all(
        np.isfinite(k).all() and (k > 0).all() for k in (values(c, "kn"), values(c, "ks"))
    )


def _all_alike(O, c):
    """Whether the scene notes constant stiffnesses and its first contact has them."""
    constant = contact_laws.constant_stiffness(O)
    return constant and np.allclose(constant, (c.pairs[0].phys.kn, c.pairs[0].phys.ks), rtol=1e-12, atol=0)


def stiffnesses(O, c):
    """kn and ks of the contacts, (m,) each [N/m]; not read one by one in a packing whose contacts are all alike."""
    if _all_alike(O, c):
        return tuple(np.full(len(c.pairs), k) for k in contact_laws.constant_stiffness(O))
    return values(c, "kn"), values(c, "ks")


def values(c, name):
    """(m,) attribute `name` of the contacts' physics."""
    return np.fromiter(map(attrgetter(name), c.phys), float, len(c.phys))


def norms(c, name):
    """(m,) norm of the vector attribute `name` of the contacts' physics."""
    return np.fromiter(map(methodcaller("norm"), map(attrgetter(name), c.phys)), float, len(c.phys))


# Pairs (i, j), i <= j, of a symmetric tensor's six components, and each component's place in them.
I, J = np.array([0, 1, 2, 0, 1, 2]), np.array([0, 1, 2, 1, 2, 0])
PLACE = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


def fabric(c, weight):
    """sum_c weight n_i n_j, (6,) in the order xx, yy, zz, xy, yz, zx."""
    return weight @ (c.normal[:, I] * c.normal[:, J])


def stiffness(c, kn, kt, volume):
    """Eq. (2) of Nguyen et al. (2017) with both tangents, symmetrised in both pairs; (3, 3, 3, 3) [Pa]:

    C_ijkl = (1/V) sum [(kn - kt) n_i n_k + kt delta_ik] l_j l_l, with n n + t t + w w = I and l = |l| n.
    kn, kt (m,) [N/m]; volume of the cell [m^3].
    """
    l2 = c.length**2 / volume
    nn = c.normal[:, I] * c.normal[:, J]
    C = (nn.T @ (((kn - kt) * l2)[:, None] * nn))[PLACE[:, :, None, None], PLACE]
    G = 0.25 * fabric(c, kt * l2)[PLACE]
    d = np.eye(3)
    for spec in ("ik,jl->ijkl", "il,jk->ijkl", "jk,il->ijkl", "jl,ik->ijkl"):
        C += np.einsum(spec, d, G)
    return C


def relaxed_stiffness(c, kn, kt, volume):
    """Stiffness of the same contacts when the grains move and spin into equilibrium; (3, 3, 3, 3) [Pa].

    C = C of Eq. (2) - (1/V) F^T K^-1 F: minimum over the grains' u, theta of (1/2) sum d.k.d with
    d = E l + u_j - u_i - (r_i theta_i + r_j theta_j) x n. No contact slides, opens or turns (terms of order 1/kappa).
    """
    from compact_cell import released_stiffness

    released = released_stiffness(int(c.ids.max()) + 1, c.ids, c.normal, c.length, kn, kt, volume)
    return stiffness(c, kn, kt, volume) - released[PLACE[:, :, None, None], PLACE]


def stiffness_of_kind(O, c, radius, volume, kind):
    """affine, Eq. (2); relaxed; reduced, Eq. (2) with 0.93 kn and 0.63 kt, as the authors' code has it; sliding, Eq. (2)
    without the kt of contacts that slide. radius (n,) of the bodies [m]."""
    kn, kt = stiffnesses(O, c)
    if kind == "relaxed":
        return relaxed_stiffness(c, kn, kt, volume)
    if kind == "reduced":
        kn, kt = 0.93 * kn, 0.63 * kt
    if kind == "sliding":
        kt = np.where(at_coulomb_limit(c, radius), 0.0, kt)
    return stiffness(c, kn, kt, volume)


def at_coulomb_limit(c, radius):
    """(m,) whether a contact slides: its shear force is at the limit of its law, within 1e-6 of it.

    radius (n,) of the bodies [m]. False for laws without a Coulomb limit.
    """
    slides = np.zeros(len(c.phys), dtype=bool)
    for k, part in _by_class(c):
        if not hasattr(part.phys[0], "tangensOfFrictionAngle"):
            continue
        if hasattr(part.phys[0], "shearAdhesion"):
            overlap = radius[part.ids].sum(axis=1) - part.length
            unp = values(part, "unp") if hasattr(part.phys[0], "unp") else 0.0
            normal_force = values(part, "kn") * (overlap - unp)
            limit = values(part, "shearAdhesion") + values(part, "tangensOfFrictionAngle") * normal_force
            limit = np.maximum(limit, 0.0)
        else:
            limit = values(part, "tangensOfFrictionAngle") * norms(part, "normalForce")
        slides[k] = norms(part, "shearForce") >= (1 - 1e-6) * limit
    return slides


def adhesive(c):
    """(m,) whether a contact still has its adhesion."""
    adheres = np.zeros(len(c.phys), dtype=bool)
    for k, part in _by_class(c):
        if all(hasattr(part.phys[0], name) for name in ("normalAdhesion", "cohesionBroken")):
            adheres[k] = (values(part, "normalAdhesion") > 0) & (values(part, "cohesionBroken") == 0)
    return adheres


def _by_class(c):
    """The contacts by the class of their physics: (places among all, Contacts) of each; most packings have one class."""
    classes = list(map(type, c.phys))
    kinds = set(classes)
    if len(kinds) == 1:
        return [(slice(None), c)]
    found = []
    for kind in sorted(kinds, key=lambda k: k.__name__):
        k = np.array([i for i, other in enumerate(classes) if other is kind])
        found.append((k, Contacts(c.ids[k], c.normal[k], c.length[k], [c.pairs[i] for i in k])))
    return found
