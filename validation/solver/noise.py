#!/usr/bin/python3
"""Noise floor of a volume element: how far its stress jumps when the strain of a trial changes by less than 1e-6.

    validation/solver/noise.py [--femxdem PROGRAM] [--out FOLDER] [--cache FOLDER] [--spheres N ...] [--inertial-numbers I ...]
                               [--samples K]

The biaxial path of validation/ve_biaxial to 3 % in increments of 1e-3, `femxdem ve path --noise K`: at each step the rest
of a straight line through K stresses, over the stress. Rows: spheres x inertial number, that is DEM steps an increment.
Writes FOLDER/noise.md; runs that are done already are not repeated.
"""

import argparse
import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))
from results import read_history
from ve_runs import strain_until, ve_path

STRAIN = 0.03
MARGIN = 30  # least tolerance over the noise: kNoiseMargin of fe_master/case_check.cpp
HEADER = """| spheres | inertial number | DEM steps an increment | noise, median | 90 % of steps below | largest | least tolerance, median |
|---|---|---|---|---|---|---|
"""


def row(program, a, spheres, number):
    folder = a.out / f"{spheres}_{number:g}"
    settings = {"ve.spheres": spheres, "ve.inertial_number": number, "ve.cache": a.cache.resolve(), **strain_until(STRAIN)}
    ve_path(program, folder, settings, "--noise", str(a.samples))
    h = read_history(folder)
    noise = h["stress_noise"][1:]
    steps = np.median(h["dem_steps"][1:] / h["evaluations"][1:])
    median, high, most = np.median(noise), np.quantile(noise, 0.9), noise.max()
    cells = [spheres, f"{number:g}", f"{steps:.0f}", f"{median:.1e}", f"{high:.1e}", f"{most:.1e}", f"{MARGIN * median:.1e}"]
    return "| " + " | ".join(map(str, cells)) + " |"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--femxdem", default="build/release/femxdem", help="the program")
    parser.add_argument("--out", type=Path, default=Path("out/noise"))
    parser.add_argument("--cache", type=Path, default=Path("packings"))
    parser.add_argument("--spheres", type=int, nargs="+", default=[100, 200, 1000])
    parser.add_argument("--inertial-numbers", type=float, nargs="+", default=[2e-2, 1e-2, 5e-3, 2e-3, 1e-3])
    parser.add_argument("--samples", type=int, default=5)
    a = parser.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for spheres in a.spheres:
        for number in a.inertial_numbers:
            rows.append(row(Path(a.femxdem).resolve(), a, spheres, number))
            print(rows[-1], flush=True)
            (a.out / "noise.md").write_text(HEADER + "\n".join(rows) + "\n")


if __name__ == "__main__":
    main()
