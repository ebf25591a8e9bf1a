"""What the tests of YADE share: one engine, its small volume elements, and plain arrays of what it measures."""

from functools import cache

import numpy as np

from contact_loop import I, J
from volume_element import Engine

FIELDS = (
    "dem_steps seconds engine_seconds unbalanced_force inertial_number time_step porosity coordination "
    "coordination_backbone fabric_xx fabric_yy fabric_zz fabric_xy fabric_yz fabric_zx mean_rotation "
    "adhesive_contacts stress_asymmetry sliding_contacts contacts "
    "end_stress_xx end_stress_yy end_stress_zz end_stress_xy end_stress_yz end_stress_zx"
).split()
SPHERES = 60
PACKING = {
    "source": "prepare", "spheres": SPHERES, "size_ratio": 1.5, "kappa": 500.0, "stiffness_ratio": 1.0, "friction": 0.5,
    "compaction_friction": 0.0, "cohesion": 0.0, "contact_law": "adhesive", "new_contacts": "frictional", "confining_stress": 1e5,
    "mean_diameter": 1e-3, "density": 2600.0, "damping": 0.2, "seed": 1, "time_step_safety": 0.8, "viscous_damping": 0.0
}  # fmt: skip


def packing(**changes):
    """Whole specification of a prepared packing, as the program hands it over: PACKING but for `changes`."""
    unknown = changes.keys() - PACKING.keys()
    if unknown:
        raise ValueError(f"no packing has {', '.join(sorted(unknown))}")
    return {**PACKING, **changes}


def users(source, path, **more):
    """Whole specification of a user's `script` or `scene`."""
    limits = {"script_steps": 1_000_000, "script_seconds": 600.0, "script_memory": 8.0, "script_output": 100.0, "scene_sha256": "any"}
    return {"source": source, source: str(path), "time_step_safety": PACKING["time_step_safety"], **limits, **more}


FRICTION = packing(contact_law="friction")
ADHESIVE = packing(cohesion=1.0)


@cache
def engine():
    return Engine(FIELDS)


@cache
def _template(items):
    return engine().make_template(dict(items))


def template(spec):
    """Prepared once a process and specification."""
    return _template(tuple(sorted(spec.items())))


def element(spec):
    """Number of a new volume element of that specification."""
    return engine().add(template(spec)["state"])


def measure(ve):
    """Stress (3, 3), complete report as a dict, deformation gradient (3, 3)."""
    stress, report, stretch = np.full(9, np.nan), np.full(len(FIELDS), np.nan), np.full(9, np.nan)
    engine().measure(ve, stress, report, stretch)
    engine().complete_report(ve, report)
    return stress.reshape(3, 3), dict(zip(FIELDS, report)), stretch.reshape(3, 3)


def stiffness(ve, kind="affine"):
    """Elastic stiffness (3, 3, 3, 3)."""
    out = np.full(81, np.nan)
    engine().stiffness(ve, out, kind)
    return out.reshape(3, 3, 3, 3)


def mandel(C):
    """(6, 6) with the eigenvalues of C on symmetric tensors."""
    w = np.where(I == J, 1.0, np.sqrt(2))
    return C[I[:, None], J[:, None], I, J] * np.outer(w, w)


def select(ve):
    """YADE's scene of that volume element."""
    engine().info(ve)
    return engine().O


def rate(ve, inertial_number, direction):
    """Velocity gradient [1/s] of that inertial number along `direction` (3, 3)."""
    d = np.asarray(direction, dtype=float)
    return inertial_number / engine().info(ve)["time_scale"] * d / np.linalg.norm(0.5 * (d + d.T))
