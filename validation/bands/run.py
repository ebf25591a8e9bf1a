#!/usr/bin/python3
"""Shear bands of a biaxial test on a softening law: second gradient on three meshes, on a distorted and an unstructured
one, and Q8 of the first gradient on the same three.

    validation/bands/run.py [--list] [--record] [--runs FOLDER]

Five minutes of one core; finished meshes are kept. Prints one row for each quantity (measured, reference, tolerance); exit
status 1 if any is off.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign
import judged
from judged import row

import matplotlib.pyplot as plt
import numpy as np

from band import band_of_run
from plot import draw_map
from results import ResultsError, axial_curve, read_mesh, read_step

RECTANGLES = {"8 x 16": (8, 16), "16 x 32": (16, 32), "32 x 64": (32, 64)}
FRICTION, DILATANCY = 20.0, 10.0  # degrees, of case.toml
LIMIT = 300.0  # seconds on one core for the whole comparison


def size(nx, ny, *more):
    return [f"mesh.nx={nx}", f"mesh.ny={ny}", *more]


def runs():
    """Name -> settings of the command line; none: the mesh of unstructured.geo."""
    table = {f"second gradient, {name}": size(*n) for name, n in RECTANGLES.items()}
    table |= {f"Q8, {name}": size(*n, "element.type=q8") for name, n in RECTANGLES.items()}
    table["second gradient, 16 x 32 distorted"] = size(16, 32, "mesh.distortion=0.2")
    table["second gradient, Gmsh unstructured"] = []
    return table


def unstructured_case(c):
    """The case with the mesh of unstructured.geo; the file it is written to."""
    text = (HERE / "case.toml").read_text()
    tail = text[text.index("[[region]]"):]
    file = c.runs / "unstructured.toml"
    file.write_text(f'[mesh]\ntype = "gmsh"\nfile = "{HERE / "unstructured.geo"}"\n\n{tail}')
    return file


def run_all(c):
    """Runs every mesh; returns the folders of those that have results, and whether they came to the end."""
    done = {}
    for name, settings in runs().items():
        case = HERE / "case.toml" if settings else unstructured_case(c)
        run = c.run(case, name.replace(" ", "_").replace(",", ""), *settings)
        if run.status != 0:
            print(f"{name}: {run.last_words()}")
        if (run.folder / "results.h5").exists():
            done[name] = (run.folder, run.status == 0)
    return done


def curve_distance(one, two):
    """Largest difference of two curves beyond the peak of the second, over its peak."""
    peak = int(np.argmax(two.stress))
    strain = np.linspace(two.strain[peak], min(one.strain[-1], two.strain[-1]), 200)
    difference = np.interp(strain, one.strain, one.stress) - np.interp(strain, two.strain, two.stress)
    return float(np.abs(difference).max() / two.stress[peak])


def measured_band(folder):
    try:
        return band_of_run(folder)
    except ResultsError as error:
        print(f"{folder.name}: {error}")
        return None


def band_rows(rows, name, band, reference, thickness, inclination):
    if band is None or reference is None:
        rows.append(row(f"{name}: band", None, None, 0))
        return
    rows.append(row(f"{name}: thickness [m]", band.thickness, reference.thickness, thickness * reference.thickness))
    rows.append(row(f"{name}: inclination [deg]", abs(band.inclination), abs(reference.inclination), inclination))


def draw_figures(c, done, curves):
    figure, axes = plt.subplots(figsize=(6, 4))
    for name, curve in curves.items():
        style = "--" if name.startswith("Q8") else "-"
        axes.plot(100 * curve.strain, curve.stress, style, linewidth=1, label=name)
    axes.set(xlabel="axial strain [%] (compression positive)", ylabel=r"axial stress / $\sigma_0$ (compression positive)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    figure.savefig(c.product("curves.png"), dpi=110, bbox_inches="tight")
    plt.close(figure)
    figure, panels = plt.subplots(1, len(done), figsize=(1.9 * len(done), 4.6), squeeze=False)
    for axes, (name, (target, _)) in zip(panels[0], done.items()):
        draw_map(axes, read_mesh(target), read_step(target), "strain_invariant")
        axes.set_title(name.replace(", ", "\n"), fontsize=7)
    figure.savefig(c.product("bands.png"), dpi=55, bbox_inches="tight")
    plt.close(figure)


def verify(c):
    done = run_all(c)
    rows = [row(f"{name}: exit status", 0.0 if done.get(name, (0, False))[1] else 1.0, 0, 0) for name in runs()]
    curves = {name: axial_curve(target, label=name) for name, (target, _) in done.items()}
    bands = {name: measured_band(target) for name, (target, _) in done.items()}
    fine, middle = "second gradient, 32 x 64", "second gradient, 16 x 32"
    rows.append(row("16 x 32 against 32 x 64: curves past the peak / peak",
                    curve_distance(curves[middle], curves[fine]), 0, 0.02))
    band_rows(rows, f"{middle} against 32 x 64", bands[middle], bands[fine], 0.05, 2.0)
    low, high = 45 + DILATANCY / 2, 45 + FRICTION / 2
    rows.append(row("second gradient, 32 x 64: inclination inside 45 + psi/2 .. 45 + phi/2 [deg]",
                    abs(bands[fine].inclination) if bands[fine] else None, (low + high) / 2, (high - low) / 2))
    for name in ("second gradient, 16 x 32 distorted", "second gradient, Gmsh unstructured"):
        band_rows(rows, f"{name} against 16 x 32", bands.get(name), bands[middle], 0.10, 3.0)
    for name, (nx, _) in RECTANGLES.items():
        band = bands.get(f"Q8, {name}")
        rows.append(row(f"Q8, {name}: thickness / element size", band.thickness * nx if band else None, 1.5, 1.0))
    rows.append(row("processor time of the comparison [s]", c.processor_seconds, 0, LIMIT))
    draw_figures(c, done, curves)
    c.table(judged.table(rows))
    print(*judged.table(rows), sep="\n")
    return judged.verdict(rows)


if __name__ == "__main__":
    arguments = campaign.parser(HERE, __doc__).parse_args()
    sys.exit(campaign.main(HERE, arguments, dict.fromkeys(runs(), ""), verify))
