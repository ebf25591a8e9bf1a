#!/usr/bin/python3
"""One HTML page of a run, whole in itself: it opens without a network.

    femxdem report DIR [--ve DIR2] [--out FILE.html]

It holds the curve (over that of the single volume element, from --ve or a folder DIR_ve), evaluations and residual of every
step, maps with a slider over the output steps, the measured band, the check of the engine, cost, versions and the case. DIR is
a folder of `femxdem run` or of `femxdem ve path`; of a run that goes on, it shows the steps up to now.
"""

import argparse
import io
import json
from dataclasses import replace
from html import escape
from pathlib import Path
from string import Template

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from band import band_of_run
from plot import draw_cost, draw_curves
from results import (Curve, ResultsError, confining_stress, end_with, natural_coordinates, output_steps, path_curve, read_case,
                     read_history, read_mesh, read_step, run_curve)
from spirals import spirals_of_run

MAPS = {
    "strain_invariant": "second invariant of strain |dev ln U|",
    "volumetric_strain": "volumetric strain (dilation positive)",
    "porosity": "porosity",
    "seconds": "DEM seconds of the last trial",
}
NUMBERS = 300_000  #: of all maps together: some 2 MB
COLOURS = [[round(255 * c) for c in matplotlib.colormaps["viridis"](k / 16)[:3]] for k in range(17)]
COSTS = (  # of summary.json: key, words, unit, factor
    ("steps", "converged steps", "", 1), ("evaluations", "evaluations", "", 1), ("dem_steps", "DEM steps", "", 1),
    ("ranks", "ranks", "", 1), ("threads", "threads of each rank", "", 1), ("wall_seconds", "wall time", "s", 1),
    ("engine_seconds", "of all cores in the DEM", "s", 1), ("parallel_efficiency", "parallel efficiency", "", 1),
    ("peak_memory_master_bytes", "memory of rank 0", "MB", 1e-6), ("peak_memory_points_bytes", "memory of the volume elements (compact cells: within that of their ranks)", "MB", 1e-6),
)  # fmt: skip


def read_summary(folder):
    """summary.json; empty while the run goes on, or after it was killed."""
    file = Path(folder) / "summary.json"
    return json.loads(file.read_text()) if file.exists() else {}


def is_path(history):
    """Whether this is the history of a single point."""
    return "strain_yy" in history and "stress_yy" in history


def point_curves(folder):
    """Stress components of a single point over that component of strain, of those that its path prescribes, which went
    farthest."""
    case, history = read_case(folder), read_history(folder)
    components = ("xx", "yy", "zz", "xy", "yz", "zx")
    prescribed = [c for c in components if any(f"strain_{c}" in segment for segment in case.get("path", []))]
    driven = max(prescribed or components, key=lambda c: np.ptp(history[f"strain_{c}"]))
    sigma_0 = confining_stress(case)
    names = {"of": "stress", "against": f"strain {driven} [%] (logarithmic, compression positive)"}
    names["unit"] = r"/ $\sigma_0$" if sigma_0 else "[Pa]"
    stresses = {c: -history[f"stress_{c}"] / (sigma_0 or 1.0) for c in components}
    largest = max(np.abs(s).max() for s in stresses.values())
    return [Curve(-history[f"strain_{driven}"], s, f"stress {c}", **names) for c, s in stresses.items()
            if np.abs(s).max() > 1e-2 * largest]


def curves_of(folder, ve_folder):
    """Curves to draw over one another, and the folder of the volume element that is among them, or None."""
    if is_path(read_history(folder)):
        return point_curves(folder), None
    curve = run_curve(folder, label="specimen (FEM x DEM)")
    beside = Path(f"{str(folder).rstrip('/')}_ve")
    ve_folder = ve_folder or (beside if (beside / "history.csv").exists() else None)
    if not ve_folder or curve.of != "axial stress":
        return [curve], None
    ve = path_curve(ve_folder)
    shown = ve.strain <= 1.05 * curve.strain.max()
    return [curve, replace(ve, strain=ve.strain[shown], stress=ve.stress[shown])], ve_folder


