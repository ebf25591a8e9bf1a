#!/usr/bin/python3
"""The paper's volume element along the biaxial's path, several seeds: curves, peak, value at the end.

    validation/ve_biaxial/run.py [--laws] [--seeds 1 2 3] [--spheres N] [--list] [--record] [--runs FOLDER]

--laws: the same under the paper's law to the letter, and with each of the switches that make it the authors' engine's.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

from results import path_curve, read_history
from ve_runs import biaxial


def row(folder, seed):
    """Markdown row: peak, where, value at 5 % and at the end, porosity at start and end, what it cost."""
    curve, h = path_curve(folder), read_history(folder)
    peak = int(np.argmax(curve.stress))
    cells = [seed, f"{curve.stress[peak]:.2f}", f"{100 * curve.strain[peak]:.1f}", f"{np.interp(0.05, curve.strain, curve.stress):.2f}",
             f"{curve.stress[-10:].mean():.2f}",
             f"{h['porosity'][0]:.3f}", f"{h['porosity'][-1]:.3f}", f"{h['evaluations'][1:].mean():.2f}",
             f"{h['evaluations'].max():.0f}", f"{h['dem_steps'].sum():.0f}"]
    return "| " + " | ".join(map(str, cells)) + " |"


def draw(folders, file):
    figure, (stress, volume) = plt.subplots(1, 2, figsize=(8, 3.2))
    for label, folder in folders.items():
        curve, h = path_curve(folder), read_history(folder)
        volumetric = h["strain_xx"] + h["strain_yy"] + h["strain_zz"]
        stress.plot(100 * curve.strain, curve.stress, linewidth=1, label=label)
        volume.plot(100 * curve.strain, 100 * volumetric, linewidth=1)
    stress.set_ylabel(r"axial stress / $\sigma_0$")
    volume.set_ylabel("volumetric strain [%] (dilation positive)")
    for axes in (stress, volume):
        axes.set_xlabel("axial strain [%] (nominal, compression positive)")
        axes.grid(alpha=0.3)
    stress.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(file, dpi=100)
    plt.close(figure)


LAWS = {  # by name: what stands in the table, settings
    "adhesive": ("YADE's adhesive law", {}),
    "paper": ("the paper's law", {"contact_law": "paper"}),
    "everywhere": ("+ adhesion on every contact", {"contact_law": "paper", "new_contacts": "adhesive"}),
    "dashpots": ("+ dashpots for local damping", {"contact_law": "paper", "viscous_damping": 0.2, "damping": 0.0}),
    "at_rest": ("+ trials start at rest", {"contact_law": "paper", "start_at_rest": "true"}),
    "hold": ("+ hold of 50 steps", {"contact_law": "paper", "hold_steps": 50}),
}
LAWS["all"] = ("+ all four", {key: value for _, settings in LAWS.values() for key, value in settings.items()})
LAWS_HEADER = [
    "| law | peak / sigma_0 | at [%] | at 5 % | at the end (mean of 10) | volume change at 5 % [%] | at the end "
    "| evaluations a step | DEM steps | ended early |",
    "|---|---|---|---|---|---|---|---|---|---|",
]


def mean_and_scatter(values, form):
    """Mean over the seeds, +- half of the range."""
    return f"{np.mean(values):{form}} +- {np.ptp(values) / 2:{form}}" if len(values) > 1 else f"{values[0]:{form}}"


def numbers(folder):
    """What a row of LAWS_HEADER is made of, for one seed."""
    curve, h = path_curve(folder), read_history(folder)
    peak = int(np.argmax(curve.stress))
    volume = 100 * (h["strain_xx"] + h["strain_yy"] + h["strain_zz"])
    at_5 = float(np.interp(0.05, curve.strain, curve.stress)), float(np.interp(0.05, curve.strain, volume))
    return (curve.stress[peak], 100 * curve.strain[peak], at_5[0], curve.stress[-10:].mean(), at_5[1], volume[-1],
            h["evaluations"][1:].mean(), h["dem_steps"].sum())


def compare_laws(c, a):
    rows, shown = [], {}
    for name, (title, settings) in LAWS.items():
        found, reasons = [], []
        for seed in a.seeds:
            settings_of_seed = {"ve.seed": seed, "ve.spheres": a.spheres} | {f"ve.{key}": value for key, value in settings.items()}
            folder, reason = biaxial(c, f"{name}_{seed}", settings_of_seed)
            found.append(numbers(folder))
            reasons += [f"seed {seed}: {reason}"] if reason else []
            shown.setdefault(title, folder)
        forms = (".2f", ".1f", ".2f", ".2f", ".2f", ".2f", ".2f", ".0f")
        cells = [title, *(mean_and_scatter(values, form) for values, form in zip(zip(*found), forms)), "; ".join(reasons)]
        rows.append("| " + " | ".join(cells) + " |")
        print(rows[-1], flush=True)
        c.table(LAWS_HEADER + rows, mark="laws")
        draw(shown, c.product("laws.png"))


HEADER = [
    "| seed | peak / sigma_0 | at [%] | at 5 % | at the end (mean of 10) | porosity, start | end | evaluations a step | most | DEM steps |",
    "|---|---|---|---|---|---|---|---|---|---|",
]


def follow(c, a):
    folders, rows = {}, []
    for seed in a.seeds:
        folders[seed], _ = biaxial(c, f"seed_{seed}", {"ve.seed": seed, "ve.spheres": a.spheres})
        rows.append(row(folders[seed], seed))
        print(rows[-1], flush=True)
        c.table(HEADER + rows)
        draw({f"seed {seed}": folder for seed, folder in folders.items()}, c.product("ve_biaxial.png"))


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--spheres", type=int, default=1000)
    parser.add_argument("--laws", action="store_true", help="compare the contact laws and switches")
    a = parser.parse_args()
    rows = {name: title for name, (title, _) in LAWS.items()} if a.laws else {f"seed_{seed}": "" for seed in a.seeds}
    return campaign.main(HERE, a, rows, lambda c: compare_laws(c, a) if a.laws else follow(c, a))


if __name__ == "__main__":
    sys.exit(main())
