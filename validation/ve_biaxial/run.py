#!/usr/bin/python3
"""The paper's volume element along the biaxial's path, several seeds: curves, peak, value at the end.

    validation/ve_biaxial/run.py [--seeds 1 2 3] [--spheres N] [--list] [--record] [--runs FOLDER]
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
    for seed, folder in folders.items():
        curve, h = path_curve(folder), read_history(folder)
        volumetric = h["strain_xx"] + h["strain_yy"] + h["strain_zz"]
        stress.plot(100 * curve.strain, curve.stress, linewidth=1, label=f"seed {seed}")
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
        draw(folders, c.product("ve_biaxial.png"))


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--spheres", type=int, default=1000)
    a = parser.parse_args()
    return campaign.main(HERE, a, {f"seed_{seed}": "" for seed in a.seeds}, lambda c: follow(c, a))


if __name__ == "__main__":
    sys.exit(main())
