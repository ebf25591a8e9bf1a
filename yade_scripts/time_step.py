"""The largest stable time step of a volume element, from its contact network; all times are in the scene's unit."""

import numpy as np

import contact_laws
import rolling
import viscosity
from contact_loop import contacts, has_stiffness, values

ITERATIONS = 60
KEPT = 0.6, 1.1  # time step over the safe one: within these bounds it is left alone


def set_time_step(O, own, safety):
    """Gives the scene its time step and returns where it comes from: `safety` times the critical step of the contact
    network; for clumps and contacts without kn and ks, whose network is not known here, the smaller of the scene's
    `own` step and `safety` times YADE's estimate by P waves."""
    from yade.utils import PWaveTimeStep

    c = contacts(O)
    clumped = any(b.isClump for b in O.bodies)
    if has_stiffness(O, c) and not clumped:
        critical = critical_time_step(O, c)
        damping = viscosity.damping_ratio(O, critical, own)
        papers = 0.25 * critical * _papers_dashpots(O, c)
        O.dt = safety * viscosity.damped(critical, damping + papers)
        contact_laws.note_time_step_safety(O, safety)
        viscosity.note(O, damping)
        return "contact network with its dashpots" if damping + papers > 0 else "contact network"
    waves = safety * PWaveTimeStep()
    if not clumped:
        waves = safety * viscosity.damped(waves / safety, viscosity.damping_ratio(O, waves / safety, own))
    O.dt = own if 0 < own < waves else waves
    return "the scene" if O.dt == own else "P waves"


def follow_network(O):
    """Sets the time step anew where the contact network from which it comes has become stiffer or softer than KEPT allows:
    contacts after Hertz stiffen with the pressure. Where all contacts have the same stiffness for ever, the safe step changes
    by 6 to 9 % when the pressure grows fourteen to thirtyfold (validation/time_step): it is kept."""
    safety = contact_laws.time_step_safety(O)
    if safety is None or contact_laws.constant_stiffness(O) or not O.interactions.countReal():
        return
    safe = safety * viscosity.damped(critical_time_step(O, contacts(O)), viscosity.noted(O))
    if not KEPT[0] <= O.dt / safe <= KEPT[1]:
        O.dt = safe


def critical_time_step(O, c):
    """2/omega_max of the network of contacts `c` (contact_loop.Contacts) between spheres that move and spin, with the rolling
    and twisting stiffnesses that it may have.

    Power iteration on M^-1 K; K holds kn along the normal and kt across it, acting on
    u_j - u_i - (r_i theta_i + r_j theta_j) x n. Its estimate of omega_max comes from below, within some per cent.
    """
    return 2 / np.sqrt(_largest_eigenvalue(O, c, values(c, "kn"), values(c, "ks"), rolling.stiffness(c)))


def _papers_dashpots(O, c):
    """Largest eigenvalue of M^-1 C [1/s] of the dashpots of the paper's law, which YADE has not: see viscosity.damping_ratio."""
    ratio = contact_laws.paper_law(O)
    if not ratio:
        return 0.0
    mass, _, _ = _masses(O)
    pair = 1 / (1 / mass[c.ids]).sum(axis=1)
    constants = 2 * ratio * np.sqrt(values(c, "kn") * pair)
    return _largest_eigenvalue(O, c, constants, 0 * constants, None)


def _largest_eigenvalue(O, c, kn, kt, turning):
    """Of M^-1 K, K of contacts with kn along the normal and kt (m,) across it, and `turning` of rolling.py."""
    mass, inertia, radius = _masses(O)
    i, j = c.ids.T
    n, kn, kt = c.normal, kn[:, None], kt[:, None]
    ri, rj = radius[i][:, None], radius[j][:, None]
    rng = np.random.default_rng(0)
    u, w = rng.standard_normal((2, len(mass), 3))
    largest = 0.0
    for _ in range(ITERATIONS):
        d = u[j] - u[i] - _cross(ri * w[i] + rj * w[j], n)
        dn = np.einsum("ci,ci->c", d, n)[:, None] * n
        f = kn * dn + kt * (d - dn)
        t = _cross(n, f)
        force = _sums(np.concatenate([j, i]), np.concatenate([f, -f]), len(mass))
        torque = _sums(np.concatenate([i, j]), np.concatenate([-ri * t, -rj * t]), len(mass))
        if turning:  # K of the moments: torques oppose as forces do, with the sign of `force` here
            m = rolling.moments(c, turning, w)
            torque = torque + _sums(np.concatenate([j, i]), np.concatenate([m, -m]), len(mass))
        energy = (u * force).sum() + (w * torque).sum()  # 2 x potential, over 2 x kinetic: Rayleigh's quotient
        largest = energy / ((mass[:, None] * u * u).sum() + (inertia[:, None] * w * w).sum())
        u, w = force / mass[:, None], torque / inertia[:, None]
        size = np.sqrt((u * u).sum())
        u, w = u / size, w / size
    return largest


def _cross(a, b):
    """Row by row; numpy's own is several times slower on few rows."""
    x, y, z = 0, 1, 2
    return a[:, [y, z, x]] * b[:, [z, x, y]] - a[:, [z, x, y]] * b[:, [y, z, x]]


def _sums(places, rows, count):
    """(count, 3): for each place, the sum of its rows."""
    return np.stack([np.bincount(places, component, count) for component in rows.T], axis=1)


def _masses(O):
    """Mass, moment of inertia and radius [m] by the number of the body; one that has been erased moves nothing."""
    numbers = np.tile([[1.0], [1.0], [0.0]], len(O.bodies))
    for b in O.bodies:
        numbers[:, b.id] = b.state.mass, b.state.inertia[0], b.shape.radius
    return numbers
