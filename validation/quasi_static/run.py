#!/usr/bin/python3
"""Slow trials: evaluations of a step and curves against the rate, with the stress of the end or the mean as the answer.

    validation/quasi_static/run.py [ROW ...] [--strain E] [--list] [--record] [--runs FOLDER] [--as-they-are]

The biaxial of validation/solver (second gradient) on 4 x 8 elements, increments of 1e-3 of axial strain, tolerance 5e-3. The
name of a row: spheres, inertial number, answer (end; mean; late: the mean that belongs to 2/3 of the step), then what is not
as usual: damping, 8x16 (elements), seed (packing), half or quarter (increment), learned (a step's last
correction is answered by learned tangents). Rows `yade_alone`, `samples`, `roughness`: element_rates.py,
samples.py, roughness.py.
"""

import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign
import choice
import element_rates

import matplotlib.pyplot as plt
import numpy as np

from band import band_of_run
from results import ResultsError

CASE = HERE.parent / "solver" / "biaxial_ve.toml"
HEIGHT, SIGMA_0, VELOCITY = 2.0, 1e5, 0.1
NUMBERS = (2e-2, 5e-3, 2e-3, 1e-3, 5e-4)
ANSWERS = {"end": ('ve.answer="end"',), "mean": ('ve.answer="mean"',), "late": ('ve.answer="mean"', "ve.mean_at=0.66666")}
ENDS = {"": ('solver.last_correction="evaluated"',), "learned": ('solver.last_correction="learned"',)}
INCREMENTS = {"": 0.02, "half": 0.01, "quarter": 0.005}  # s: 1e-3 of axial strain, ...


class Key(NamedTuple):
    spheres: int
    number: float
    answer: str
    damping: float = 0.2
    mesh: str = "4x8"
    seed: int = 1
    increment: str = ""
    ending: str = ""

    def name(self):
        unusual = [f"{self.damping:g}" * (self.damping != 0.2), self.mesh * (self.mesh != "4x8"),
                   f"seed{self.seed}" * (self.seed != 1), self.increment, self.ending]
        return "_".join([str(self.spheres), f"{self.number:g}", self.answer, *filter(None, unusual)])


KEYS = [
    *(Key(spheres, number, answer, damping) for spheres in (200, 400, 1000) for number in NUMBERS for answer in ANSWERS
      for damping in (0.2, 0.7)),
    *(Key(1000, number, answer, mesh="8x16", seed=seed) for number in NUMBERS for answer in ("end", "mean") for seed in (1, 2, 3)),
    *(Key(spheres, number, "mean", seed=seed) for spheres in (200, 1000) for number in NUMBERS for seed in (2, 3)),
    *(Key(1000, number, answer, increment=part) for number in NUMBERS for answer in ("end", "mean") for part in ("half", "quarter")),
    *(Key(spheres, number, answer, seed=seed, ending="learned") for spheres in (200, 400, 1000) for number in NUMBERS
      for answer in ("end", "mean") for seed in (1, 2, 3)),
    *(Key(1000, number, "mean", mesh="8x16", seed=seed, ending="learned") for number in NUMBERS for seed in (1, 2, 3)),
]
ROWS = {key.name(): key for key in KEYS}
OTHERS = {
    "yade_alone": "single volume elements: YADE alone, the element with the end and with the mean, at four rates",
    "samples": "a stress in every so many DEM steps: what it costs, what it changes",
    "roughness": "single volume elements: what jumps along a line of neighbouring strains, by steps, spheres, damping, law",
}


