#!/usr/bin/python3
"""Solution strategies on one case: strategy x tolerance x increment, as a table and a figure.

    validation/solver/run.py [--case CASE.toml] [--ve] [--strategies NAME ...] [--tolerances T ...] [--increments S ...]
                             [--seeds N ...] [--end SECONDS] [--as-they-are] [--list] [--record] [--runs FOLDER] [--ranks N]

Without a case: biaxial_law.toml of this folder, a softening law in closed form (seconds a run); --ve: the same body on
volume elements of 200 spheres, biaxial_ve.toml, half an hour to hours a run, one a seed, with a checkpoint every 10 steps. An
evaluation is one straining of every material point, those of rejected steps included; the peak is that of the first
monitor. Distances are those from the first run's of the same seed. With --as-they-are none is started and those that were
interrupted are taken as far as they came.
"""

import itertools
import re
import shutil
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

STRATEGIES = {
    "quasi_newton": ["solver.operator=quasi_newton"],
    "quasi_newton_line_search": ["solver.operator=quasi_newton", "solver.line_search=true"],
    "quasi_newton_anderson": ["solver.operator=quasi_newton", "solver.acceleration=anderson"],
    "newton": ["solver.operator=tangent"],
    "newton_line_search": ["solver.operator=tangent", "solver.line_search=true"],
    "perturbation": ["solver.operator=perturbation"],
    "elastic": ["solver.operator=elastic"],
    "elastic_reduced": ["solver.operator=elastic", "ve.stiffness=reduced"],
    "elastic_sliding": ["solver.operator=elastic", "ve.stiffness=sliding"],
    "elastic_relaxed": ["solver.operator=elastic", "ve.stiffness=relaxed"],
    "elastic_anderson": ["solver.operator=elastic", "solver.acceleration=anderson", "solver.anderson_depth=8"],
    "elastic_zero_start": ["solver.operator=elastic", "solver.predictor=none"],
}
CLOSED_FORM_ONLY = {"newton", "newton_line_search"}
VE_ONLY = {"elastic_reduced", "elastic_sliding", "elastic_relaxed"}


def measure(history, rejected, monitor, end):
    """One line of the table: evaluations a step before and past the peak, and what went wrong."""
    if not history:
        return {"steps": 0, "failures": rejected}
    force, evaluations = np.abs(history[monitor]), history["evaluations"]
    past = int(np.argmax(force)) + 1
    mean = lambda part: part.mean() if len(part) else float("nan")
    return {"steps": len(force), "before": mean(evaluations[:past]), "past": mean(evaluations[past:]), "most": evaluations.max(),
            "evaluations": evaluations.sum(), "failures": rejected, "smallest step": np.diff(history["time"], prepend=0.0).min(),
            "reached": history["time"][-1] / end, "peak": force.max()}


def distance(history, reference, monitor):
    """Largest difference of two curves over the reference's peak, before and past it, on the times of the reference that
    the other one reaches."""
    if not history or not reference:
        return 0.0, 0.0
    time, wanted = reference["time"], np.abs(reference[monitor])
    reached = time * (1 - 1e-9) <= history["time"][-1]
    off = np.abs(np.interp(time, history["time"], np.abs(history[monitor])) - wanted) / wanted.max()
    before = time <= time[np.argmax(wanted)]
    return max(off[reached & before], default=0.0), max(off[reached & ~before], default=0.0)


HEAD = ["strategy", "tolerance", "increment [s]", "seed", "mean", "before", "past", "most", "all", "failures", "smallest step [s]",
        "of the way", "peak", "distance before", "distance past"]


def table(lines):
    text = ["| " + " | ".join(HEAD) + " |", "|" + "---|" * len(HEAD)]
    for (name, tolerance, increment, seed), m, (before, past) in lines:
        key = f"| {name} | {tolerance:g} | {increment:g} | {'' if seed is None else seed} | "
        if m["steps"] == 0:
            text.append(key + f"no step, {m['failures']} failures |" + " |" * (len(HEAD) - 5))
            continue
        text.append(key + f"{m['evaluations'] / m['steps']:.2f} | {m['before']:.2f} | {m['past']:.2f} | {m['most']:.0f} | "
                    f"{m['evaluations']:.0f} | {m['failures']} | {m['smallest step']:.2g} | {100 * m['reached']:.0f} % | "
                    f"{m['peak']:.4g} | {100 * before:.2f} % | {100 * past:.2f} % |")
    return text


