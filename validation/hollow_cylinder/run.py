#!/usr/bin/python3
"""The paper's pressuremeter (Nguyen et al. 2017, Figs. 5 and 6): quarter of a hollow cylinder, sigma_int to 4 sigma_0.

    validation/hollow_cylinder/run.py [ROW ...] [--list] [--record] [--runs FOLDER]
    validation/hollow_cylinder/run.py report --record      # table and figures of the rows that have results, nothing is run

Without names: the paper's rows and the restart. Finished rows are kept, one that was interrupted goes on from its last
checkpoint. Every row ends with the figures and tables of all rows that have results.
"""

import json
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import boundary_problems
from boundary_problems import Row, cost, existing, how_it_ended, strength

import matplotlib.pyplot as plt
import numpy as np

from plot import draw_map
from results import ResultsError, output_steps, pressure_curve, read_mesh, read_step
from spirals import spirals_of_run

PAPER = {
    "952": Row("952.toml", text="28 x 34 Q8: Fig. 6a"),
    "870": Row("870.toml", text="29 x 30 second gradient: Fig. 6b"),
    "1280": Row("1280.toml", text="32 x 40 second gradient: Fig. 6c", checkpoint_every=0)  # memory: README.md,
}
UNIQUENESS = {
    f"start_{mesh}_{n}": Row(f"{mesh}.toml", ("solver.start_amplitude=0.05", "solver.start_time=0.85", f"solver.start_seed={n}", "control.end_time=1.4"),
                             f"{mesh}, random start {n} of the step past sigma_int = 3.55 sigma_0, to where the bands are formed", checkpoint_every=0)
    for mesh in (870, 1280) for n in (1, 2, 3, 4, 5)
}
CELL = {
    "ve": Row("../biaxial/ve.toml", ("ve.compaction_friction=0.0",), "the volume element alone: dilatancy", path=True),
    "ve_friction": Row("../biaxial/ve_friction.toml", ("ve.compaction_friction=0.0",), "at twice its confinement: friction angle", path=True),
}
SMALL = {
    "small": Row("small.toml", text="12 x 12 second gradient, 100 spheres: tests and demonstrations"),
    "small_first_gradient": Row("small_first_gradient.toml", text="12 x 12 Q8, 100 spheres"),
}
RUNS = PAPER | UNIQUENESS | SMALL
TITLES = {"952": "952 elements, Q8", "870": "870 elements, second gradient", "1280": "1280 elements, second gradient"}
WALL = 1.0  # m, radius a
UNIFORM = np.pi / (2 * np.sqrt(2))  # radial displacement over the length of the quarter's mean displacement, where it is uniform
HEADER = [
    "| row | elements, points | ended | sigma_int / sigma_0 at the end | wall u/a at 4 sigma_0, at the end | evaluations a step, most "
    "| rejected | DEM steps | wall [s] | core hours | memory of the process, of its compact cells [GB] |",
    "|---|---|---|---|---|---|---|---|---|---|---|",
]
BANDS = [
    "| row, step: sigma_int / sigma_0 | band starts at [deg] | to the radius [deg] | reaches [a] | thickness [a] | over the element size at 1.3 a | peak |",
    "|---|---|---|---|---|---|---|",
]


def curve_of(name, run):
    curve = pressure_curve(run.folder, label=TITLES.get(name, name))
    curve.strain = curve.strain * UNIFORM / WALL
    return curve


def first_at(curve, stress):
    """Strain where the stress is first reached: a curve past its limit has it twice."""
    k = int(np.argmax(curve.stress >= stress))
    return float(np.interp(stress, curve.stress[max(k - 1, 0):k + 1], curve.strain[max(k - 1, 0):k + 1]))


def memory(run):
    file = run.folder / "summary.json"
    if not file.exists():
        return ""
    summary = json.loads(file.read_text())
    return ", ".join(f"{summary[key] / 1e9:.1f}" for key in ("peak_memory_master_bytes", "peak_memory_points_bytes"))


def table_row(name, run):
    curve, paid, mesh = curve_of(name, run), cost(run), read_mesh(run.folder)
    at_four = f"{first_at(curve, 4.0):.4f}" if curve.stress.max() >= 4.0 else "-"
    cells = [f"`{name}`", f"{len(mesh.elements)}, {mesh.points.shape[0] * mesh.points.shape[1]}", how_it_ended(run),
             f"{curve.stress[-1]:.2f} (most {curve.stress.max():.2f})", f"{at_four}, {curve.strain[-1]:.4f}",
             f"{paid.evaluations / paid.steps:.2f}, {paid.most}", paid.rejected, f"{paid.dem_steps:.3g}", f"{paid.wall:.0f}",
             f"{paid.core_hours:.2f}", memory(run)]
    return "| " + " | ".join(map(str, cells)) + " |"


