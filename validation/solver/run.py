#!/usr/bin/python3
"""Solution strategies on one case: strategy x tolerance x increment, as a table and a figure.

    validation/solver/run.py [CASE.toml] [--ve] [--femxdem build/release/femxdem] [--out out/solver]
                             [--strategies NAME ...] [--tolerances T ...] [--increments S ...] [--seeds N ...] [--end SECONDS]
                             [--as-they-are]

Without a case: biaxial_law.toml of this folder, a softening law in closed form (seconds a run); --ve: the same body on
volume elements of 200 spheres, biaxial_ve.toml, half an hour to hours a run, one a seed. An evaluation is one straining of
every material point, those of rejected steps included; the peak is that of the first monitor. Distances are those from the
first run's of the same seed. Runs that have ended are not repeated; with --as-they-are none is started and those that
were interrupted are taken as far as they came.
"""

import argparse
import csv
import itertools
import json
import re
import shutil
import subprocess
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
STRATEGIES = {
    "quasi_newton": ["solver.operator=quasi_newton"],
    "quasi_newton_line_search": ["solver.operator=quasi_newton", "solver.line_search=true"],
    "quasi_newton_anderson": ["solver.operator=quasi_newton", "solver.acceleration=anderson"],
    "newton": ["solver.operator=tangent"],
    "newton_line_search": ["solver.operator=tangent", "solver.line_search=true"],
    "perturbation": ["solver.operator=perturbation"],
    "elastic": ["solver.operator=elastic"],
    "elastic_anderson": ["solver.operator=elastic", "solver.acceleration=anderson", "solver.anderson_depth=8"],
    "elastic_zero_start": ["solver.operator=elastic", "solver.predictor=none"],
}
CLOSED_FORM_ONLY = {"newton", "newton_line_search"}


def run(femxdem, case, folder, overrides):
    command = [femxdem, "run", case, "--out", folder, "--overwrite"]
    for override in overrides:
        command += ["--set", override]
    subprocess.run(command, stdout=subprocess.DEVNULL)


def read(folder):
    """Rows of history.csv, rejected attempts by their reason."""
    with open(folder / "history.csv") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    rejected = re.findall(r"rejected: (\w+)", (folder / "log.txt").read_text())
    return rows, rejected


def measure(rows, rejected, monitor, end):
    """One line of the table: evaluations a step before and past the peak, and what went wrong."""
    if not rows:
        return {"steps": 0, "failures": len(rejected)}
    force = [abs(row[monitor]) for row in rows]
    peak = force.index(max(force))
    before, past = rows[: peak + 1], rows[peak + 1 :]

    def mean(part):
        return sum(row["evaluations"] for row in part) / len(part) if part else float("nan")

    return {"steps": len(rows), "before": mean(before), "past": mean(past), "most": max(row["evaluations"] for row in rows),
            "evaluations": sum(row["evaluations"] for row in rows), "failures": len(rejected),
            "smallest step": min(b["time"] - a["time"] for a, b in zip([{"time": 0}] + rows, rows)),
            "reached": rows[-1]["time"] / end, "peak": max(force)}


def distance(rows, reference, monitor):
    """Largest difference of two curves over the reference's peak, before and past it, on the times of the reference."""
    times, forces = [row["time"] for row in rows], [abs(row[monitor]) for row in rows]
    peak = max(abs(row[monitor]) for row in reference)
    of_peak = next(row["time"] for row in reference if abs(row[monitor]) == peak)
    worst = [0.0, 0.0]
    for row in reference:
        later = next((i for i, t in enumerate(times) if t >= row["time"] * (1 - 1e-9)), None)
        if later is None:
            break
        t0, f0 = (times[later - 1], forces[later - 1]) if later else (0.0, forces[0])
        t1, f1 = times[later], forces[later]
        value = f1 if t1 == t0 else f0 + (f1 - f0) * (row["time"] - t0) / (t1 - t0)
        past = row["time"] > of_peak
        worst[past] = max(worst[past], abs(value - abs(row[monitor])) / peak)
    return worst


