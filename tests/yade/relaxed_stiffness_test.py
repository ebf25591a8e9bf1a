"""The relaxed stiffness of a contact network and the probed affine one: closed forms, bounds, YADE's own elastic answer."""

import unittest

import numpy as np

import contact_loop
from cells import FRICTION, element, engine, mandel, measure, select, stiffness

KN, KT, A = 5e4, 2e4, 1e-3


def lattice(n, kn_along_x):
    """Simple cubic, n^3 spheres of diameter A; the contacts along x have the stiffnesses `kn_along_x`, taken in turns by
    the layers. Contacts, kn, kt, volume."""
    number = np.arange(n**3).reshape(n, n, n)
    ids, normal, kn = [], [], []
    for axis in range(3):
        ids.append(np.stack([number.ravel(), np.roll(number, -1, axis).ravel()], axis=1))
        normal.append(np.tile(np.eye(3)[axis], (n**3, 1)))
        layer = np.repeat(np.arange(n), n * n) % len(kn_along_x)
        kn.append(np.array(kn_along_x)[layer] if axis == 0 else np.full(n**3, KN))
    c = contact_loop.Contacts(np.concatenate(ids), np.concatenate(normal), np.full(3 * n**3, A), [])
    return c, np.concatenate(kn), np.full(3 * n**3, KT), (n * A) ** 3


def moduli(C):
    """Bulk and shear modulus of the isotropic part."""
    K = np.einsum("iikk", C) / 9
    return K, (np.einsum("ijij", C) - 3 * K) / 10


class Lattice(unittest.TestCase):
    def test_without_anything_to_relax_it_is_equation_2(self):
        network = lattice(4, [KN])
        C = contact_loop.stiffness(*network)
        np.testing.assert_allclose(contact_loop.relaxed_stiffness(*network), C, rtol=0, atol=1e-9 * C.max())

    def test_layers_in_series(self):
        """Along x: kn of two springs in series against their mean; across x nothing changes."""
        soft, stiff = 1e4, 9e4
        network = lattice(4, [soft, stiff])
        C, R = contact_loop.stiffness(*network), contact_loop.relaxed_stiffness(*network)
        self.assertAlmostEqual(C[0, 0, 0, 0] * A, (soft + stiff) / 2, delta=1e-9 * KN)
        self.assertAlmostEqual(R[0, 0, 0, 0] * A, 2 * soft * stiff / (soft + stiff), delta=1e-6 * KN)
        self.assertAlmostEqual(R[1, 1, 1, 1] * A, KN, delta=1e-9 * KN)
        self.assertAlmostEqual(R[1, 2, 1, 2], C[1, 2, 1, 2], delta=1e-9 * C.max())

    def test_grains_that_can_roll_on_their_chains_do_not_resist_shear(self):
        """Only the layers' contacts along x are left: a mechanism but for one component."""
        c, kn, kt, V = lattice(4, [KN])
        along = slice(0, 64)
        chains = contact_loop.Contacts(c.ids[along], c.normal[along], c.length[along], [])
        R = mandel(contact_loop.relaxed_stiffness(chains, kn[along], kt[along], V))
        expected = np.zeros((6, 6))
        expected[0, 0] = KN / A
        np.testing.assert_allclose(R, expected, rtol=0, atol=1e-6 * KN / A)


class Packing(unittest.TestCase):
    """60 spheres, kn/kt = 1, kappa = 500."""

    @classmethod
    def setUpClass(cls):
        cls.ve = element(FRICTION)
        cls.affine, cls.relaxed = stiffness(cls.ve), stiffness(cls.ve, kind="relaxed")

    def test_is_symmetric_positive_and_below_equation_2(self):
        A6, R6 = mandel(self.affine), mandel(self.relaxed)
        np.testing.assert_allclose(R6, R6.T, rtol=0, atol=1e-12 * R6.max())
        self.assertGreater(np.linalg.eigvalsh(R6).min(), 0.1 * R6.max())
        self.assertGreater(np.linalg.eigvalsh(A6 - R6).min(), 0)
        (K, G), (k, g) = moduli(self.affine), moduli(self.relaxed)
        print(f"relaxed over affine: K {k / K:.3f}, G {g / G:.3f}")
        self.assertTrue(0.85 < k / K < 0.97 and 0.6 < g / G < 0.85)

    def test_is_yades_elastic_answer_at_rest(self):
        """Strains of 2e-6 at once, then 4000 steps at rest, contacts that cannot slide. What is left out is of order
        1/kappa."""
        state, strain, steps = engine().save(self.ve), 2e-6, 4000

        def stress(E):
            ve = engine().add(state)
            O = select(ve)
            for i in O.interactions:
                i.phys.tangensOfFrictionAngle = 1e9
            engine().deform(ve, np.array(E) / engine().info(ve)["time_step"], 1)
            engine().deform(ve, np.zeros((3, 3)), steps)
            answer, report, _ = measure(ve)
            engine().remove(ve)
            return answer

        at_rest, worst = stress(np.zeros((3, 3))), 0.0
        for E in (np.diag([1.0, 0, 0]), np.eye(3), [[0, 1.0, 0], [1.0, 0, 0], [0, 0, 0]]):
            found = (stress(strain * np.array(E)) - at_rest) / strain
            expected = np.einsum("ijkl,kl->ij", self.relaxed, E)
            worst = max(worst, np.linalg.norm(found - expected) / np.linalg.norm(expected))
        print(f"relaxed stiffness against YADE: {worst:.2%}")
        self.assertLess(worst, 0.02)

    def test_probing_finds_equation_2(self):
        """What a probe sees beside it is the change of volume and of directions under stress, of order 1/kappa."""
        import probing

        before = engine().save(self.ve)
        C = probing.stiffness(select(self.ve), engine()._love_weber)
        error = np.linalg.norm(C - self.affine) / np.linalg.norm(self.affine)
        print(f"probed stiffness against Eq. (2): {error:.2%}")
        self.assertLess(error, 0.01)
        self.assertEqual(engine().save(self.ve), before)


if __name__ == "__main__":
    unittest.main()
