"""Reads what a run of femxdem has written: history.csv, case.toml, results.h5.

Stresses are Cauchy, tension positive, as in the files; curves are compression positive and say so.
"""

import csv
import sys
import tomllib
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np


class ResultsError(Exception):
    """What is missing in a folder, where, and what to do: one sentence."""


def _there(file):
    if not Path(file).exists():
        raise ResultsError(f"{file}: not there; give the folder that `femxdem run` wrote")
    return Path(file)


def end_with(tool, error):
    """Ends a subcommand of the program on bad input."""
    print(f"femxdem {tool}: {error}", file=sys.stderr)
    sys.exit(2)


def read_columns(file):
    """Columns of a CSV file of numbers by name."""
    with open(_there(file), newline="") as stream:
        rows = list(csv.reader(stream))
    if len(rows) < 2:
        raise ResultsError(f"{file}: no converged step in it; see log.txt beside it")
    return dict(zip(rows[0], np.array(rows[1:], dtype=float).T))


def read_history(folder):
    """Columns of history.csv by name, one entry for each converged step."""
    return read_columns(Path(folder) / "history.csv")


def read_case(folder):
    """The effective case as a dictionary."""
    return tomllib.loads(_there(Path(folder) / "case.toml").read_text())


@dataclass
class Mesh:
    nodes: np.ndarray  #: (nodes, 2) reference coordinates [m]
    elements: np.ndarray  #: (elements, 8) corners counter-clockwise, then mid-side nodes
    points: np.ndarray  #: (elements, points, 2) reference positions of the Gauss points [m]


@dataclass
class Step:
    number: int
    time: float  #: [s]
    load_factor: float
    displacement: np.ndarray  #: (nodes, 2) [m]
    fields: dict  #: name -> (elements, points) or (elements, points, components)


def open_results(folder):
    return h5py.File(_there(Path(folder) / "results.h5"), "r", locking=False)


def read_mesh(folder):
    with open_results(folder) as h5:
        return Mesh(h5["mesh/nodes"][:], h5["mesh/elements"][:], h5["mesh/points"][:])


def output_steps(folder):
    """Numbers of the steps that have fields, ascending."""
    with open_results(folder) as h5:
        return [int(name) for name in h5["steps"]]


def read_step(folder, number=None):
    """Fields of an output step, by default of the last one."""
    steps = output_steps(folder)
    if not steps:
        raise ResultsError(f"{folder}/results.h5: no output step in it; see log.txt beside it")
    number = steps[-1] if number is None else number
    if number not in steps:
        raise ResultsError(f"{folder}/results.h5: no fields of step {number}; it has {steps}")
    with open_results(folder) as h5:
        group = h5[f"steps/{number:06d}"]
        fields = {name: np.squeeze(data[:], axis=2) if data.shape[2] == 1 else data[:] for name, data in group["points"].items()}
        displacement = group["nodes/displacement"][:, :2]
        return Step(number, float(group.attrs["time"]), float(group.attrs["load_factor"]), displacement, fields)


def logarithmic_strain(F):
    """Hencky strain ln U = 1/2 ln F^T F of deformation gradients (..., 3, 3)."""
    squares, axes = np.linalg.eigh(np.swapaxes(F, -1, -2) @ F)
    return np.einsum("...ik,...k,...jk->...ij", axes, 0.5 * np.log(squares), axes)


def strain_invariant(F):
    """Second invariant of the logarithmic strain: |dev ln U| of deformation gradients (..., 3, 3)."""
    E = logarithmic_strain(F)
    deviator = E - np.trace(E, axis1=-2, axis2=-1)[..., None, None] / 3 * np.eye(3)
    return np.sqrt(np.sum(deviator**2, axis=(-2, -1)))


def strain_invariant_between(first, last):
    """Strain invariant (elements, points) of the deformation from one output step to another, F_last F_first^-1."""
    F0, F1 = (step.fields["deformation_gradient"].reshape(*step.fields["deformation_gradient"].shape[:2], 3, 3) for step in (first, last))
    return strain_invariant(F1 @ np.linalg.inv(F0))


