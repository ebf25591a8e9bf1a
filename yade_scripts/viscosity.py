"""Dashpots of the contacts in the largest stable time step, whatever law has them.

YADE finds forces from the velocities of half a step before. A mode of frequency omega and damping ratio xi,
v' = v - dt (omega^2 x + 2 xi omega v), x' = x + dt v', is stable for dt <= (2/omega) (sqrt(1 + xi^2) - xi): the
characteristic z^2 - (2 - 2 xi omega dt - omega^2 dt^2) z + 1 - 2 xi omega dt has a root below -1 beyond it.
"""

import math

import numpy as np

import contact_laws
from continuation import Copy

DAMPING_TAG = "femxdem_damping_ratio"
ITERATIONS = 30
SMALL = 1e-4  # viscous force of the probes, over the mean force on a grain's contacts
NOTHING = 1e-9  # a force below this, over the same, is round-off


def damped(critical, ratio):
    """Largest stable time step [s] of a network with the undamped one `critical` [s] and the damping ratio of its stiffest
    mode."""
    return critical * (math.sqrt(1 + ratio * ratio) - ratio)


def note(O, ratio):
    """Notes the damping ratio in the scene: it stays while the contacts stiffen (Hertz: c ~ sqrt(k m))."""
    O.tags[DAMPING_TAG] = repr(ratio)


def noted(O):
    """The damping ratio of the scene's note, 0 without one."""
    return float(O.tags[DAMPING_TAG]) if DAMPING_TAG in O.tags.keys() else 0.0


def damping_ratio(O, critical, own):
    """xi = lambda/(2 omega_max), with omega_max = 2/`critical` and lambda [1/s] the largest eigenvalue of M^-1 C: an upper
    bound of that of any mode near omega_max. C is the forces that YADE answers to small velocities of the spheres at rest.

    `own` [s]: the scene's time step, for laws that divide by it. Done in a forked process: the scene is not touched.
    """
    return 0.25 * critical * Copy(lambda step: _largest_eigenvalue(O, step)).ask(own if own > 0 else 0.1 * critical)


def _largest_eigenvalue(O, own):
    """lambda [1/s] by power iteration; 0 where the contacts answer nothing to velocities."""
    grains = [b for b in O.bodies if not b.isClumpMember]
    O.dt = own
    rest = contact_laws.resting_time_step(O)
    mass = np.array([[b.state.mass] for b in grains])
    inertia = np.array([[b.state.inertia[0]] for b in grains])
    zero = np.zeros((len(grains), 3))
    _forces(O, grains, rest, zero, zero)
    scale = _mean_force(O)
    rng = np.random.default_rng(0)
    v, w = rng.standard_normal((2, len(grains), 3))
    w /= np.sqrt(inertia / mass)
    size, largest = 1e-9 * float(np.cbrt(O.cell.volume / len(grains))) / own, 0.0
    for _ in range(ITERATIONS):
        norm = np.sqrt((v * v).sum() / len(grains))
        v, w = v / norm, w / norm
        f0, t0 = _forces(O, grains, rest, zero, zero)  # again: a probe may have let a contact slip
        f, t = _forces(O, grains, rest, size * v, size * w)
        force, torque = (f0 - f) / size, (t0 - t) / size
        answer = np.sqrt((force * force).sum() / len(grains)) * size / scale
        if answer < NOTHING:
            return 0.0
        power, kinetic = (v * force).sum() + (w * torque).sum(), (mass * v * v).sum() + (inertia * w * w).sum()
        largest = max(largest, power / kinetic) if answer < 10 * SMALL else largest
        size *= SMALL / answer
        v, w = force / mass, torque / inertia
    return float(largest)


def _forces(O, grains, rest, v, w):
    """Forces and torques (n, 3) on the grains of velocities v and spins w, everything else being as it is."""
    from yade.utils import Vector3

    O.dt = rest
    O.step()
    for b, velocity, spin in zip(grains, v, w):
        b.state.vel, b.state.angVel = Vector3(*velocity), Vector3(*spin)
    contact_laws.to_forces(O)
    f = np.array([O.forces.f(b.id) for b in grains])
    t = np.array([O.forces.t(b.id) for b in grains])
    return f, t


def _mean_force(O):
    """Mean norm of the contact forces [N]."""
    forces = [getattr(i.phys, "normalForce", None) for i in O.interactions]
    forces = [f.norm() for f in forces if f is not None]
    return float(np.mean(forces)) if forces and np.mean(forces) > 0 else 1.0
