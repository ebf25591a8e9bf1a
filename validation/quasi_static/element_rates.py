"""Single volume elements at several rates: strained by YADE alone, and as elements that answer with the end or the mean.

Paths, packings and YADE's own runs are those of validation/cross_yade; `distance` as there.
"""

import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "cross_yade"))
import campaign
import run as cross_yade

import numpy as np

from paths import PATHS
from results import read_columns

RATES = (2e-2, 5e-3, 2e-3, 1e-3)
SEEDS = (1, 2, 3)
CHOSEN = ("biaxial", "triaxial_compression")
LAW, SPHERES = "cohesive", 1000
ANSWERS = {"end": (), "mean": ('ve.answer="mean"',)}


def curves_of(c, path, seed, rate):
    """(strain, axial stress over sigma_0) of the path: {"YADE", "end", "mean"}, without what does not come to its end."""
    case = cross_yade.case_file(c, LAW, seed, path, SPHERES)
    state, manifest = cross_yade.packing(c.program, cross_yade.case_file(c, LAW, seed, PATHS["biaxial"], SPHERES))
    name = f"{path.name}_{rate:g}_{seed}"
    table = c.runs / "yade" / name / "curve.csv"
    speed = rate / manifest["time_scale"] / path.rate()
    command = ["/usr/bin/python3", HERE.parent / "cross_yade" / "yade_alone.py", state, path.name, str(speed), table]
    alone = c.once(f"yade/{name}", {"state": state.name, "path": path.name, "rate": speed},
                   lambda said: subprocess.run(command, stdout=said, stderr=said, env=campaign.ENVIRONMENT).returncode)
    if alone.status != 0:
        raise campaign.CampaignError(f"{alone.folder}: {alone.last_words()}")
    columns = {"YADE": read_columns(table)}
    for answer, settings in ANSWERS.items():
        element = c.path(case, f"{answer}/{name}", f"ve.inertial_number={rate}", *settings)
        if element.status == 0:
            columns[answer] = element.history()
        else:
            print(f"{element.folder}: {element.last_words()}", flush=True)
    return {series: axial(columns[series], series, path) for series in columns}


def axial(columns, series, path):
    """(strain, stress): of the whole path; a mean one ends half a step before its end."""
    strain, stress, _ = cross_yade.curve(columns, "yade" if series == "YADE" else "element", path)
    return np.abs(strain), stress[:, 1]


def write(c):
    """Table: peak and stress at 3 %, mean of the packings and their standard error; a straight line through the rates to zero."""
    lines = ["| path | | " + " | ".join(f"I = {rate:g}" for rate in RATES) + " | to I = 0 |", "|" + "---|" * (len(RATES) + 3)]
    for name in CHOSEN:
        found = {rate: [curves_of(c, PATHS[name], seed, rate) for seed in SEEDS] for rate in RATES}
        for what, of in (("peak", lambda strain, stress: stress.max()), ("at 3 %", lambda strain, stress: np.interp(0.03, strain, stress))):
            for series in ("YADE", *ANSWERS):
                values = np.array([[of(*curves[series]) if series in curves else np.nan for curves in found[rate]] for rate in RATES])
                mean, error = values.mean(axis=1), values.std(axis=1, ddof=1) / np.sqrt(len(SEEDS))
                cells = [f"{m:.3f} +- {e:.3f}" if np.isfinite(m) else "not converged" for m, e in zip(mean, error)]
                known = np.isfinite(mean)
                zero = np.array([np.polyfit(np.array(RATES)[known], of_seed[known], 1)[1] for of_seed in values.T])
                cells.append(f"{zero.mean():.3f} +- {zero.std(ddof=1) / np.sqrt(len(SEEDS)):.3f}")
                lines.append(f"| {name.replace('_', ' ')} | {what}, {'YADE alone' if series == 'YADE' else 'element, ' + series} | " + " | ".join(cells) + " |")
                print(lines[-1], flush=True)
    c.table(lines, mark="yade alone")