def settings(key, strain):
    """Of the case file; D keeps the band at three elements or more of either mesh."""
    nx, ny = key.mesh.split("x")
    step = INCREMENTS[key.increment]
    mesh = [f"mesh.nx={nx}", f"mesh.ny={ny}", *(["element.D=4e3"] if nx == "4" else []), f"control.end_time={strain * HEIGHT / VELOCITY}"]
    return [*mesh, f"control.step={step}", f"control.max_step={step}", f"ve.spheres={key.spheres}", f"ve.seed={key.seed}",
            f"ve.inertial_number={key.number}", f"ve.damping={key.damping}", *ANSWERS[key.answer], *ENDS[key.ending]]


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
            f"{force[peak]:.3f}", f"{100 * strain[peak]:.2f}", at(0.025), at(0.0295), at(0.049), f"{100 * strain[-1]:.2f}",
            f"{run.processor_seconds:.0f}"]


def table(lines):
    head = ["row", "before", "past", "most", "rejected", "DEM steps", "peak / sigma_0", "at [%]", "at 2.5 %", "at 2.95 %", "at 4.9 %", "to [%]", "CPU [s]"]
    return [f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *([name, *cells] for name, cells in lines))]


def rates(runs):
    """Lines of a table over the rate, of the runs by key that differ in it and in the packing alone: means of the packings and
    their standard errors; a straight line through each packing's rates to zero."""
    chosen = {k: r for k, r in runs.items()
              if k.answer == "mean" and k == Key(k.spheres, k.number, "mean", mesh=k.mesh, seed=k.seed, ending=k.ending)}
    lines = ["| elements, spheres, last corrections | | " + " | ".join(f"I = {i:g}" for i in NUMBERS) + " | to I = 0 |", "|" + "---|" * (len(NUMBERS) + 3)]
    for mesh, spheres, ending in sorted({(k.mesh, k.spheres, k.ending) for k in chosen}):
        alike = {k: r for k, r in chosen.items() if (k.mesh, k.spheres, k.ending) == (mesh, spheres, ending)}
        by_rate = {i: {k.seed: r for k, r in alike.items() if k.number == i} for i in NUMBERS}
        if sum(len(found) > 1 for found in by_rate.values()) < 2:
            continue
        for what, of in READ.items():
            values = {i: {seed: of(r) for seed, r in found.items()} for i, found in by_rate.items()}
            cells = [mean_and_error(list(found.values())) for found in values.values()]
            of_seed = {seed: [i for i in NUMBERS if np.isfinite(values[i].get(seed, np.nan))] for seed in (1, 2, 3)}
            zero = [np.polyfit(at, [values[i][seed] for i in at], 1)[1] for seed, at in of_seed.items() if len(at) > 2]
            lines.append(f"| {mesh}, {spheres}, {ending or 'evaluated'} | {what} | " + " | ".join(cells) + f" | {mean_and_error(zero)} |")
    return lines


def mean_and_error(values):
    values = [v for v in values if np.isfinite(v)]
    if not values:
        return ""
    error = f" +- {np.std(values, ddof=1) / np.sqrt(len(values)):.3f}" if len(values) > 1 else ""
    return f"{np.mean(values):.3f}{error}"


def thickness(run):
    try:
        return band_of_run(run.folder).thickness
    except ResultsError:
        return float("nan")


def at_strain(e):
    def of(run):
        strain, force = curve(run.history())
        return float(np.interp(e, strain, force)) if strain[-1] >= e else float("nan")
    return of


READ = {"peak / sigma_0": lambda run: float(curve(run.history())[1].max()), "at 3 %": at_strain(0.03), "at 4.9 %": at_strain(0.049),
        "band [m]": thickness}


