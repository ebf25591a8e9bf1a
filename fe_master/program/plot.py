#!/usr/bin/python3
"""Figures of a run: curve, maps on the deformed mesh, cost of the steps.

    femxdem plot DIR [--ve DIR2] [--out FOLDER] [--steps N ...]

The curve is that of the monitors: axial stress over sigma_0 against nominal axial strain (reaction_y and displacement_y of an
edge), compression positive; else the pressure on an edge over sigma_0 against that edge's displacement (pressure,
displacement_x and displacement_y); else the load factor against time. --ve lays the curve of the single volume element
(`femxdem ve path`) over an axial one. --window X0 X1 Y0 Y1 maps a part of the body. The maps show the second invariant of the logarithmic strain |dev ln U|, the
volumetric strain, the porosity and the seconds that the DEM took, at the last output step or at the given ones.
"""

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.ticker import MaxNLocator

from results import (ResultsError, end_with, natural_coordinates, path_curve, read_history, read_mesh, read_step, run_curve,
                     shape_functions)

LABELS = {
    "strain_invariant": "second invariant\n" r"of strain $|\mathrm{dev}\,\ln U|$",
    "volumetric_strain": "volumetric strain\n(dilation positive)",
    "porosity": "porosity",
    "seconds": "DEM seconds\nof the last trial",
}


def quarters(mesh, displacement):
    """Deformed mesh as one quadrilateral for each Gauss point of a 2 x 2 rule: corners (elements, 4, 4, 2), in the order
    of the points."""
    middles = np.array([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)])
    corners = 0.5 * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    natural = natural_coordinates(mesh.nodes[mesh.elements], mesh.points)
    quarter_of_point = np.argmin(np.linalg.norm(natural[:, :, None] - middles, axis=3), axis=2)
    at = middles[quarter_of_point][:, :, None] + corners
    current = (mesh.nodes + displacement)[mesh.elements]
    return shape_functions(at[..., 0], at[..., 1]) @ current[:, None]


def outlines(mesh, displacement):
    """Deformed outlines of the elements (elements, 8, 2)."""
    around = [0, 4, 1, 5, 2, 6, 3, 7]
    return (mesh.nodes + displacement)[mesh.elements[:, around]]


def draw_map(axes, mesh, step, name, window=None, limits=None):
    """A point field on the deformed mesh: one colour for each Gauss point where there are four, else for each element; all
    of it, or the window (x0, x1, y0, y1); colours between `limits`, or between the extremes."""
    values = step.fields[name]
    has_quarters = values.shape[1] == 4
    shapes = quarters(mesh, step.displacement).reshape(-1, 4, 2) if has_quarters else outlines(mesh, step.displacement)
    filled = PolyCollection(shapes, array=values.ravel() if has_quarters else values.mean(axis=1), cmap="viridis")
    filled.set_clim(limits)
    axes.add_collection(filled)
    axes.add_collection(PolyCollection(outlines(mesh, step.displacement), facecolor="none", edgecolor="0.6", linewidth=0.15))
    axes.autoscale_view()
    if window:
        axes.set(xlim=window[:2], ylim=window[2:])
    axes.set_aspect("equal")
    axes.set_axis_off()
    bar = axes.figure.colorbar(filled, ax=axes, orientation="horizontal", pad=0.03, label=LABELS.get(name, name))
    bar.locator = MaxNLocator(4)


def draw_curves(axes, curves):
    """Curves of results.run_curve and results.path_curve over one another."""
    for curve, style in zip(curves, ("-o", "--", "-s", "-^", "-v")):
        axes.plot(100 * curve.strain, curve.stress, style, markersize=3, linewidth=1, label=curve.label)
    axes.set_xlabel(curves[0].against)
    sign = "" if curves[0].of == "load factor" else "(compression positive)"
    axes.set_ylabel(f"{curves[0].of} {curves[0].unit} {sign}".strip())
    axes.grid(alpha=0.3)
    axes.legend()


def draw_cost(axes, history):
    """Evaluations of all material points and accepted residual, step by step."""
    axes.bar(history["step"], history["evaluations"], width=0.8, color="tab:blue")
    axes.set_xlabel("step")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylabel(f"evaluations (mean {history['evaluations'].mean():.2f})", color="tab:blue")
    residual = axes.twinx()
    residual.semilogy(history["step"], np.maximum(history["residual"], 1e-16), ".", color="tab:red", markersize=3)
    residual.set_ylabel("accepted residual |r| / |f|", color="tab:red")


def save(figure, file):
    figure.savefig(file, dpi=160, bbox_inches="tight")
    plt.close(figure)
    return file


def plot_curve(folder, out, ve_folder=None):
    curves = [run_curve(folder, label="boundary value problem (FEM x DEM)")]
    if ve_folder:
        if curves[0].of != "axial stress":
            raise ResultsError(f"{folder}: a curve of {curves[0].of} has no counterpart of a single volume element; leave --ve out")
        curves.append(path_curve(ve_folder))
    figure, axes = plt.subplots(figsize=(6, 4))
    draw_curves(axes, curves)
    return save(figure, out / "curve.png")


def plot_maps(folder, out, number=None, window=None):
    mesh, step = read_mesh(folder), read_step(folder, number)
    names = [name for name in LABELS if name in step.fields and np.ptp(step.fields[name]) > 0]
    if not names:
        return []
    figure, axes = plt.subplots(1, len(names), figsize=(3.2 * len(names), 6), squeeze=False)
    for one, name in zip(axes[0], names):
        draw_map(one, mesh, step, name, window)
    figure.suptitle(f"step {step.number}, load factor {step.load_factor:.4g}", y=0.9)
    return [save(figure, out / f"maps_{step.number:06d}.png")]


def plot_cost(folder, out):
    figure, axes = plt.subplots(figsize=(6, 3))
    draw_cost(axes, read_history(folder))
    return save(figure, out / "convergence.png")


def plot_run(folder, out, ve_folder=None, steps=(None,), window=None):
    """All figures of a run; returns their files."""
    out.mkdir(parents=True, exist_ok=True)
    files = [plot_curve(folder, out, ve_folder), plot_cost(folder, out)]
    for number in steps:
        files += plot_maps(folder, out, number, window)
    return files


def main():
    parser = argparse.ArgumentParser(prog="femxdem plot", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path, help="folder that `femxdem run` wrote")
    parser.add_argument("--ve", metavar="DIR2", type=Path, help="folder of `femxdem ve path`, drawn over the curve")
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="where the figures go (default: DIR)")
    parser.add_argument("--steps", metavar="N", type=int, nargs="+", default=[None], help="output steps to map")
    parser.add_argument("--window", metavar="X", type=float, nargs=4, help="part of the body to map: x0 x1 y0 y1")
    arguments = parser.parse_args()
    try:
        files = plot_run(arguments.folder, arguments.out or arguments.folder, arguments.ve, arguments.steps, arguments.window)
    except ResultsError as error:
        end_with("plot", error)
    for file in files:
        print(file)


if __name__ == "__main__":
    main()
