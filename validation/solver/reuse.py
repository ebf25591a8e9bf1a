#!/usr/bin/python3
"""Adaptive evaluation (solver.reuse_below): what it saves, and what it does to the curve and the band.

    validation/solver/reuse.py [--spheres N] [--below X ...] [--end SECONDS] [--list] [--record] [--runs FOLDER]

biaxial_ve.toml to 5 % of strain. Rows: reuse_below, and without reuse at another tolerance, which is what a saving has to
beat and what an error has to be compared with. Distances from the run without reuse at 5e-3, over its peak.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

from band import band_of_run
from results import ResultsError

POINTS = 512
HEADER = ["| spheres | tolerance | reuse_below | to [%] | evaluations a step before / past (most) | answers reused [%] | points evaluated | "
          "DEM steps [1e6] | mean, largest error [1e-3] | curve before: mean, most [%] | past: mean, most [%] | peak [kN] | band [m], [deg] |",
          "|" + "---|" * 13]


def keys(a):
    for below in (0.0, *a.below):
        yield a.spheres, 5e-3, below
    for tolerance in a.tolerances:
        yield a.spheres, tolerance, 0.0


def name_of(key):
    return "reuse/{}_{:g}_{:g}".format(*key)


def distances(history, reference):
    """Mean and largest difference of the forces on the reference's times, before and past its peak [% of the peak]."""
    time, force = reference["time"], np.abs(reference["force_top"])
    off = 100 * np.abs(np.interp(time, history["time"], np.abs(history["force_top"])) - force) / force.max()
    reached, before = time <= history["time"][-1] * (1 + 1e-9), time <= time[np.argmax(force)]
    return [f"{off[part & reached].mean():.2f}, {off[part & reached].max():.2f}" if (part & reached).any() else "" for part in (before, ~before)]


def band_cell(run):
    try:
        band = band_of_run(run.folder)
        return f"{band.thickness:.3f}, {abs(band.inclination):.1f}"
    except ResultsError:
        return "none"


def line(key, run, reference):
    spheres, tolerance, below = key
    h = run.history()
    force, evaluations = np.abs(h["force_top"]), h["evaluations"]
    past = int(np.argmax(force)) + 1
    reused = h["reused"].sum() if below else 0
    errors = 1e3 * h["reuse_error"] if below else np.zeros(1)
    answers = evaluations.sum() * POINTS
    cells = [spheres, f"{tolerance:g}", f"{below:g}", f"{5 * h['time'][-1]:.2g}",
             f"{evaluations[:past].mean():.2f} / {evaluations[past:].mean():.2f} ({evaluations.max():.0f})", f"{100 * reused / answers:.1f}",
             f"{answers - reused:.0f}", f"{h['dem_steps'].sum() / 1e6:.3f}", f"{errors.mean():.2f}, {errors.max():.2f}" if below else "",
             *(distances(h, reference) if h is not reference else ["", ""]), f"{force.max() / 1e3:.1f}", band_cell(run)]
    return "| " + " | ".join(map(str, cells)) + " |"


def draw(curves, file):
    figure, axes = plt.subplots(1, 2, figsize=(10, 3.8))
    for (spheres, tolerance, below), h in curves:
        label = f"{spheres} spheres, {tolerance:g}, {below:g}"
        axes[0].plot(5 * h["time"], np.abs(h["force_top"]) / 1e3, label=label, linewidth=0.9)
        axes[1].plot(5 * h["time"], np.cumsum(h["dem_steps"]) / 1e6, linewidth=0.9)
    axes[0].set(xlabel="axial strain [%]", ylabel="force [kN]")
    axes[1].set(xlabel="axial strain [%]", ylabel="DEM steps of all points [1e6]")
    axes[0].legend(fontsize=6)
    figure.savefig(file, dpi=110, bbox_inches="tight")


def follow(c, a):
    rows, curves = [], []
    for key in keys(a):
        spheres, tolerance, below = key
        settings = [f"ve.spheres={spheres}", f"solver.tolerance={tolerance:g}", f"solver.reuse_below={below:g}", f"control.end_time={a.end}",
                    "ve.engine=compact", f"ve.threads={a.threads}"]
        run = c.run(HERE / "biaxial_ve.toml", name_of(key), *settings, c.cache, checkpoint_every=10)
        if not run.history():
            raise campaign.CampaignError(f"{run.folder}: {run.last_words()}")
        curves.append((key, run.history()))
        rows.append(line(key, run, curves[0][1]))
        print(rows[-1], flush=True)
        c.table(HEADER + rows, page="reuse.md", mark=f"results, {spheres} spheres")
    draw(curves, c.product(f"reuse_{a.spheres}.png"))


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--spheres", type=int, default=200)
    parser.add_argument("--below", type=float, nargs="+", default=[0.01, 0.03, 0.1, 0.3])
    parser.add_argument("--tolerances", type=float, nargs="*", default=[1e-2, 1e-3], help="without reuse")
    parser.add_argument("--end", type=float, default=1.0, help="s, 1.0: 5 %% of strain")
    parser.add_argument("--threads", type=int, default=1)
    a = parser.parse_args()
    return campaign.main(HERE, a, {name_of(key): "" for key in keys(a)}, lambda c: follow(c, a), on_meshes=True)


if __name__ == "__main__":
    sys.exit(main())
