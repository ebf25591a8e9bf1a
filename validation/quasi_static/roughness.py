#!/usr/bin/python3
"""How rough a function of the strain a trial's stress is: along a line of neighbouring strains, from one state.

    roughness.py BUILD [STEPS ...]     # BUILD: folder of the compiled modules

A cell is compressed in plane strain, the lateral stress kept as it was, 1e-3 of axial strain in so many DEM steps; from each of
several states trials of that many steps go to 0.9 to 1.1 of the next increment. Roughness: what a parabola through their stresses
leaves, root of the mean square over that of the stress.
"""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
INCREMENT = 1e-3  # of axial strain
STATES = range(6, 22, 2)  # increments behind the states
AROUND = np.linspace(-0.1, 0.1, 21)  # of the increment
STEPS = (20, 50, 150, 500, 1500, 5000)
WHOLE, SAFETY = "1000 spheres", 0.8  # the row that nothing is changed of, and its time step over the critical one
ROWS = {  # what is changed of 1000 cohesive spheres with damping 0.2
    WHOLE: {}, "400": {"spheres": 400}, "200": {"spheres": 200}, "damping 0.7": {"damping": 0.7},
    "damping 0.05": {"damping": 0.05}, "friction alone": {"contact_law": "friction", "cohesion": 0.0},
    "half of the time step, twice the steps": {"time_step_safety": SAFETY / 2},
}
SMALL_CELLS = 5  # of 200 spheres, in place of one of 1000


def cell_of(**changes):
    """A compact cell of a prepared packing."""
    import compact_cell
    import compact_scene
    from cells import packing
    from volume_element import Engine

    engine = Engine([])
    ve = engine.add(engine.make_template(packing(**{"spheres": 1000, "cohesion": 1.0, "time_step_safety": SAFETY, **changes}))["state"])
    engine.info(ve)
    return compact_cell.CompactCell.from_scene(compact_scene.export(engine.O))


def lateral_rate(cell, axial, steps, stress):
    """Lateral strain over the axial one that keeps the lateral stress [Pa], by a straight line through two trials."""
    tried = (0.5, 1.5)
    found = []
    for rate in tried:
        trial = cell.copy()
        trial.deform(axial * np.diag([rate, -1.0, 0.0]), steps)
        found.append(trial.stress()[0, 0])
    return float(np.clip(tried[0] + (stress - found[0]) * (tried[1] - tried[0]) / (found[1] - found[0]), 0, 3))


def lines_from(cell, steps, first=1.0):
    """Stresses (states, strains, 9) of end and of mean along the line at each state; `first`: factor on the first increment. And
    the inertial number."""
    info = cell.info()
    axial, kept = INCREMENT / (steps * info["time_step"]), cell.stress()[0, 0]
    cell, found = cell.copy(), {"end": [], "mean": []}
    for number in range(1, max(STATES) + 1):
        L = axial * np.diag([lateral_rate(cell, axial, steps, kept), -1.0, 0.0])
        cell.deform(L * (first if number == 1 else 1.0), steps)
        if number in STATES:
            lines = {"end": [], "mean": []}
            for share in AROUND:
                trial = cell.copy()
                lines["mean"].append(np.array(trial.deform(L * (1 + share), steps, max(1, min(4, steps // 25)))).ravel())
                lines["end"].append(np.array(trial.stress()).ravel())
            for answer in found:
                found[answer].append(lines[answer])
    return {answer: np.array(of) for answer, of in found.items()}, axial * info["time_scale"]


def rough_part(lines):
    """(states, strains, 9): what a parabola in the strain leaves, over the norm of the mean stress at the state."""
    basis = np.vander(AROUND, 3)
    left = lines - np.einsum("kl,slc->skc", basis @ np.linalg.pinv(basis), lines)
    return left / np.linalg.norm(lines.mean(axis=1), axis=1)[:, None, None]


def size(rough):
    """Root of the mean square over the strains, median over the states."""
    freedoms = len(AROUND) / (len(AROUND) - 3)
    return np.median(np.sqrt((rough**2).sum(axis=2).mean(axis=1) * freedoms))


def largest_jump(rough):
    """Largest difference between neighbours over the root mean square one, median over the states: about 2 of noise without
    memory, sqrt(20) of a single jump."""
    differ = np.linalg.norm(np.diff(rough, axis=1), axis=2)
    return np.median(differ.max(axis=1) / np.sqrt((differ**2).mean(axis=1)))


def alike(one, other):
    """Correlation of two rough parts, all states together."""
    return (one * other).sum() / np.sqrt((one**2).sum() * (other**2).sum())


def said(roughs):
    return f"{1e4 * size(roughs['end']):.2g} / {1e4 * size(roughs['mean']):.2g}"


def column(cells, small, steps):
    """What the table says of trials of so many DEM steps, row by row; cells: of ROWS, small: in place of one of 1000 spheres."""
    found, roughs = {}, {}
    for name, cell in cells.items():
        lines, number = lines_from(cell, round(steps * SAFETY / ROWS[name].get("time_step_safety", SAFETY)))
        found.setdefault("I", f"{number:.1g}")
        roughs[name] = {answer: rough_part(of) for answer, of in lines.items()}
        found[name] = said(roughs[name])
    whole, of_small = roughs[WHOLE], [lines_from(cell, steps)[0] for cell in small]
    found[f"{len(small)} cells of 200, their mean"] = said({a: rough_part(np.mean([of[a] for of in of_small], axis=0)) for a in whole})
    found["largest jump over the root mean square"] = " / ".join(f"{largest_jump(r):.1f}" for r in whole.values())
    copy, _ = lines_from(cells[WHOLE], steps, first=1 + 1e-3)
    found["correlation of two copies, strained apart by 1e-6 once"] = " / ".join(f"{alike(whole[a], rough_part(copy[a])):.2f}" for a in whole)
    return found


def main(trials):
    cells = {name: cell_of(**changes) for name, changes in ROWS.items()}
    small = [cells["200"], *(cell_of(spheres=200, seed=seed) for seed in range(2, SMALL_CELLS + 1))]
    columns = []
    for steps in trials:
        columns.append(column(cells, small, steps))
        print(f"{steps} steps done", file=sys.stderr, flush=True)
    print("| DEM steps of a trial | " + " | ".join(str(s) for s in trials) + " |\n" + "|---|" + "---|" * len(trials))
    for row in columns[0]:
        print(f"| {row} | " + " | ".join(c[row] for c in columns) + " |")


if __name__ == "__main__":
    sys.path[:0] = [sys.argv[1], str(ROOT / "yade_scripts"), str(ROOT / "tests" / "yade")]
    main([int(s) for s in sys.argv[2:]] or STEPS)
