#!/usr/bin/python3
"""What `femxdem advise` predicts beside what runs take: evaluations, DEM steps, core hours, memory, and errors of curves.

    validation/advise/run.py [ROW ...] [--list] [--record]

Rows are finished runs of other pages beside what one probe tells of them, and cases that are advised and then run. Exit
status 1 where predicted evaluations, DEM steps or core hours are off by more than a factor of 1.5, or a predicted error by
more than 2. Row `errors`: runs of `small` with 400 spheres, three packings, one thing changed at a time; distances of their mean
curves (root mean square of the difference over that of the stress), as advise tells them of single volume elements.
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
from results import axial_curve, read_history
from ve_runs import relative_distance

ROWS = {  # advised and run: name: (case, settings of advice and run, seeds of the scatter)
    "small": ("../biaxial/small.toml", [], (1, 2, 3)),
    "script": ("script.toml", [], ()),
    "moments": ("script.toml", ['ve.arguments=["rolling"]'], ()),
}
FINISHED = {  # what one probe tells of runs that are done: (case, settings, evaluations, DEM steps, its page)
    "demo": ("../biaxial/demo.toml", [], 177, 2.40e6, "biaxial"),
    "biaxial_ve": ("../solver/biaxial_ve.toml", [], 301, 2.15e6, "solver"),
    "128": ("../biaxial/128.toml", [], 217, 1.57e6, "biaxial"),
    "512": ("../biaxial/512.toml", [], 272, 7.99e6, "biaxial"),
    "rate_5e-3": ("../biaxial/128.toml", ["ve.inertial_number=5e-3"], 211, 4.65e6, "biaxial"),
    "rate_2e-3": ("../biaxial/128.toml", ["ve.inertial_number=2e-3"], 223, 1.16e7, "biaxial"),
    "200_tol_1e-3": ("../solver/biaxial_ve.toml", ["solver.tolerance=1e-3"], 467, 3.38e6, "solver"),
}
ERRORS = {  # of the mean of three runs of 400 spheres: what is told, the settings compared, those they are compared with
    "inertial number 0.02 for 0.005": (lambda told: told["rate"]["0.02"], ("ve.inertial_number=0.02",), ("ve.inertial_number=0.005",)),
    "inertial number 0.01 for 0.005": (lambda told: told["rate"]["0.01"], ("ve.inertial_number=0.01",), ("ve.inertial_number=0.005",)),
    "half of the time step": (lambda told: told["time_step"], ("ve.time_step_safety=0.4",), ()),
    "increment 2e-3 for 5e-4": (lambda told: told["increment"], ("control.step=0.04", "control.max_step=0.04"), ("control.step=0.01", "control.max_step=0.01")),
    "tolerance as advised for 1e-3": (lambda told: told["tolerance"], ("solver.tolerance={tolerance:g}",), ("solver.tolerance=1e-3",)),
}
ERROR_CASE = "small"
COST, ERROR = 1.5, 2.0  # what a prediction may be off by
ALL = {name: row[0] for name, row in (ROWS | FINISHED).items()} | {"errors": "curves of whole runs beside the told errors"}


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
        good = good and 1 / ERROR <= predicted / measured <= ERROR
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
        tolerance = given["solver"].get("tolerance", 5e-3)
        path, ve = probes.first(tolerance), probes.effective["ve"]
        points, answers = advise.checked(str(c.program), given, file, settings)
        engine = probes.summary["engine"]
        return vars(advise.predicted(path, given, points, ve["spheres"], ve["inertial_number"], tolerance, ve["min_steps"], engine, answers))

    found = c.value(f"{name}_cost", {"case": file.read_text(), "settings": settings}, cost)
    pairs = (found["evaluations"], evaluations), (found["dem_steps"], dem_steps)
    cells = " | ".join(f"{p:.3g} / {m:.3g} = {p / m:.2f}" for p, m in pairs)
    good = all(1 / COST <= p / m <= COST for p, m in pairs)
    return f"| `{name}` ([{page}](../{page})) | {cells} | {'ok' if good else '**off**'} |", good


def mean_curve(c, settings):
    """Axial stress of the mean of three runs, on a grid of the axial strain (nominal) to the end that all reach."""
    runs = []
    for seed in (1, 2, 3):
        word = "_".join(settings).replace("=", "_") or "as_it_is"
        runs.append(c.run(ROWS[ERROR_CASE][0], f"errors/{word}_{seed}", "ve.spheres=400", *settings, f"ve.seed={seed}", "ve.threads=1", c.cache))
    curves = [axial_curve(run.folder, nominal=True) for run in runs]
    grid = np.linspace(0.004, 0.095, 201)  # from the second of the largest increments on
    return np.mean([np.interp(grid, k.strain, k.stress) for k in curves], axis=0)


def errors(c):
    """Lines of the table of errors, and whether all are within their limit."""
    told, _ = advice(c, ERROR_CASE, *ROWS[ERROR_CASE][:2])
    lines = []

    def add(name, predicted, measured):
        fits = 1 / ERROR <= predicted / measured <= ERROR
        lines.append(f"| {name} | {100 * predicted:.2g} % / {100 * measured:.2g} % = {predicted / measured:.2f} | {'ok' if fits else '**off**'} |")
        print(lines[-1], flush=True)

    for name, (of, one, other) in ERRORS.items():
        given = [tuple(s.format(tolerance=told["values"]["solver.tolerance"]) for s in settings) for settings in (one, other)]
        add(name, of(told), relative_distance(*(mean_curve(c, settings) for settings in given)))
    case, settings, _ = ROWS["moments"]
    told, _ = advice(c, "moments", case, settings)
    runs = [c.run(case, folder, *settings, *more, "ve.threads=1", c.cache) for folder, more in (("errors/without_moments", ("ve.moments=false",)), ("moments", ()))]
    grid = np.linspace(0.002, 0.0195, 101)
    curves = [np.interp(grid, k.strain, k.stress) for k in (axial_curve(run.folder, nominal=True) for run in runs)]
    add("`moments` without moments", told["moments"], relative_distance(*curves))
    return lines, all("**off**" not in line for line in lines)


def verify(c, names):
    rows = [row(c, name) for name in names if name in ROWS]
    done = [finished(c, name) for name in names if name in FINISHED]
    off_by, within = errors(c) if "errors" in names else ([], True)
    lines = ["One probe beside finished runs, predicted / recorded:", "", "| run | evaluations | DEM steps | |", "|---|---|---|---|",
             *(line for line, _ in done), "", "Advised and then run, predicted / measured:", "",
             "| case | steps | evaluations | DEM steps | core hours | GB | scatter of the peak, one packing | |", "|---|---|---|---|---|---|---|---|",
             *(line for line, _, _ in rows), "", "Errors of the curve, of probes of single volume elements / of runs of `small`, 400 spheres, means of three packings:", "",
             "| setting | | |", "|---|---|---|", *off_by, ""]
    print(*lines, sep="\n")
    for name, (_, advised, _) in zip((n for n in names if n in ROWS), rows):
        lines += [f"`femxdem advise` on `{name}`:", "", "```", *(l for l in advised.said.splitlines() if not l.startswith("  ")), "```", ""]
    c.table(lines)
    return 0 if all([*(good for _, _, good in rows), *(good for _, good in done), within]) else 1


if __name__ == "__main__":
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    sys.exit(campaign.main(HERE, arguments, ALL, lambda c: verify(c, arguments.rows or list(ALL))))
