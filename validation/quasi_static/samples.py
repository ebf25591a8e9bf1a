#!/usr/bin/python3
"""What a stress in every so many DEM steps costs a trial that answers with its mean, and what it changes.

    samples.py BUILD [SPHERES]     # BUILD: folder of the compiled modules
"""

import sys
import time
from pathlib import Path

import numpy as np

from roughness import cell_of

ROOT = Path(__file__).resolve().parents[2]
NUMBER, STRAIN, CELLS = 2e-3, 2e-2, 8  # inertial number; a cell every 1/8 of that axial strain, biaxial at constant volume
TRIALS, EVERY = (20, 50, 150, 300, 600), (2, 4, 8, 16)  # DEM steps
BLOCKS = 9


def cells_and_rate(spheres):
    """Compact cells along the path, and the velocity gradient (3, 3) [1/s]."""
    cell = cell_of(spheres=spheres)
    L = np.diag([1.0, -1.0, 0.0]) / np.sqrt(2) * NUMBER / cell.info()["time_scale"]
    steps = int(STRAIN / CELLS / -L[1, 1] / cell.info()["time_step"])
    found = []
    for _ in range(CELLS):
        cell.deform(L, steps)
        found.append(cell.copy())
    return found, L


def lines_of(spheres):
    """Markdown lines: cost of a DEM step with a stress in every, over one without; median error of the mean of a trial."""
    cells, L = cells_and_rate(spheres)
    seconds = {every: [] for every in (0, 1, *EVERY)}
    for _ in range(BLOCKS):
        for every, spent in seconds.items():
            trial, start = cells[-1].copy(), time.process_time()
            trial.deform(L, 300, every)
            spent.append(time.process_time() - start)
    cost = {every: np.median(spent) / np.median(seconds[0]) for every, spent in seconds.items()}
    lines = ["| a stress in every | 1 | " + " | ".join(str(e) for e in EVERY) + " |", "|" + "---|" * (2 + len(EVERY)),
             f"| cost of a DEM step | {cost[1]:.2f} | " + " | ".join(f"{cost[e]:.2f}" for e in EVERY) + " |"]
    for steps in TRIALS:
        all_of = [np.array(cell.copy().deform(L, steps, 1)) for cell in cells]
        off = {e: [np.abs(np.array(cell.copy().deform(L, steps, e)) - a).max() / np.abs(a).max() for cell, a in zip(cells, all_of)] for e in EVERY}
        lines.append(f"| mean of {steps} steps off by | 0 | " + " | ".join(f"{np.median(off[e]):.1e}" for e in EVERY) + " |")
    return lines


if __name__ == "__main__":
    sys.path[:0] = [sys.argv[1], str(ROOT / "yade_scripts"), str(ROOT / "tests" / "yade")]
    print(*lines_of(int(sys.argv[2]) if len(sys.argv) > 2 else 1000), sep="\n")