def table(lines):
    head = ["strategy", "tolerance", "increment [s]", "seed", "mean", "before", "past", "most", "all", "failures", "smallest step [s]",
            "of the way", "peak", "distance before", "distance past"]
    text = "| " + " | ".join(head) + " |\n|" + "---|" * len(head) + "\n"
    for (name, tolerance, increment, seed), m, (before, past) in lines:
        key = f"| {name} | {tolerance:g} | {increment:g} | {'' if seed is None else seed} | "
        if m["steps"] == 0:
            text += key + f"no step, {m['failures']} failures |\n"
            continue
        text += key + (f"{m['evaluations'] / m['steps']:.2f} | {m['before']:.2f} | {m['past']:.2f} | {m['most']:.0f} | "
                       f"{m['evaluations']:.0f} | {m['failures']} | {m['smallest step']:.2g} | {100 * m['reached']:.0f} % | "
                       f"{m['peak']:.4g} | {100 * before:.2f} % | {100 * past:.2f} % |\n")
    return text


def draw(curves, monitor, file):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
    for (name, tolerance, increment, seed), rows in curves:
        label = f"{name}, {tolerance:g}, {increment:g} s" + ("" if seed is None else f", seed {seed}")
        left.plot([r["time"] for r in rows], [abs(r[monitor]) for r in rows], label=label, linewidth=0.9)
        right.plot([r["time"] for r in rows], [r["evaluations"] for r in rows], ".-", linewidth=0.5, markersize=3)
    left.set(xlabel="time [s]", ylabel=f"|{monitor}|")
    left.legend(fontsize=6)
    right.set(xlabel="time [s]", ylabel="evaluations of a step", yscale="log")
    figure.savefig(file, dpi=110, bbox_inches="tight")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("case", nargs="?", type=Path)
    parser.add_argument("--ve", action="store_true")
    parser.add_argument("--femxdem", type=Path, default=HERE.parents[1] / "build/release/femxdem")
    parser.add_argument("--out", type=Path, default=Path("out/solver"))
    parser.add_argument("--strategies", nargs="+", choices=STRATEGIES, default=list(STRATEGIES))
    parser.add_argument("--tolerances", nargs="+", type=float, default=[5e-3, 1e-3])
    parser.add_argument("--increments", nargs="+", type=float, default=[0.02])
    parser.add_argument("--seeds", nargs="+", type=int, help="with --ve")
    parser.add_argument("--end", type=float, help="0.6, with --ve 2 (10 %% of axial strain)")
    parser.add_argument("--as-they-are", action="store_true")
    a = parser.parse_args()
    case = a.case or HERE / ("biaxial_ve.toml" if a.ve else "biaxial_law.toml")
    monitor = re.search(r'\[\[monitor\]\]\s*name = "(\w+)"', case.read_text()).group(1)
    closed_form = 'type = "volume_element"' not in case.read_text()
    end = a.end or (2.0 if a.ve else 0.6)
    seeds = [None] if closed_form else a.seeds or [1, 2, 3]
    lines, curves = [], []
    for increment, tolerance, name, seed in itertools.product(a.increments, sorted(a.tolerances), a.strategies, seeds):
        if name in CLOSED_FORM_ONLY and not closed_form:
            continue
        key = (name, tolerance, increment, seed)
        folder = a.out / "_".join([name, f"{tolerance:g}", f"{increment:g}"] + ([] if seed is None else [str(seed)]))
        overrides = [f"solver.tolerance={tolerance}", f"control.step={increment}", f"control.max_step={increment}",
                     f"control.end_time={end}", *STRATEGIES[name]]
        if seed is not None:
            overrides.append(f"ve.seed={seed}")
        if not closed_form and increment < 0.01:
            overrides.append("ve.min_steps=3")  # at 10 steps the rate of small increments is far below the case's
        if not a.as_they_are and not (folder / "summary.json").exists():
            run(a.femxdem, case, folder, overrides)
        if a.as_they_are and not (folder / "history.csv").exists():
            continue
        rows, rejected = read(folder)
        curves.append((key, rows))
        reference = next(rows for other, rows in curves if other[3] == seed)
        lines.append((key, measure(rows, rejected, monitor, end),
                      distance(rows, reference, monitor) if rows and reference else (0.0, 0.0)))
        print(table(lines[-1:]).splitlines()[-1], flush=True)
        if name == "quasi_newton":
            shutil.copy(folder / "history.csv", a.out / f"history_{folder.name}.csv")
    (a.out / "table.md").write_text(table(lines))
    draw(curves, monitor, a.out / "strategies.png")


if __name__ == "__main__":
    main()
