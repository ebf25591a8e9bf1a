"""The largest stable time step of a volume element, from its contact network."""

import numpy as np

from contact_loop import contacts, has_stiffness, values

ITERATIONS = 60


def safe_time_step(O, own, safety):
    """Time step [s] for the scene and where it comes from: `safety` times the critical step of the contact network; for
    clumps and contacts without kn and ks, whose network is not known here, the smaller of the scene's `own` step [s]
    and `safety` times YADE's estimate by P waves."""
    from yade.utils import PWaveTimeStep

    c = contacts(O)
    if has_stiffness(c) and not any(b.isClump for b in O.bodies):
        return safety * critical_time_step(O, c), "contact network"
    waves = safety * PWaveTimeStep()
    if 0 < own < waves:
        return own, "the scene"
    return waves, "P waves"


def critical_time_step(O, c):
    """2/omega_max [s] of the network of contacts `c` (contact_loop.Contacts) between spheres that move and spin.

    Power iteration on M^-1 K; K holds kn along the normal and kt across it, acting on
    u_j - u_i - (r_i theta_i + r_j theta_j) x n. Its estimate of omega_max comes from below, within some per cent.
    """
    mass, inertia, radius = _masses(O)
    i, j = c.ids.T
    n, kn, kt = c.normal, values(c, "kn")[:, None], values(c, "ks")[:, None]
    ri, rj = radius[i][:, None], radius[j][:, None]
    rng = np.random.default_rng(0)
    u, w = rng.standard_normal((2, len(mass), 3))
    omega2 = 0.0
    for _ in range(ITERATIONS):
        d = u[j] - u[i] - np.cross(ri * w[i] + rj * w[j], n)
        dn = np.einsum("ci,ci->c", d, n)[:, None] * n
        f = kn * dn + kt * (d - dn)
        t = np.cross(n, f)
        force, torque = np.zeros_like(u), np.zeros_like(w)
        np.add.at(force, j, f)
        np.add.at(force, i, -f)
        np.add.at(torque, i, -ri * t)
        np.add.at(torque, j, -rj * t)
        energy = (u * force).sum() + (w * torque).sum()  # 2 x potential, over 2 x kinetic: Rayleigh's quotient
        omega2 = energy / ((mass[:, None] * u * u).sum() + (inertia[:, None] * w * w).sum())
        u, w = force / mass[:, None], torque / inertia[:, None]
        size = np.sqrt((u * u).sum())
        u, w = u / size, w / size
    return 2 / np.sqrt(omega2)


def _masses(O):
    """Mass [kg], moment of inertia [kg m^2] and radius [m] of every body."""
    numbers = [(b.state.mass, b.state.inertia[0], b.shape.radius) for b in O.bodies]
    return np.array(numbers).T
