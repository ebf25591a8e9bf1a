"""The sums over contacts against YADE's own, against loops, and against closed forms of an isotropic packing."""

import unittest

import numpy as np

import contact_loop
from cells import ADHESIVE, element, engine, packing, rate, select

SPEC = packing(spheres=200, contact_law="friction", stiffness_ratio=2.0)
SHEAR = [[0.3, 1.0, 0.2], [0.0, -0.3, 0.4], [0.1, 0.0, 0.0]]


def sheared(spec):
    ve = element(spec)
    engine().deform(ve, rate(ve, 5e-3, SHEAR), 60)
    O = select(ve)
    c = contact_loop.contacts(O)
    return O, c, contact_loop.values(c, "kn"), contact_loop.values(c, "ks")


def one_tangent_stiffness(c, kn, kt, shear, volume):
    """YADE's getStressAndTangent: (6, 6) [Pa] in Voigt order xx, yy, zz, yz, zx, xy, with the one tangent along the
    current shear force `shear` (m, 3) and none where it vanishes (Kruyt and Rothenburg 1998)."""
    size = np.linalg.norm(shear, axis=1, keepdims=True)
    t = np.divide(shear, size, out=np.zeros_like(shear), where=size > 0)
    i, j = np.array([0, 1, 2, 1, 2, 0]), np.array([0, 1, 2, 2, 0, 1])
    S = np.zeros((6, 6))
    for k, direction in ((kn, c.normal), (kt, t)):
        b = 0.5 * (direction[:, i] * c.normal[:, j] + direction[:, j] * c.normal[:, i]) * c.length[:, None]
        S += b.T @ (k[:, None] * b) / volume
    return S


class AgainstYade(unittest.TestCase):
    def test_one_tangent_matrix(self):
        engine()  # loads YADE
        from yade._utils import getStressAndTangent

        for spec in (SPEC, ADHESIVE):
            O, c, kn, kt = sheared(spec)
            shear = np.array([list(p.shearForce) for p in c.phys])
            ours = one_tangent_stiffness(c, kn, kt, shear, O.cell.volume)
            yade = np.array(getStressAndTangent(symmetry=True)[1]).reshape(6, 6)  # its upper triangle
            np.testing.assert_allclose(np.triu(ours), yade, rtol=0, atol=1e-12 * np.abs(yade).max())

    def test_normals_and_branch_vectors(self):
        O, c, _, _ = sheared(ADHESIVE)
        for (i, j), n, length in zip(c.ids, c.normal, c.length):
            g = O.interactions[int(i), int(j)].geom
            np.testing.assert_allclose(n, list(g.normal), rtol=0, atol=1e-12)
            self.assertAlmostEqual(length, g.refR1 + g.refR2 - g.penetrationDepth, delta=1e-12 * length)

    def test_fabric(self):
        O, c, _, _ = sheared(ADHESIVE)
        from yade._utils import fabricTensor

        yade = np.array(fabricTensor()[0]).reshape(3, 3)
        ours = contact_loop.fabric(c, np.full(len(c.length), 1 / len(c.length)))
        np.testing.assert_allclose(ours, yade[[0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]], rtol=0, atol=1e-12)


class Stiffness(unittest.TestCase):
    def test_is_equation_2_with_both_tangents(self):
        O, c, kn, kt = sheared(SPEC)
        C, V = np.zeros((3, 3, 3, 3)), O.cell.volume
        for n, length, k, s in zip(c.normal, c.length, kn, kt):
            t = np.linalg.svd(n[None])[2][1]
            K = k * np.outer(n, n) + s * np.outer(t, t) + s * np.outer(np.cross(n, t), np.cross(n, t))
            C += np.einsum("ik,j,l->ijkl", K, n, n) * length**2 / V
        C = 0.5 * (C + C.transpose(1, 0, 2, 3))
        C = 0.5 * (C + C.transpose(0, 1, 3, 2))
        ours = contact_loop.stiffness(c, kn, kt, V)
        np.testing.assert_allclose(ours, C, rtol=0, atol=1e-12 * np.abs(C).max())

    def test_noted_stiffnesses_are_those_of_the_contacts(self):
        for spec in (SPEC, ADHESIVE):
            O, c, kn, kt = sheared(spec)
            noted = contact_loop.stiffnesses(O, c)
            self.assertEqual([len(set(k)) for k in noted], [1, 1])
            np.testing.assert_allclose(noted, (kn, kt), rtol=1e-12, atol=0)
        c.phys[0].kn *= 2
        np.testing.assert_array_equal(contact_loop.stiffnesses(O, c)[0], contact_loop.values(c, "kn"), "not as noted: read")

    def test_isotropic_packing_has_the_voigt_moduli(self):
        """K = N <l^2> kn/(9 V), G = N <l^2> (2 kn + 3 kt)/(30 V)."""
        ve = element(SPEC)
        O = select(ve)
        c = contact_loop.contacts(O)
        kn, kt, V = 5e4, 2.5e4, O.cell.volume
        out = np.full(81, np.nan)
        engine().stiffness(ve, out)
        C = out.reshape(3, 3, 3, 3)
        sum_l2 = (c.length**2).sum()
        K, G = sum_l2 * kn / (9 * V), sum_l2 * (2 * kn + 3 * kt) / (30 * V)
        self.assertAlmostEqual(np.einsum("iikk", C) / 9, K, delta=1e-12 * K)
        d = np.eye(3)
        shear = np.einsum("ik,jl->ijkl", d, d) + np.einsum("il,jk->ijkl", d, d)
        isotropic = (K - 2 * G / 3) * np.einsum("ij,kl->ijkl", d, d) + G * shear
        mean_G = (np.einsum("ijij", C) - np.einsum("iikk", C) / 3) / 10
        self.assertAlmostEqual(mean_G, G, delta=1e-12 * G)
        self.assertLess(np.linalg.norm(C - isotropic) / np.linalg.norm(isotropic), 0.06)


if __name__ == "__main__":
    unittest.main()