def shape_functions(xi, eta):
    """Q8 shape functions (..., 8) at natural coordinates."""
    corners = [0.25 * (1 + xi * a) * (1 + eta * b) * (xi * a + eta * b - 1) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    sides = [0.5 * (1 - xi**2) * (1 - eta), 0.5 * (1 + xi) * (1 - eta**2), 0.5 * (1 - xi**2) * (1 + eta), 0.5 * (1 - xi) * (1 - eta**2)]
    return np.stack(np.broadcast_arrays(*corners, *sides), axis=-1)


def natural_coordinates(nodes, points):
    """Natural coordinates (elements, points, 2) of positions (elements, points, 2) in elements of nodes
    (elements, 8, 2), by Newton's method with a difference quotient."""
    natural = np.zeros_like(points)
    h = 1e-6
    position = lambda da, db: shape_functions(natural[..., 0] + da, natural[..., 1] + db) @ nodes
    for _ in range(10):
        columns = [(position(h, 0) - position(-h, 0)) / (2 * h), (position(0, h) - position(0, -h)) / (2 * h)]
        correction = np.linalg.solve(np.stack(columns, axis=-1), (points - position(0, 0))[..., None])[..., 0]
        natural = natural + correction
        if np.abs(correction).max() < 1e-12:
            break
    return natural


def deformed_points(mesh, step):
    """Current positions of the Gauss points (elements, points, 2) [m]."""
    natural = natural_coordinates(mesh.nodes[mesh.elements], mesh.points)
    return shape_functions(natural[..., 0], natural[..., 1]) @ (mesh.nodes + step.displacement)[mesh.elements]


def confining_stress(case):
    """sigma_0 [Pa], compression positive: of the lateral pressure, else of the volume element, else of the law; 0 without
    confinement."""
    pressures = [load["value"] for load in case.get("load", []) if load.get("kind") == "pressure"]
    if pressures:
        return pressures[0]
    if case.get("material", {}).get("type", "volume_element") == "volume_element":
        return case["ve"]["confining_stress"]
    return case["material"]["initial_pressure"]


@dataclass
class Curve:
    strain: np.ndarray  #: axial, nominal (shortening over initial height), compression positive
    stress: np.ndarray  #: axial over sigma_0, or in Pa without confinement, compression positive
    label: str
    unit: str = r"/ $\sigma_0$"  #: of the stress, as on an axis
    of: str = "axial stress"  #: what `stress` holds
    against: str = "axial strain [%] (nominal, compression positive)"  #: what 100 times `strain` is, as on an axis


def _curve(strain, stress, sigma_0, label, **names):
    return Curve(strain, stress / sigma_0, label, **names) if sigma_0 else Curve(strain, stress, label, "[Pa]", **names)


def _monitored(case, quantity, edge):
    """Name of the monitor of a quantity on an edge, or nothing."""
    return next((m["name"] for m in case.get("monitor", []) if m["quantity"] == quantity and m.get("edge") == edge), None)


def _monitor(case, quantity, edge, folder):
    if name := _monitored(case, quantity, edge):
        return name
    raise ResultsError(f"{folder}/case.toml: no [[monitor]] with quantity = \"{quantity}\" on edge \"{edge}\"; add it and run again")


def axial_curve(folder, edge="top", label=None, nominal=False):
    """Axial stress over sigma_0 against axial strain of a biaxial run, from the monitors of `edge`.

    The stress is the reaction over the current width of the edge where that is monitored (quantity = "length"), else,
    or with `nominal`, over the initial one.
    """
    case, history, mesh = read_case(folder), read_history(folder), read_mesh(folder)
    width, height = np.ptp(mesh.nodes, axis=0)
    reaction = history[_monitor(case, "reaction_y", edge, folder)]
    shortening = -history[_monitor(case, "displacement_y", edge, folder)]
    if not nominal and any(m["quantity"] == "length" and m.get("edge") == edge for m in case["monitor"]):
        width = history[_monitor(case, "length", edge, folder)]
    return _curve(shortening / height, -reaction / width, confining_stress(case), label or str(folder))


def pressure_curve(folder, edge="inner", label=None):
    """Pressure on an edge over sigma_0 against the length of the mean displacement of that edge [m], from its monitors. Of a
    quarter of a circle that length is 2 sqrt(2) / pi of a uniform radial displacement."""
    case, history = read_case(folder), read_history(folder)
    pressure = history[_monitor(case, "pressure", edge, folder)]
    moved = np.hypot(*(history[_monitor(case, f"displacement_{axis}", edge, folder)] for axis in "xy"))
    kept = [load["value"] for load in case["load"] if load["kind"] == "pressure" and not load.get("table")]
    sigma_0 = kept[0] if kept and kept[0] else case.get("ve", {}).get("confining_stress", 0)
    against = f"mean displacement of {edge} [cm]"
    return _curve(moved, pressure, sigma_0, label or str(folder), of=f"pressure on {edge}", against=against)


def run_curve(folder, label=None):
    """The curve of any run: stress of the axial edge that is monitored, else the pressure of an edge against its
    displacement, else the load factor against time."""
    case = read_case(folder)
    edges = list(dict.fromkeys(m["edge"] for m in case.get("monitor", []) if m.get("edge")))
    for edge in edges:
        if _monitored(case, "reaction_y", edge) and _monitored(case, "displacement_y", edge):
            return axial_curve(folder, edge, label)
    for edge in edges:
        if all(_monitored(case, quantity, edge) for quantity in ("pressure", "displacement_x", "displacement_y")):
            return pressure_curve(folder, edge, label)
    history = read_history(folder)
    return Curve(history["time"] / 100, history["load_factor"], label or str(folder), "", "load factor", "time [s]")


def path_curve(folder, component="yy", label="single volume element", nominal=False):
    """Axial stress over sigma_0 against nominal axial strain of `femxdem ve path`; `nominal`: force over initial width."""
    case, history = read_case(folder), read_history(folder)
    missing = [name for name in (f"strain_{component}", f"stress_{component}") if name not in history]
    if missing:
        raise ResultsError(f"{folder}/history.csv: no column {missing[0]}; give the folder of `femxdem ve path`")
    strain = 1 - np.exp(history[f"strain_{component}"])
    width = np.exp(history["strain_xx"]) if nominal else 1.0
    return _curve(strain, -history[f"stress_{component}"] * width, confining_stress(case), label)
