#!/usr/bin/python3
"""What `femxdem advise` predicts beside what runs take: evaluations, DEM steps, core hours, memory, scatter of packings.

    validation/advise/run.py [ROW ...] [--list] [--record]

Rows are finished runs of other pages beside what one probe tells of them, and cases that are advised and then run. Exit
status 1 where predicted evaluations, DEM steps or core hours are off by more than a factor of 1.5, or the predicted scatter
by more than 2.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "tools"), str(HERE.parents[1] / "fe_master" / "program")]
import advise
import campaign
from results import read_history

ROWS = {  # advised and run: name: (case, settings of advice and run, seeds of the scatter)
    "small": ("../biaxial/small.toml", [], (1, 2, 3)),
    "script": ("script.toml", [], ()),
}
FINISHED = {  # what one probe tells of runs that are done: (case, settings, evaluations, DEM steps, its page)
    "demo": ("../biaxial/demo.toml", [], 177, 2.40e6, "biaxial"),
    "biaxial_ve": ("../solver/biaxial_ve.toml", [], 301, 2.15e6, "solver"),
    "128": ("../biaxial/128.toml", [], 229, 1.67e6, "biaxial"),
    "512": ("../biaxial/512.toml", [], 262, 7.67e6, "biaxial"),
    "200_tol_1e-3": ("../solver/biaxial_ve.toml", ["solver.tolerance=1e-3"], 467, 3.38e6, "solver"),
}
COST, SCATTER = 1.5, 2.0  # what a prediction may be off by
ALL = {name: row[0] for name, row in (ROWS | FINISHED).items()}


def advice(c, name, case, settings):
    """advice.json of a row, and what was said."""
    def start(said):
        sets = [w for s in (*settings, c.cache) for w in ("--set", s)]
        return subprocess.run([str(w) for w in (c.program, "advise", HERE / case, "--out", c.runs / f"{name}_advice", *sets)],
                              stdout=said, stderr=said, env=campaign.ENVIRONMENT).returncode

    run = c.once(f"{name}_advice", {"advise": (HERE / case).read_text(), "settings": settings}, start)
    if run.status != 0:
        raise campaign.CampaignError(f"{name}: {run.last_words()}")
    return json.loads((run.folder / "advice.json").read_text()), run


def peak(folder):
    return np.abs(read_history(folder)["force_top"]).max()


def row(c, name):
    """Lines of the tables of a row, and whether it is within its limits."""
    case, settings, seeds = ROWS[name]
    told, advised = advice(c, name, case, settings)
    run = c.run(case, name, *settings, "ve.threads=1", c.cache)
    summary, cost = json.loads((run.folder / "summary.json").read_text()), told["cost"]
    seconds = run.processor_seconds
    beside = summary["peak_memory_points_bytes"] if summary["engine"] == "yade" else 0  # compact cells are in the program
    memory = summary["peak_memory_master_bytes"] + beside
    pairs = [(cost["evaluations"], summary["evaluations"]), (cost["dem_steps"], summary["dem_steps"]),
             (cost["core_hours"], seconds / 3600), (cost["bytes"] / 1e9, memory / 1e9)]
    cells = [f"{p:.3g} / {m:.3g} = {p / m:.2f}" for p, m in pairs]
    good = 1 / COST <= cost["core_hours"] * 3600 / seconds <= COST
    scatter = ""
    if seeds:
        runs = [c.run(case, f"{name}_{s}", *settings, f"ve.seed={s}", "ve.threads=1", c.cache) for s in seeds]
        peaks = np.array([peak(r.folder) for r in runs])
        measured, predicted = peaks.std(ddof=1) / peaks.mean(), told["scatter"]
        scatter = f"{100 * predicted:.2g} % / {100 * measured:.2g} % = {predicted / measured:.2f}"
        good = good and 1 / SCATTER <= predicted / measured <= SCATTER
    steps = f"{summary['steps']} ({summary['status']})"
    return f"| `{name}` | {steps} | " + " | ".join(cells) + f" | {scatter} | {'ok' if good else '**off**'} |", advised, good


def finished(c, name):
    """A row on a finished run: the cost that one probe predicts beside the recorded one; whether within its limit."""
    case, settings, evaluations, dem_steps, page = FINISHED[name]
    file = (HERE / case).resolve()

    def cost():
        folder = c.runs / f"{name}_probe"
        folder.mkdir(parents=True, exist_ok=True)
        given = advise.read(file, [*settings, c.cache])
        probes = advise.Probes(str(c.program), given, file, folder)
        path, points = probes.first(given["solver"].get("tolerance", 5e-3)), advise.points_of(str(c.program), file, [])
        ve = probes.effective["ve"]
        tolerance = given["solver"].get("tolerance", 5e-3)
        engine = probes.summary["engine"]
        return vars(advise.predicted(path, given, points, ve["spheres"], ve["inertial_number"], tolerance, ve["min_steps"], engine))

    found = c.value(f"{name}_cost", {"case": file.read_text(), "settings": settings}, cost)
    pairs = (found["evaluations"], evaluations), (found["dem_steps"], dem_steps)
    cells = " | ".join(f"{p:.3g} / {m:.3g} = {p / m:.2f}" for p, m in pairs)
    good = all(1 / COST <= p / m <= COST for p, m in pairs)
    return f"| `{name}` ([{page}](../{page})) | {cells} | {'ok' if good else '**off**'} |", good


def verify(c, names):
    rows = [row(c, name) for name in names if name in ROWS]
    done = [finished(c, name) for name in names if name in FINISHED]
    lines = ["One probe beside finished runs, predicted / recorded:", "", "| run | evaluations | DEM steps | |", "|---|---|---|---|",
             *(line for line, _ in done), "", "Advised and then run, predicted / measured:", "",
             "| case | steps | evaluations | DEM steps | core hours | GB | scatter of the peak, one packing | |", "|---|---|---|---|---|---|---|---|",
             *(line for line, _, _ in rows), ""]
    print(*lines, sep="\n")
    for name, (_, advised, _) in zip((n for n in names if n in ROWS), rows):
        lines += [f"`femxdem advise` on `{name}`:", "", "```", *(l for l in advised.said.splitlines() if not l.startswith("  ")), "```", ""]
    c.table(lines)
    return 0 if all([*(good for _, _, good in rows), *(good for _, good in done)]) else 1


if __name__ == "__main__":
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    sys.exit(campaign.main(HERE, arguments, ALL, lambda c: verify(c, arguments.rows or list(ALL))))
