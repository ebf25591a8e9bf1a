"""The largest stable time step of a volume element, from its contact network."""

import math

import numpy as np

ITERATIONS = 60


def critical_time_step(O, c):
    """2/omega_max [s] of the network of contacts `c` (contact_loop.contacts) with spheres that move and spin.

    Power iteration on M^-1 K; K holds kn along the normal and kt across it, acting on
    u_j - u_i - (r_i theta_i + r_j theta_j) x n. The result of ITERATIONS steps is a lower bound of omega_max, short of it
    by some per cent.
    """
    mass, inertia, radius = (
        np.array([f(b) for b in O.bodies])
        for f in (lambda b: b.state.mass, lambda b: b.state.inertia[0], lambda b: b.shape.radius)
    )
    i, j = c["ids"].T
    n, kn, kt = c["normal"], c["kn"][:, None], c["ks"][:, None]
    ri, rj = radius[i][:, None], radius[j][:, None]
    rng = np.random.default_rng(0)
    u, w = rng.standard_normal((2, len(mass), 3))
    square = 0.0
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
        u, w = force / mass[:, None], torque / inertia[:, None]
        square = math.sqrt((u * u).sum() + (w * w).sum())
        u, w = u / square, w / square
    return 2 / math.sqrt(square)