def draw(curves, monitor, file):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
    for (name, tolerance, increment, seed), history in curves:
        if not history:
            continue
        label = f"{name}, {tolerance:g}, {increment:g} s" + ("" if seed is None else f", seed {seed}")
        left.plot(history["time"], np.abs(history[monitor]), label=label, linewidth=0.9)
        right.plot(history["time"], history["evaluations"], ".-", linewidth=0.5, markersize=3)
    left.set(xlabel="time [s]", ylabel=f"|{monitor}|")
    left.legend(fontsize=6)
    right.set(xlabel="time [s]", ylabel="evaluations of a step", yscale="log")
    figure.savefig(file, dpi=110, bbox_inches="tight")


class Grid:
    """The runs that the arguments ask for, (strategy, tolerance, increment, seed) each."""

    def __init__(self, a):
        self.case = (a.case or HERE / ("biaxial_ve.toml" if a.ve else "biaxial_law.toml")).resolve()
        text = self.case.read_text()
        self.monitor = re.search(r'\[\[monitor\]\]\s*name = "(\w+)"', text).group(1)
        self.closed_form = 'type = "volume_element"' not in text
        self.end = a.end or (0.6 if self.closed_form else 2.0)
        self.seeds = [None] if self.closed_form else a.seeds
        names = [name for name in a.strategies if name not in (VE_ONLY if self.closed_form else CLOSED_FORM_ONLY)]
        self.keys = [(name, tolerance, increment, seed) for increment, tolerance, name, seed in
                     itertools.product(a.increments, sorted(a.tolerances), names, self.seeds)]

    def name(self, key):
        name, tolerance, increment, seed = key
        return "_".join([self.case.stem, name, f"{tolerance:g}", f"{increment:g}"] + ([] if seed is None else [str(seed)]))

    def settings(self, key):
        name, tolerance, increment, seed = key
        settings = [f"solver.tolerance={tolerance}", f"control.step={increment}", f"control.max_step={increment}",
                    f"control.end_time={self.end}", *STRATEGIES[name]]
        if seed is not None:
            settings.append(f"ve.seed={seed}")
        if not self.closed_form and increment < 0.01:
            settings.append("ve.min_steps=3")  # at 10 steps the rate of small increments is far below the case's
        return settings


def follow(c, grid, as_they_are):
    lines, curves = [], []
    for key in grid.keys:
        every = 0 if grid.closed_form else 10
        name = grid.name(key)
        run = c.as_it_is(name) if as_they_are else c.run(grid.case, name, *grid.settings(key), checkpoint_every=every)
        if run is None:
            continue
        if run.status == 2:
            raise campaign.CampaignError(f"{run.folder}: {run.last_words()}")
        history = run.history()
        curves.append((key, history))
        reference = next(other for one, other in curves if one[3] == key[3])
        lines.append((key, measure(history, len(run.rejections()), grid.monitor, grid.end), distance(history, reference, grid.monitor)))
        print(table(lines[-1:])[-1], flush=True)
        c.table(table(lines), mark="results" if grid.closed_form else "results on volume elements")
        if key[0] == "quasi_newton" and history:
            shutil.copy(run.folder / "history.csv", c.runs / f"history_{name}.csv")
    draw(curves, grid.monitor, c.product("strategies_law.png" if grid.closed_form else "biaxial_ve.png"))


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--case", type=Path)
    parser.add_argument("--ve", action="store_true")
    parser.add_argument("--strategies", nargs="+", choices=STRATEGIES, default=list(STRATEGIES))
    parser.add_argument("--tolerances", nargs="+", type=float, default=[5e-3, 1e-3])
    parser.add_argument("--increments", nargs="+", type=float, default=[0.02])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2, 3], help="with --ve")
    parser.add_argument("--end", type=float, help="0.6, with --ve 2 (10 %% of axial strain)")
    parser.add_argument("--as-they-are", action="store_true")
    a = parser.parse_args()
    grid = Grid(a)
    return campaign.main(HERE, a, {grid.name(key): "" for key in grid.keys}, lambda c: follow(c, grid, a.as_they_are),
                         on_meshes=True)


if __name__ == "__main__":
    sys.exit(main())
