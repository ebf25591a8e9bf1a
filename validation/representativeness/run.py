#!/usr/bin/python3
"""How many spheres a volume element needs: stress at the peak and past it over spheres, seeds and size ratios.

    validation/representativeness/run.py [--spheres N ...] [--size-ratios R ...] [--most-seeds K] [--list] [--record]

The biaxial path of validation/ve_biaxial to 5 %, every packing prepared on its own. Table and figure after every group of
seeds.
"""

import csv
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

from results import path_curve
from ve_runs import biaxial, dem_steps, strain_until

STRAIN, RESIDUAL_FROM = 0.05, 0.04
SEEDS = {100: 5, 200: 5, 400: 5, 1000: 3, 2000: 3, 4000: 2}


def values(folder):
    """Peak over sigma_0, its strain, mean over the last per cent of strain, DEM steps."""
    curve = path_curve(folder)
    peak = int(np.argmax(curve.stress))
    residual = curve.stress[curve.strain >= RESIDUAL_FROM].mean()
    return curve.stress[peak], curve.strain[peak], residual, dem_steps(folder)


def group(c, ratio, spheres, seeds):
    """Values (seeds, 4) of one group; seeds whose run ended early are left out, and said."""
    found = []
    for seed in range(1, seeds + 1):
        settings = {"ve.spheres": spheres, "ve.seed": seed, "ve.size_ratio": float(ratio), **strain_until(STRAIN)}
        folder, early = biaxial(c, f"ratio_{ratio:g}/{spheres}_{seed}", settings)
        if early:
            print(f"left out: {folder}: {early}", flush=True)
        else:
            found.append(values(folder))
    return np.array(found)


def scatter(x):
    return float(np.std(x, ddof=1)) if len(x) > 1 else float("nan")


def table_lines(groups):
    lines = ["| d_max/d_min | spheres | seeds | peak / sigma_0 | scatter | residual / sigma_0 | scatter | DEM steps | sphere steps [1e6] |",
             "|---|---|---|---|---|---|---|---|---|"]
    for (ratio, spheres), v in groups.items():
        if len(v):
            lines.append(f"| {ratio:g} | {spheres} | {len(v)} | {v[:, 0].mean():.2f} | {scatter(v[:, 0]):.2f} | {v[:, 2].mean():.2f} | "
                         f"{scatter(v[:, 2]):.2f} | {v[:, 3].mean():.0f} | {1e-6 * spheres * v[:, 3].mean():.2f} |")
    return lines


def write(c, groups):
    with open(c.product("table.csv"), "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["size_ratio", "spheres", "seed", "peak", "strain_at_peak", "residual", "dem_steps"])
        for (ratio, spheres), v in groups.items():
            for seed, row in enumerate(v, 1):
                writer.writerow([ratio, spheres, seed] + [f"{x:.6g}" for x in row])
    c.table(table_lines(groups))


def draw(file, groups):
    figure, axes = plt.subplots(1, 3, figsize=(9, 3))
    for k, ratio in enumerate(dict.fromkeys(r for r, _ in groups)):
        chosen = {n: v for (r, n), v in groups.items() if r == ratio and len(v)}
        for one, column in zip(axes, (0, 2)):
            for n, v in chosen.items():
                one.semilogx(n * (1 + 0.06 * k) * np.ones(len(v)), v[:, column], ".", color=f"C{k}", markersize=4)
            one.semilogx([n * (1 + 0.06 * k) for n in chosen], [v[:, column].mean() for v in chosen.values()], "-", color=f"C{k}",
                         label=f"d_max/d_min = {ratio:g}")
        for column, style in ((0, "o-"), (2, "s--")):
            several = {n: v for n, v in chosen.items() if len(v) > 1}
            relative = [100 * scatter(v[:, column]) / v[:, column].mean() for v in several.values()]
            axes[2].loglog(list(several), relative, style, color=f"C{k}", markersize=3, label="peak" if column == 0 else "residual")
    for one, label in zip(axes, ("peak / sigma_0", "residual / sigma_0", "scatter between seeds [%]")):
        one.set_xlabel("spheres")
        one.set_title(label, fontsize=8)
        one.grid(alpha=0.3, which="both")
        one.legend(fontsize=6)
    figure.tight_layout()
    figure.savefig(file, dpi=90)
    plt.close(figure)


def follow(c, a):
    groups = {}
    for spheres in a.spheres:
        for ratio in a.size_ratios:
            groups[ratio, spheres] = group(c, ratio, spheres, min(SEEDS[spheres], a.most_seeds))
            print(table_lines({(ratio, spheres): groups[ratio, spheres]})[-1], flush=True)
            write(c, groups)
            draw(c.product("representativeness.png"), groups)


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--spheres", type=int, nargs="+", choices=SEEDS, default=list(SEEDS))
    parser.add_argument("--size-ratios", type=float, nargs="+", default=[1.5, 3.0])
    parser.add_argument("--most-seeds", type=int, default=5)
    a = parser.parse_args()
    rows = {f"ratio_{ratio:g}/{n}": f"{min(SEEDS[n], a.most_seeds)} seeds" for n in a.spheres for ratio in a.size_ratios}
    return campaign.main(HERE, a, rows, lambda c: follow(c, a))


if __name__ == "__main__":
    sys.exit(main())