def step_at_four(run):
    """The first output step at sigma_int of at least 4 sigma_0, or the last one."""
    curve = pressure_curve(run.folder)
    reached = [n for n in output_steps(run.folder) if 0 < n <= len(curve.stress) and curve.stress[n - 1] >= 4.0 - 1e-6]
    return reached[0] if reached else output_steps(run.folder)[-1]


def element_size(run, radius):
    """Mean side of the elements whose middle is at about that radius [m]."""
    mesh = read_mesh(run.folder)
    corners = mesh.nodes[mesh.elements[:, :4]]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean(axis=1)
    middle = np.linalg.norm(corners.mean(axis=1), axis=1)
    near = np.argsort(np.abs(middle - radius))[:40]
    return sides[near].mean()


def band_lines(name, run):
    """Rows of the table of bands: at 4 sigma_0, and at the end."""
    lines = []
    for step in sorted({step_at_four(run), output_steps(run.folder)[-1]}):
        level = f"`{name}`, step {step}: {pressure_curve(run.folder).stress[step - 1]:.2f}"
        try:
            found = spirals_of_run(run.folder, last=step)
        except ResultsError:
            lines.append(f"| {level} | none | | | | | |")
            continue
        size = element_size(run, 1.3 * WALL)
        for one in found:
            thick, share = "one side only", ""
            if one.stations:
                thick = f"{one.thickness / WALL:.3f} +- {one.thickness_scatter / WALL:.3f} ({one.stations} profiles)"
                share = f"{one.thickness / size:.1f}"
            lines.append(f"| {level} | {one.start:.0f} | {one.inclination:+.1f} | {one.reach:.2f} | {thick} | {share} | {one.peak:.3f} |")
    return lines


def draw_curves(runs, names, file):
    figure, axes = plt.subplots(figsize=(5.6, 3.6))
    for name in names:
        curve = curve_of(name, runs[name])
        axes.plot(100 * curve.strain, curve.stress, {"952": "--"}.get(name, "-o"), markersize=2.5, linewidth=1, label=curve.label)
    axes.axhline(4.0, color="0.6", linewidth=0.8)
    axes.set(xlabel="mean radial displacement of the wall / a [%]", ylabel=r"$\sigma_{int} / \sigma_0$")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(file, dpi=90, bbox_inches="tight")
    plt.close(figure)


def draw_maps(runs, names, file, reach=3.5):
    """The inner part of the deformed meshes at the end of the loading, one scale."""
    side = 4.0 if len(names) <= 3 else 2.4
    figure, panels = plt.subplots(1, len(names), figsize=(side * len(names), 1.2 * side), squeeze=False)
    steps = {name: output_steps(runs[name].folder)[-1] for name in names}
    fields = {name: read_step(runs[name].folder, steps[name]) for name in names}
    top = max(np.quantile(field.fields["strain_invariant"], 0.998) for field in fields.values())
    for axes, name in zip(panels[0], names):
        draw_map(axes, read_mesh(runs[name].folder), fields[name], "strain_invariant", (0, reach, 0, reach), (0, top))
        level = pressure_curve(runs[name].folder).stress[steps[name] - 1]
        axes.set_title(f"{TITLES.get(name, name)}\n" rf"$\sigma_{{int}}$ = {level:.2f} $\sigma_0$", fontsize=9 if side == 4.0 else 7)
    figure.savefig(file, dpi=75, bbox_inches="tight")
    plt.close(figure)


def report(c):
    runs = existing(c, RUNS)
    if not runs:
        return []
    c.processor_seconds = sum(run.processor_seconds for run in runs.values())
    with_fields = {name: run for name, run in runs.items() if output_steps(run.folder)}
    shown = [name for name in PAPER if name in with_fields] or list(with_fields)
    if shown:
        draw_curves(runs, shown, c.product("curves.png"))
        draw_maps(runs, shown, c.product("maps.png"))
    if starts := [name for name in UNIQUENESS if name in with_fields]:
        for mesh in ("870", "1280"):
            if of_mesh := [name for name in starts if mesh in name]:
                draw_maps(runs, of_mesh, c.product(f"uniqueness_{mesh}.png"))
    lines = HEADER + [table_row(name, run) for name, run in runs.items()] + ["", *BANDS]
    for name, run in with_fields.items():
        lines += band_lines(name, run)
    cell = existing(c, CELL)
    if len(cell) == len(CELL):
        phi, cohesion, psi = strength(*cell.values())
        lines += ["", f"The volume element alone: phi = {phi:.1f}, psi = {psi:.1f} degrees, c = {cohesion:.2f} sigma_0; bands between 45 - phi / 2 and "
                  f"45 - psi / 2 to the radius: {45 - phi / 2:.1f} to {45 - psi / 2:.1f} degrees."]
    return lines


if __name__ == "__main__":
    restart = "small.toml", "control.end_time=0.8"
    sys.exit(boundary_problems.main(HERE, __doc__, RUNS | CELL, [*CELL, *PAPER], restart, report))
