"""One pass over the contacts of YADE's current scene, and the sums that the volume element needs of it."""

import numpy as np


def contacts(O):
    """Real contacts as arrays (m = their number):

    ids (m, 2) int; normal (m, 3) unit, from the first to the second; length (m,) of the branch vector [m];
    kn, ks (m,) [N/m]; shear (m, 3) [N].
    """
    ids, normal, length, kn, ks, shear = [], [], [], [], [], []
    for i in O.interactions:
        g, p = i.geom, i.phys
        ids.append((i.id1, i.id2))
        normal.append(g.normal)
        length.append(g.refR1 + g.refR2 - g.penetrationDepth)
        kn.append(p.kn)
        ks.append(p.ks)
        shear.append(p.shearForce)
    shape = (len(ids), 3)
    return {
        "ids": np.array(ids, dtype=int).reshape(-1, 2),
        "normal": np.array(normal).reshape(shape),
        "length": np.array(length),
        "kn": np.array(kn),
        "ks": np.array(ks),
        "shear": np.array(shear).reshape(shape),
    }


def stiffness(c, volume):
    """Eq. (2) of Nguyen et al. (2017) with both tangents, C = (1/V) sum [(kn-kt) n_i n_k + kt d_ik] l_j l_l,
    symmetrised in both pairs; (3, 3, 3, 3) [Pa]. `c` from contacts(), `volume` of the cell [m^3]."""
    n, l2 = c["normal"], c["length"] ** 2
    C = np.einsum("c,ci,cj,ck,cl->ijkl", (c["kn"] - c["ks"]) * l2 / volume, n, n, n, n, optimize=True)
    C += np.einsum("ik,jl->ijkl", np.eye(3), np.einsum("c,cj,cl->jl", c["ks"] * l2 / volume, n, n, optimize=True))
    C = 0.5 * (C + C.transpose(1, 0, 2, 3))
    return 0.5 * (C + C.transpose(0, 1, 3, 2))
