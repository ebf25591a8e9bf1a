"""Single volume elements along the paper's biaxial path, for the campaigns that ask what a setting does to them."""

import json

import numpy as np

from campaign import ROOT
from results import path_curve, read_history

BIAXIAL = ROOT / "validation" / "ve_biaxial" / "case.toml"


def biaxial(campaign, name, settings, noise=0):
    """Folder of `femxdem ve path` of the biaxial path with `settings` {key: value}, and why it ended early, or nothing."""
    run = campaign.path(BIAXIAL, name, *(f"{key}={value}" for key, value in settings.items()), campaign.cache, noise=noise)
    if run.status == 0:
        return run.folder, ""
    summary = run.folder / "summary.json"
    return run.folder, json.loads(summary.read_text())["message"] if summary.exists() else run.last_words()


def strain_until(strain, increment=1e-3):
    """Settings that end the path at a nominal axial `strain`; its increments are in logarithmic strain."""
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
