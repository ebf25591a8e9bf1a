#!/usr/bin/python3
"""Noise floor of a volume element: how far its stress jumps when the strain of a trial changes by less than 1e-6.

    validation/solver/noise.py [--spheres N ...] [--inertial-numbers I ...] [--samples K] [--list] [--record]

The biaxial path of validation/ve_biaxial to 3 % in increments of 1e-3, `femxdem ve path --noise K`: at each step the rest
of a straight line through K stresses, over the stress. Rows: spheres x inertial number, that is DEM steps an increment.
"""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import numpy as np

from results import read_history
from ve_runs import biaxial, strain_until

STRAIN = 0.03
MARGIN = 30  # least tolerance over the noise: kNoiseMargin of fe_master/case_check.cpp
HEADER = ["| spheres | inertial number | DEM steps an increment | noise, median | 90 % of steps below | largest | least tolerance, median |",
          "|---|---|---|---|---|---|---|"]


def row(c, spheres, number, samples):
    settings = {"ve.spheres": spheres, "ve.inertial_number": number, **strain_until(STRAIN)}
    folder, _ = biaxial(c, f"noise/{spheres}_{number:g}", settings, noise=samples)
    h = read_history(folder)
    noise = h["stress_noise"][1:]
    steps = np.median(h["dem_steps"][1:] / h["evaluations"][1:])
    median, high, most = np.median(noise), np.quantile(noise, 0.9), noise.max()
    cells = [spheres, f"{number:g}", f"{steps:.0f}", f"{median:.1e}", f"{high:.1e}", f"{most:.1e}", f"{MARGIN * median:.1e}"]
    return "| " + " | ".join(map(str, cells)) + " |"


def follow(c, a):
    rows = []
    for spheres in a.spheres:
        for number in a.inertial_numbers:
            rows.append(row(c, spheres, number, a.samples))
            print(rows[-1], flush=True)
            c.table(HEADER + rows, page="noise.md")


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--spheres", type=int, nargs="+", default=[100, 200, 1000])
    parser.add_argument("--inertial-numbers", type=float, nargs="+", default=[2e-2, 1e-2, 5e-3, 2e-3, 1e-3])
    parser.add_argument("--samples", type=int, default=5)
    a = parser.parse_args()
    rows = {f"noise/{spheres}_{number:g}": "" for spheres in a.spheres for number in a.inertial_numbers}
    return campaign.main(HERE, a, rows, lambda c: follow(c, a))


if __name__ == "__main__":
    sys.exit(main())
