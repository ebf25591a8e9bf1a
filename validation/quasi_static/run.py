#!/usr/bin/python3
"""Slow trials: evaluations of a step and curves against the rate, with the stress of the end or the mean as the answer.

    validation/quasi_static/run.py [ROW ...] [--strain E] [--list] [--record] [--runs FOLDER] [--as-they-are]

The biaxial of validation/solver (second gradient, D = 4e3 N) on 4 x 8 elements, increments of 1e-3 of axial strain,
tolerance 5e-3. A row: spheres, inertial number, answer (end; mean; late: the mean that belongs to 2/3 of the step) and
damping.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

CASE = HERE.parent / "solver" / "biaxial_ve.toml"
HEIGHT, SIGMA_0, VELOCITY = 2.0, 1e5, 0.1
NUMBERS = (2e-2, 5e-3, 2e-3, 1e-3)
ANSWERS = {"end": (), "mean": ('ve.answer="mean"',), "late": ('ve.answer="mean"', "ve.mean_at=0.66666")}
KEYS = [(spheres, number, answer, damping) for spheres in (200, 1000) for number in NUMBERS for answer in ANSWERS
        for damping in (0.2, 0.7)]


def name_of(key):
    spheres, number, answer, damping = key
    return f"{spheres}_{number:g}_{answer}" + ("" if damping == 0.2 else f"_{damping:g}")


ROWS = {name_of(key): key for key in KEYS}


def settings(key, strain):
    spheres, number, answer, damping = key
    mesh = ["mesh.nx=4", "mesh.ny=8", "element.D=4e3", f"control.end_time={strain * HEIGHT / VELOCITY}"]
    return [*mesh, f"ve.spheres={spheres}", f"ve.inertial_number={number}", f"ve.damping={damping}", *ANSWERS[answer]]


def curve(history):
    """Axial strain, and force over sigma_0 and initial width."""
    return VELOCITY * history["time"] / HEIGHT, np.abs(history["force_top"]) / SIGMA_0


def measure(run):
    history = run.history()
    if not history:
        return None
    strain, force = curve(history)
    evaluations, peak = history["evaluations"], int(np.argmax(force))
    taken = history["step"] > 0
    before, past = (evaluations[taken & (history["step"] <= history["step"][peak])],
                    evaluations[history["step"] > history["step"][peak]])
    mean = lambda x: f"{x.mean():.2f}" if len(x) else "-"
    at = lambda e: f"{np.interp(e, strain, force):.3f}" if strain[-1] >= e - 1e-9 else "-"
    return [mean(before), mean(past), f"{int(evaluations.max())}", f"{len(run.rejections())}", f"{history['dem_steps'].sum():.2e}",
            f"{force[peak]:.3f}", f"{100 * strain[peak]:.2f}", at(0.025), at(0.0295), f"{100 * strain[-1]:.2f}",
            f"{run.processor_seconds:.0f}"]


def table(lines):
    head = ["row", "before", "past", "most", "rejected", "DEM steps", "peak / sigma_0", "at [%]", "at 2.5 %", "at 2.95 %", "to [%]", "CPU [s]"]
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *([name, *cells] for name, cells in lines))]


def draw(curves, file):
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.8), sharey=True)
    for axis, spheres in zip(axes, (200, 1000)):
        for (key, history) in (c for c in curves if c[0][0] == spheres):
            strain, force = curve(history)
            axis.plot(100 * strain, force, label=name_of(key), linewidth=0.9, linestyle="--" if key[2] == "end" else "-")
        axis.set(xlabel="axial strain [%]", title=f"{spheres} spheres")
        axis.legend(fontsize=6)
    axes[0].set(ylabel="force / (sigma_0 W)")
    figure.savefig(file, dpi=100, bbox_inches="tight")


def work(c, chosen, strain, as_they_are):
    lines, curves = [], []
    for name in chosen:
        run = c.as_it_is(name) if as_they_are else c.run(CASE, name, *settings(ROWS[name], strain), c.cache, checkpoint_every=10)
        cells = run and measure(run)
        if not cells:
            continue
        lines.append((name, cells))
        curves.append((ROWS[name], run.history()))
        print(table(lines[-1:])[-1], flush=True)
        c.table(table(lines))
    draw(curves, c.product("quasi_static.png"))


def main():
    parser = campaign.parser(HERE, __doc__, rows=True)
    parser.add_argument("--strain", type=float, default=0.03, help="axial strain of the end")
    parser.add_argument("--as-they-are", action="store_true", help="table and figure of the runs that there are")
    a = parser.parse_args()
    chosen = a.rows or list(ROWS)
    return campaign.main(HERE, a, ROWS, lambda c: work(c, chosen, a.strain, a.as_they_are), on_meshes=True)


if __name__ == "__main__":
    sys.exit(main())