def draw(curves, file):
    """Colours: rates; a thin line for each packing; dashed: the end's stress; dotted: damping 0.7. Usual increments;
    of 8x16 elements with learned last corrections."""
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), sharey=True)
    for axis, (spheres, mesh, ending) in zip(axes, ((200, "4x8", ""), (1000, "4x8", ""), (1000, "8x16", "learned"))):
        labelled = set()
        for (key, history) in (c for c in curves if (c[0].spheres, c[0].mesh, c[0].increment, c[0].ending) == (spheres, mesh, "", ending)):
            strain, force = curve(history)
            style = "--" if key.answer == "end" else ":" if key.damping != 0.2 else "-"
            label = f"I = {key.number:g}, {key.answer}" + ", damping 0.7" * (style == ":")
            axis.plot(100 * strain, force, style, color=f"C{NUMBERS.index(key.number)}", linewidth=0.8, label=None if label in labelled else label)
            labelled.add(label)
        axis.set(xlabel="axial strain [%]", title=f"{mesh} elements, {spheres} spheres" + f", {ending}" * bool(ending))
        if labelled:
            axis.legend(fontsize=6)
    axes[0].set(ylabel="force / (sigma_0 W)")
    figure.savefig(file, dpi=90, bbox_inches="tight")


def write_choice(c, runs):
    """Table and figure of what rate, answer and damping cost and err by (choice.py)."""
    plain = {}
    for key, run in runs.items():
        answer = key.answer + ", damping 0.7" * (key.damping == 0.7) + ", learned" * (key.ending == "learned")
        if (key.mesh, key.increment) == ("4x8", "") and answer in choice.MARKERS:
            history = run.history()
            plain[key] = choice.Run(key.spheres, key.number, answer, *curve(history), history["evaluations"][history["step"] > 0],
                                    history["dem_steps"].sum(), len(run.rejections()))
    found = choice.rows([r for k, r in plain.items() if k.seed == 1])
    if not found:
        return
    packings = {}
    for key, run in plain.items():
        if run.answer == "mean" and run.strain[-1] >= choice.AT[-1]:
            packings.setdefault((key.spheres, -key.number), []).append(run)
    scatters = {spheres: choice.scatter(of) for (spheres, _), of in sorted(packings.items()) if len(of) > 2}
    lines = choice.table(found)
    print(*lines, sep="\n")
    said = ", ".join(f"{100 * s:.1f} % at {n} spheres" for n, s in scatters.items())
    c.table([*lines, "", f"Another packing of as many spheres moves the curve by (standard deviation of three): {said}."], mark="choice")
    choice.draw(found, scatters, c.product("choice.png"))


def work(c, chosen, strain, as_they_are):
    lines, curves, runs = [], [], {}
    if "yade_alone" in chosen and not as_they_are:
        element_rates.write(c)
    for script in ("samples", "roughness"):
        if script in chosen and not as_they_are:
            said = subprocess.run(["/usr/bin/python3", HERE / f"{script}.py", c.program.parent], env=campaign.ENVIRONMENT, check=True, capture_output=True, text=True)
            c.table([line for line in said.stdout.splitlines() if line.startswith("|")], mark=script)
    for name in (n for n in chosen if n not in OTHERS):
        run = c.as_it_is(name) if as_they_are else c.run(CASE, name, *settings(ROWS[name], strain), c.cache, checkpoint_every=10)
        cells = run and measure(run)
        if not cells:
            continue
        lines.append((name, cells))
        runs[ROWS[name]] = run
        curves.append((ROWS[name], run.history()))
        print(table(lines[-1:])[-1], flush=True)
        c.table(table(lines))
    if len(over_rates := rates(runs)) > 2:
        print(*over_rates, sep="\n")
        c.table(over_rates, mark="rates")
    write_choice(c, runs)
    if curves:
        draw(curves, c.product("quasi_static.png"))


def main():
    parser = campaign.parser(HERE, __doc__, rows=True)
    parser.add_argument("--strain", type=float, default=0.03, help="axial strain of the end")
    parser.add_argument("--as-they-are", action="store_true", help="table and figure of the runs that there are")
    a = parser.parse_args()
    rows = ROWS | OTHERS
    chosen = a.rows or list(rows)
    return campaign.main(HERE, a, rows, lambda c: work(c, chosen, a.strain, a.as_they_are), on_meshes=True)


if __name__ == "__main__":
    sys.exit(main())
