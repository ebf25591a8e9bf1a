#!/usr/bin/python3
"""The paper's biaxial tests (Nguyen et al. 2017, Figs. 3 and 4) and what a reader would ask of them.

    validation/biaxial/run.py [ROW ...] [--list] [--record] [--runs FOLDER]
    validation/biaxial/run.py report --record      # table and figures of the rows that have results, nothing is run

Without names: the paper's rows and the restart. Finished rows are kept, one that was interrupted goes on from its last
checkpoint. Every row ends with the figures and tables of all rows that have results.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import boundary_problems
from boundary_problems import Row, cost, existing, how_it_ended, strength

import matplotlib.pyplot as plt
import numpy as np

from band import mean_profile, measure_band
from plot import draw_map
from results import ResultsError, axial_curve, deformed_points, output_steps, path_curve, read_mesh, read_step

PAPER = {
    "ve": Row("ve.toml", text="the single volume element: the DEM curve of Fig. 3", path=True),
    "128": Row("128.toml", text="8 x 16 second gradient: Figs. 3 and 4a"),
    "512": Row("512.toml", text="16 x 32 second gradient: Figs. 3 and 4b"),
    "first_gradient_128": Row("first_gradient_128.toml", text="8 x 16 Q8: what the second gradient mends"),
    "first_gradient_512": Row("first_gradient_512.toml", text="16 x 32 Q8"),
}
AUTHORS_CONTACTS = ("ve.contact_law=paper", "ve.new_contacts=adhesive", "ve.viscous_damping=0.2", "ve.damping=0")
AUTHORS_TRIALS = (*AUTHORS_CONTACTS, "ve.start_at_rest=true", "ve.hold_steps=50")
SENSITIVITY = {
    "ve_friction": Row("ve_friction.toml", text="the volume element at twice its confinement: friction angle", path=True),
    "rate_5e-3": Row("128.toml", ("ve.inertial_number=5e-3",), "128 at a quarter of the rate; mean stress of a trial, last corrections learned"),
    "rate_2e-3": Row("128.toml", ("ve.inertial_number=2e-3",), "128 at a tenth of the rate; mean stress of a trial, last corrections learned"),
    "yade": Row("128.toml", ("ve.engine=yade",), "128 in YADE itself; with --ranks 2, where compact cells take two threads"),
    **{f"packing_{n}": Row("128.toml", (f"ve.seed={n}",), f"128, packing {n}") for n in (2, 3, 4, 5)},
    "pool": Row("128.toml", ("ve.seeds=[1,2,3,4,5]", 've.assignment="random"'), "128, a random field of five packings"),
    "D_1.25e3": Row("128.toml", ("element.D=1.25e3",), "128, half of D"),
    "D_5e3": Row("128.toml", ("element.D=5e3",), "128, twice D"),
    "increment_5e-4": Row("128.toml", ("control.step=0.01", "control.max_step=0.01"), "128, half of the increment"),
    "increment_2e-3": Row("128.toml", ("control.step=0.04", "control.max_step=0.04"), "128, twice the increment"),
    "last_correction": Row("128.toml", ("solver.last_correction=learned",), "128, a step's last correction answered by learned tangents"),
    "paper_law": Row("128.toml", ("ve.contact_law=paper",), "128, the paper's contact law to the letter"),
    "paper_law_everywhere": Row("128.toml", ("ve.contact_law=paper", "ve.new_contacts=adhesive"), "the same, adhesion on every contact"),
    "authors_contacts": Row("128.toml", AUTHORS_CONTACTS, "the same, with dashpots for the local damping: the authors' contact switches"),
    "authors_trials": Row("128.toml", AUTHORS_TRIALS, "the same, trials from rest to rest"),
}
SMALL = {
    "small": Row("small.toml", text="4 x 8 second gradient, 100 spheres: tests and demonstrations"),
    "small_first_gradient": Row("small_first_gradient.toml", text="4 x 8 Q8, 100 spheres"),
}
RUNS = PAPER | SENSITIVITY | SMALL
TITLES = {
    "ve": "single volume element (DEM)",
    "128": "128 elements, second gradient",
    "512": "512 elements, second gradient",
    "first_gradient_128": "128 elements, Q8",
    "first_gradient_512": "512 elements, Q8",
}
HEADER = [
    "| row | elements, points | ended | peak / sigma_0 | at [%] | 5 % | 10 % | band [m] | inclination [deg] "
    "| evaluations before / past the peak, most | rejected | DEM steps | wall [s] | core hours |",
    "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
]


def curve_of(name, run, nominal=True):
    """Axial force over the initial width and sigma_0, the same for specimen and volume element; else over the current one."""
    label = TITLES.get(name, name)
    if RUNS[name].path:
        return path_curve(run.folder, label=label, nominal=nominal)
    return axial_curve(run.folder, label=label, nominal=nominal)


def band_at(folder, step=None):
    """Band of the whole strain at an output step, in the current configuration, and the fields it was measured in."""
    mesh, last = read_mesh(folder), read_step(folder, step)
    positions, values = deformed_points(mesh, last), last.fields["strain_invariant"]
    try:
        return measure_band(positions, values), positions, values
    except ResultsError:
        return None, positions, values


def at(curve, strain):
    return f"{np.interp(strain, curve.strain, curve.stress):.2f}" if curve.strain[-1] >= strain - 1e-9 else ""


def table_row(name, run):
    curve, paid, h = curve_of(name, run), cost(run), run.history()
    peak = int(np.argmax(curve.stress))
    cells = [f"`{name}`", "1", how_it_ended(run), f"{curve.stress[peak]:.2f}", f"{100 * curve.strain[peak]:.1f}", at(curve, 0.05), at(curve, 0.1)]
    if RUNS[name].path:
        cells += ["", "", f"{h['evaluations'].mean():.2f}, {paid.most}"]
    else:
        mesh = read_mesh(run.folder)
        cells[1] = f"{len(mesh.elements)}, {mesh.points.shape[0] * mesh.points.shape[1]}"
        band, _, _ = band_at(run.folder)
        cells += [f"{band.thickness:.3f} +- {band.thickness_scatter:.3f}", f"{abs(band.inclination):.1f}"] if band else ["none", ""]
        before, past = h["evaluations"][:peak + 1], h["evaluations"][peak + 1:]
        cells.append(f"{before.mean():.2f} / {past.mean() if len(past) else np.nan:.2f}, {paid.most}")
    cells += [paid.rejected, f"{paid.dem_steps:.3g}", f"{paid.wall:.0f}", f"{paid.core_hours:.2f}"]
    return "| " + " | ".join(map(str, cells)) + " |"


def claims(runs):
    """Lines of the comparisons that the paper makes, with our numbers."""
    lines = ["", "| the paper | here |", "|---|---|"]
    curves = {name: curve_of(name, run) for name, run in runs.items()}
    if {"ve", "128"} <= set(runs):
        ve = curves["ve"]
        for name in ("128", "512"):
            if name in curves:
                peak = ve.strain[int(np.argmax(ve.stress))]
                strain = np.linspace(1e-3, min(peak, curves[name].strain[-1]), 100)
                one, other = (np.interp(strain, c.strain, c.stress) for c in (curves[name], ve))
                lines.append(f"| Fig. 3: the specimen follows its volume element before the peak | {name}: within "
                             f"{100 * np.abs(one - other).max() / ve.stress.max():.1f} % of the peak up to {100 * peak:.1f} % of strain |")
    if {"ve", "ve_friction"} <= set(runs):
        friction, cohesion, dilatancy = strength(runs["ve"], runs["ve_friction"])
        lines.append(f"| bounds of the inclination, 45 + psi / 2 to 45 + phi / 2 | phi = {friction:.1f}, psi = {dilatancy:.1f} degrees, c = {cohesion:.2f} "
                     f"sigma_0: {45 + dilatancy / 2:.1f} to {45 + friction / 2:.1f} degrees |")
    for a, b in (("128", "512"), ("first_gradient_128", "first_gradient_512")):
        if a in curves and b in curves:
            lines.append(pair_line(a, b, curves, runs))
    return lines


def pair_line(a, b, curves, runs):
    end = min(curves[a].strain[-1], curves[b].strain[-1])
    begin = 0.05 if end > 0.06 else curves[a].strain[int(np.argmax(curves[a].stress))]
    strain = np.linspace(begin, end, 200)
    apart = np.abs(np.interp(strain, curves[a].strain, curves[a].stress) - np.interp(strain, curves[b].strain, curves[b].stress))
    apart = 100 * apart / curves[b].stress.max()
    common = max(set(output_steps(runs[a].folder)) & set(output_steps(runs[b].folder)))
    one, other = (band_at(runs[name].folder, common)[0] for name in (a, b))
    bands = ""
    if one and other:
        bands = (f"; bands {one.thickness:.3f} and {other.thickness:.3f} m ({100 * abs(one.thickness / other.thickness - 1):.0f} % apart), "
                 f"{abs(one.inclination):.1f} and {abs(other.inclination):.1f} degrees, at {common / 10:.0f} %")
    return (f"| Figs. 3 and 4: {TITLES[a]} and {TITLES[b]} | curves from {100 * begin:.1f} to {100 * end:.1f} %: "
            f"mean {apart.mean():.2f}, most {apart.max():.2f} % of the peak{bands} |")


def draw_curves(runs, names, file):
    figure, (stress, zoom) = plt.subplots(1, 2, figsize=(10, 3.6))
    for name in names:
        curve = curve_of(name, runs[name])
        style = {"ve": "k-", "128": "-s", "512": "-o"}.get(name, "--" if "first_gradient" in name else "-")
        for axes in (stress, zoom):
            axes.plot(100 * curve.strain, curve.stress, style, markersize=2.5, linewidth=1, label=curve.label)
    for axes in (stress, zoom):
        axes.set(xlabel="axial strain [%] (nominal, compression positive)", ylabel=r"axial force / ($\sigma_0 W$)")
        axes.grid(alpha=0.3)
    zoom.set(xlim=(0, 4), title="up to 4 %")
    stress.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=90)
    plt.close(figure)


VARIED = {"packing": ("packing_", "pool"), "D": ("D_",), "increment, rate": ("increment_", "rate_"), "contact law": ("paper_law", "authors_")}


def draw_sensitivity(runs, file):
    """The curve of 128 elements in each panel, beside what one thing changes of it."""
    figure, panels = plt.subplots(1, len(VARIED), figsize=(14, 3.4), sharey=True, constrained_layout=True)
    for axes, (title, kinds) in zip(panels, VARIED.items()):
        for name in ["128", *(name for name in SENSITIVITY if name.startswith(kinds))]:
            if name in runs:
                curve = curve_of(name, runs[name])
                axes.plot(100 * curve.strain, curve.stress, "k-" if name == "128" else "-", linewidth=1, label=name)
        axes.set(title=title, xlabel="axial strain [%]")
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7)
    panels[0].set_ylabel(r"axial force / ($\sigma_0 W$)")
    figure.savefig(file, dpi=80)
    plt.close(figure)


def draw_maps(runs, names, file):
    """Side by side at the largest strain that all of them have, with one scale."""
    common = max(set.intersection(*(set(output_steps(runs[name].folder)) for name in names)))
    figure, panels = plt.subplots(1, len(names), figsize=(2.7 * len(names), 5.4), squeeze=False)
    steps = {name: read_step(runs[name].folder, common) for name in names}
    top = np.quantile(steps[names[0]].fields["strain_invariant"], 0.995)
    for axes, name in zip(panels[0], names):
        draw_map(axes, read_mesh(runs[name].folder), steps[name], "strain_invariant", limits=(0, top))
        axes.set_title(TITLES.get(name, name).replace(", ", "\n"), fontsize=8)
    figure.suptitle(f"step {common} of increments of 1e-3", fontsize=8, y=0.02)
    figure.savefig(file, dpi=75, bbox_inches="tight")
    plt.close(figure)


def draw_profiles(runs, names, file):
    figure, axes = plt.subplots(figsize=(5.5, 3.4))
    for name in names:
        for step, style in zip([n for n in (30, 50, 100) if n in output_steps(runs[name].folder)], (":", "--", "-")):
            band, positions, values = band_at(runs[name].folder, step)
            if band:
                s, profile = mean_profile(positions, values, band, 0.6)
                axes.plot(s, profile, style, color={"128": "tab:blue", "512": "tab:orange"}.get(name), linewidth=1.2,
                          label=f"{name}, {step / 10:.0f} %: {band.thickness:.2f} m, {abs(band.inclination):.1f} deg")
    axes.set(xlabel="distance from the middle of the band [m]", ylabel=r"$|\mathrm{dev}\,\ln U|$, mean along the band")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    figure.savefig(file, dpi=90, bbox_inches="tight")
    plt.close(figure)


def report(c):
    runs = existing(c, RUNS)
    if not runs:
        return []
    c.processor_seconds = sum(run.processor_seconds for run in runs.values())
    specimens = [name for name in runs if not RUNS[name].path]
    paper = [name for name in PAPER if name in runs]
    if paper:
        draw_curves(runs, paper, c.product("curves.png"))
    if shown := [name for name in paper if name in specimens]:
        draw_maps(runs, shown[:2], c.product("maps.png"))
    if first := [name for name in shown if "first_gradient" in name]:
        draw_maps(runs, first, c.product("maps_first_gradient.png"))
    if second := [name for name in ("128", "512") if name in runs]:
        draw_profiles(runs, second, c.product("profiles.png"))
    if "128" in runs and any(name in specimens for name in SENSITIVITY):
        draw_sensitivity(runs, c.product("sensitivity.png"))
    return HEADER + [table_row(name, run) for name, run in runs.items() if name != "ve_friction"] + claims(runs)


if __name__ == "__main__":
    restart = "small.toml to 3 %", "control.end_time=0.6"
    sys.exit(boundary_problems.main(HERE, __doc__, RUNS, PAPER, restart, report))