def svg(figure):
    """The figure as an element of the page."""
    stream = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "femxdem"}):
        figure.savefig(stream, format="svg", bbox_inches="tight", metadata={"Creator": None, "Date": None, "Format": None, "Type": None})
    plt.close(figure)
    text = stream.getvalue()
    return text[text.index("<svg"):]


def curve_svg(curves):
    figure, axes = plt.subplots(figsize=(6, 4))
    draw_curves(axes, curves)
    return svg(figure)


def cost_svg(history):
    figure, axes = plt.subplots(figsize=(6, 4))
    draw_cost(axes, history)
    return svg(figure)


def rounded(values, digits=4):
    """Numbers as JSON takes them: significant digits, null for what is not finite."""
    return [float(f"{v:.{digits}g}") if np.isfinite(v) else None for v in np.ravel(values)]


def quarter_of_points(mesh):
    """Of the four points of an element, in which quarter each lies (lower left, lower right, upper left, upper right, in
    natural coordinates); None where there are not four."""
    if mesh.points.shape[1] != 4:
        return None
    middles = np.array([(-0.5, -0.5), (0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)])
    natural = natural_coordinates(mesh.nodes[mesh.elements[:1]], mesh.points[:1])[0]
    return [int(np.argmin(np.linalg.norm(middles - x, axis=1))) for x in natural]


