"""Runs of single volume elements along the paper's biaxial path, for the campaigns of validation/."""

import json
import subprocess
from pathlib import Path

import numpy as np

from results import path_curve, read_history

BIAXIAL = Path(__file__).resolve().parent / "ve_biaxial" / "case.toml"


def ve_path(program, folder, settings, *options, case=BIAXIAL):
    """summary.json of `femxdem ve path` of `case` with `settings` {key: value}, into `folder`; a run that is done already
    is not repeated, one that fails is only reported in its summary."""
    summary = Path(folder) / "summary.json"
    if not summary.exists() or json.loads(summary.read_text())["status"] == "failed":
        Path(folder).mkdir(parents=True, exist_ok=True)
        overrides = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
        subprocess.run([str(program), "ve", "path", str(case), "--out", str(folder), "--overwrite", *overrides, *options],
                       stdout=subprocess.DEVNULL)
    return json.loads(summary.read_text())


def strain_until(strain, increment=1e-3):
    """Settings that end the path of ve_biaxial at a nominal axial `strain`; its increments are in logarithmic strain."""
    end = float(np.log1p(-strain))
    return {"path.0.strain_yy": end, "path.0.increments": max(1, round(-end / increment))}


def stresses(folder, strains):
    """Axial stress over sigma_0, compression positive, at nominal axial `strains`."""
    curve = path_curve(folder)
    return np.interp(strains, curve.strain, curve.stress)


def relative_distance(one, other):
    """Root mean square of the difference over that of `other`."""
    return float(np.sqrt(np.mean((one - other) ** 2) / np.mean(other**2)))


def dem_steps(folder):
    """DEM steps of all trials."""
    return int(read_history(folder)["dem_steps"].sum())