def shown_steps(folder, numbers_of_one):
    """Output steps, evenly chosen where all would be more numbers than a page should hold."""
    steps = output_steps(folder)
    most = max(2, NUMBERS // numbers_of_one)
    chosen = np.unique(np.linspace(0, len(steps) - 1, min(most, len(steps))).round().astype(int))
    return [steps[k] for k in chosen]


def map_data(folder):
    """What the page's script draws: mesh, fields of the output steps, colours."""
    data = {"steps": [], "colours": COLOURS}
    if not (Path(folder) / "results.h5").exists() or not output_steps(folder):
        return data
    mesh, last = read_mesh(folder), read_step(folder)
    names = [n for n in MAPS if n in last.fields and np.ptp(last.fields[n]) > 0]
    quarters = quarter_of_points(mesh)
    size, parts = np.ptp(mesh.nodes, axis=0).max(), len(mesh.elements) * (4 if quarters else 1)
    box, ranges = [], {n: [np.inf, -np.inf] for n in names}
    for number in shown_steps(folder, parts * len(names) + 2 * len(mesh.nodes)):
        step = read_step(folder, number)
        fields = {n: step.fields[n] if quarters else step.fields[n].mean(axis=1) for n in names if n in step.fields}
        for n, values in fields.items():
            ranges[n] = [min(ranges[n][0], np.nanmin(values)), max(ranges[n][1], np.nanmax(values))]
        at = mesh.nodes + step.displacement
        box.append([*at.min(axis=0), *at.max(axis=0)])
        data["steps"].append({"label": f"step {number}, time {step.time:.4g} s, load factor {step.load_factor:.4g}",
                              "displacement": rounded(np.round(step.displacement, int(np.ceil(4 - np.log10(size)))), 6),
                              "fields": {n: rounded(values) for n, values in fields.items()}})
    box = np.array(box)
    margin = 0.01 * size
    data["box"] = rounded([*(box[:, :2].min(axis=0) - margin), *(box[:, 2:].max(axis=0) + margin)], 6)
    data.update(nodes=[rounded(x, 6) for x in mesh.nodes], elements=mesh.elements.tolist(), quarters=quarters,
                limits={n: rounded(limits) for n, limits in ranges.items()})
    return data


def maps_html(data):
    if not data["steps"]:
        return "<p>A single material point has no maps, nor has a run without an output step.</p>"
    x0, y0, x1, y1 = data["box"]
    width = min(230, 420 * (x1 - x0) / (y1 - y0))
    size = f'width="{2 * width:.0f}" height="{2 * width * (y1 - y0) / (x1 - x0):.0f}" style="width:{width:.0f}px"'
    figures = "".join(f'<figure id="map-{n}"><canvas {size}></canvas><div class="bar"></div><div class="ends"><span></span><span></span>'
                      f"</div>{escape(MAPS[n])}</figure>" for n in data["limits"])
    last = len(data["steps"]) - 1
    return (f'<p><input id="slider" type="range" min="0" max="{last}" value="{last}"> <span id="step"></span> '
            f'<label><input id="fixed" type="checkbox"> same colours in all steps</label></p>{figures}')


def is_cylinder(case, curve):
    return case.get("mesh", {}).get("type") == "annulus" or curve.of.startswith("pressure")


def spiral_text(s):
    thickness = (f"thickness {s.thickness:.3g} m (scatter {s.thickness_scatter:.2g} over {s.stations} profiles)"
                 if s.stations else "no profile across it has two sides")
    return (f"From the wall at {s.start:.0f} degrees: {s.inclination:+.1f} degrees to the radius, reaches {s.reach:.2f} wall "
            f"radii, {thickness}.")


def band_text(folder, of_wall):
    """The measured bands as sentences, those of a wall from its sector of the case's angle, or why there is none."""
    try:
        if of_wall:
            angle = read_case(folder).get("mesh", {}).get("angle", 90.0)
            return "<br>".join(map(spiral_text, spirals_of_run(folder, angle=angle)))
        b = band_of_run(folder)
        return (f"Thickness {b.thickness:.4g} m (scatter {b.thickness_scatter:.2g} over {b.stations} profiles), full width at half "
                f"height, inclination {b.inclination:.1f} degrees from the lateral axis, peak of the strain {b.peak:.3g}: last output step.")
    except (ResultsError, ValueError) as error:
        return escape(f"Not measured: {error}.")


def table(rows):
    return "<table>" + "".join(f"<tr><td>{escape(str(a))}</td><td>{escape(str(b))}</td></tr>" for a, b in rows) + "</table>"


def engine_html(folder, summary):
    log = (Path(folder) / "log.txt").read_text() if (Path(folder) / "log.txt").exists() else ""
    verdict = next((line for line in log.splitlines() if line.startswith("engine: ")), "")
    rows = [("check", summary["engine_check"])] if summary.get("engine_check") else []
    for key, words, unit, factor in COSTS:
        if summary.get(key) is not None:
            rows.append((words, f"{factor * summary[key]:.4g} {unit}" if isinstance(summary[key], float) or unit else summary[key]))
    return (f"<p>{escape(verdict)}</p>" if verdict else "") + table(rows)


def page(folder, ve_folder=None):
    """The text of the page. Throws ResultsError for a folder without case.toml or a converged step."""
    folder = Path(folder)
    history, summary, case = read_history(folder), read_summary(folder), read_case(folder)
    curves, ve_folder = curves_of(folder, ve_folder)
    data = map_data(folder)
    title = "Single volume element" if is_path(history) else "FEM x DEM"
    status = summary.get("status", "has not ended")
    fields = {
        "title": escape(f"{title}: {folder.resolve().name}"),
        "status": escape(status), "status_class": "done" if status == "done" else "",
        "message": escape(summary.get("message", f"{len(history['step'])} steps up to now")) + escape(
            f" · {summary['date']} on {summary['host']}" if summary else ""),
        "curve_title": escape(f"{curves[0].of.capitalize()}" + (f", over that of {ve_folder}" if ve_folder else "")),
        "curve": curve_svg(curves), "convergence": cost_svg(history), "maps": maps_html(data),
        "band": band_text(folder, is_cylinder(case, curves[0])) if data["steps"] else "No band in a single point.",
        "engine": engine_html(folder, summary), "versions": table(summary.get("versions", {}).items()),
        "case_text": escape((folder / "case.toml").read_text()), "data": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
    }  # fmt: skip
    return Template(Path(__file__).with_suffix(".html").read_text()).substitute(fields)


def main():
    parser = argparse.ArgumentParser(prog="femxdem report", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", type=Path, help="folder that `femxdem run` or `femxdem ve path` wrote")
    parser.add_argument("--ve", metavar="DIR2", type=Path, help="folder of `femxdem ve path`, drawn over the curve (default: DIR_ve)")
    parser.add_argument("--out", metavar="FILE", type=Path, help="the page (default: DIR/report.html)")
    arguments = parser.parse_args()
    out = arguments.out or arguments.folder / "report.html"
    try:
        text = page(arguments.folder, arguments.ve)
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(text)
    except (ResultsError, OSError) as error:
        end_with("report", error)
    print(out)


if __name__ == "__main__":
    main()
