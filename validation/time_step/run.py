#!/usr/bin/python3
"""The automatic time step over the largest stable one, for stiffness, stiffness ratio and size ratio.

    validation/time_step/run.py [--out FOLDER] [--spheres N] [--seed S]

Each packing is strained along a biaxial path by 2 % (stiff ones by 10/kappa) with many time steps; the largest stable one
is found by bisection. A step is unstable where the mean kinetic energy of the path's second half exceeds 1.5 times that at
3/4 of the critical step, or the stresses are off by more than 1 % and more than 3 times what half and 3/4 of the critical
step differ by (where contacts slide, the energy alone does not tell). Writes FOLDER/table.csv, table.md, with what the
stress is off at 1.5 times the critical step, and time_step.png; packings that are in table.csv are not repeated.
"""

import argparse
import csv
import itertools
import os
import sys
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent.parent / "yade_scripts"))
import contact_loop
from time_step import critical_time_step
from volume_element import Engine

KAPPAS, STIFFNESS_RATIOS, SIZE_RATIOS = (100.0, 500.0, 10000.0), (0.2, 1.0, 2.0), (1.0, 2.0, 4.0)
LEAST_STEPS, WINDOWS = 1000, 20


def path_of(kappa):
    """Strain and inertial number: contacts deform by 1/kappa, and their springs feel the rate as I sqrt(kappa)."""
    return 0.02 * min(1.0, 500.0 / kappa), 5e-3 * min(1.0, np.sqrt(500.0 / kappa))


DIRECTION = np.diag([0.5, -1.0, 0.0])  # of the velocity gradient: a biaxial path that dilates a little
BASE = 0.75  # of the critical step: the reference
FINER = 0.5  # of the critical step: says what a stable step changes
BEYOND = 1.5  # of the critical step: over the cliff
ENERGY_LIMIT, LEAST_ERROR, ERROR_LIMIT = 1.5, 0.01, 3.0
HIGHEST = 2.25
RESOLUTION = 0.04  # of the critical step


class Packing:
    """One packing and its answers at multiples of the critical time step."""

    def __init__(self, engine, spec):
        from yade.utils import PWaveTimeStep

        self.engine, made = engine, engine.make_template(spec)
        self.state, self.automatic = made["state"], made["manifest"]["time_step"]
        self.strain, number = path_of(spec["kappa"])
        self.rate = number / made["manifest"]["time_scale"]
        ve = self._scene()
        self.critical = critical_time_step(engine.O, contact_loop.contacts(engine.O))
        self.waves = PWaveTimeStep()
        engine.remove(ve)

    def _scene(self):
        ve = self.engine.add(self.state)
        self.engine.info(ve)  # makes it YADE's current one
        return ve

    def answers(self, factor):
        """Mean kinetic energy [J] of the second half and stresses (windows, 9) [Pa] along the path."""
        from yade._utils import kineticEnergy

        ve = self._scene()
        self.engine.O.dt = dt = factor * self.critical
        steps = max(self.strain / (self.rate * dt), LEAST_STEPS)
        each = int(np.ceil(steps / WINDOWS))
        L = DIRECTION * self.strain / (each * WINDOWS * dt)
        stress, report, stretch = np.empty(9), np.empty(len(self.engine.report_fields)), np.empty(9)
        energies, stresses = [], []
        for _ in range(WINDOWS):
            self.engine.deform(ve, L, each)
            self.engine.measure(ve, stress, report, stretch)
            energies.append(kineticEnergy())
            stresses.append(stress.copy())
        self.engine.remove(ve)
        return np.mean(energies[WINDOWS // 2:]), np.array(stresses)

    def against_base(self, factor):
        """Kinetic energy over that of the reference, relative distance of the stresses from it."""
        energy, stress = self.answers(factor)
        error = np.linalg.norm(stress - self.reference[1]) / np.linalg.norm(self.reference[1])
        print(f"    {factor:.3f} critical: energy x {energy / self.reference[0]:.2f}, stress off by {100 * error:.1f} %", flush=True)
        return energy / self.reference[0], error

    def largest_stable(self):
        """[s], and the error of the stress beyond."""
        self.reference = self.answers(BASE)
        most = max(LEAST_ERROR, ERROR_LIMIT * self.against_base(FINER)[1])
        low, high = BASE, HIGHEST
        while high - low > RESOLUTION:
            middle = 0.5 * (low + high)
            energy, error = self.against_base(middle)
            low, high = (middle, high) if energy < ENERGY_LIMIT and error < most else (low, middle)
        return low * self.critical, self.against_base(BEYOND)[1]


FIELDS = ("kappa", "stiffness_ratio", "size_ratio", "automatic", "critical", "p_waves", "largest_stable", "error_beyond")


def measure(engine, spec):
    packing = Packing(engine, spec)
    stable, beyond = packing.largest_stable()
    return {"automatic": packing.automatic, "critical": packing.critical, "p_waves": packing.waves, "largest_stable": stable,
            "error_beyond": beyond}


def read(file):
    if not file.exists():
        return []
    with open(file, newline="") as stream:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(stream)]


def write(folder, rows):
    with open(folder / "table.csv", "w", newline="") as stream:
        writer = csv.DictWriter(stream, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    lines = ["| kappa | k_n/k_t | d_max/d_min | automatic [us] | largest stable [us] | automatic / largest stable | critical / largest stable | P waves / largest stable "
             "| stress off at 1.5 critical [%] |",
             "|---|---|---|---|---|---|---|---|---|"]
    for r in rows:
        s = r["largest_stable"]
        lines.append(f"| {r['kappa']:g} | {r['stiffness_ratio']:g} | {r['size_ratio']:g} | {1e6 * r['automatic']:.2f} | {1e6 * s:.2f} | "
                     f"{r['automatic'] / s:.2f} | {r['critical'] / s:.2f} | {r['p_waves'] / s:.2f} | "
                     f"{100 * r['error_beyond']:.1f} |")
    (folder / "table.md").write_text("\n".join(lines) + "\n")


def draw(folder, rows):
    figure, axes = plt.subplots(1, len(SIZE_RATIOS), figsize=(9, 3), sharey=True)
    for one, ratio in zip(axes, SIZE_RATIOS):
        for k, (kappa, marker) in enumerate(zip(KAPPAS, "osd")):
            chosen = [r for r in rows if r["size_ratio"] == ratio and r["kappa"] == kappa]
            x = [r["stiffness_ratio"] for r in chosen]
            for key, style in (("automatic", "-"), ("p_waves", ":")):
                y = [r[key] / r["largest_stable"] for r in chosen]
                one.semilogx(x, y, marker + style, color=f"C{k}", markersize=4, linewidth=0.8,
                             label=f"kappa {kappa:g}" if key == "automatic" else None)
        one.axhline(1, color="k", linewidth=0.8)
        one.axhline(0.7, color="k", linewidth=0.6, linestyle="--")
        one.set_title(f"d_max/d_min = {ratio:g}", fontsize=8)
        one.set_xlabel("k_n/k_t", fontsize=8)
        one.set_xticks(STIFFNESS_RATIOS, [f"{x:g}" for x in STIFFNESS_RATIOS], minor=False)
        one.set_xticks([], minor=True)
        one.grid(alpha=0.3)
        one.tick_params(labelsize=7)
    axes[0].set_ylabel("time step / largest stable one", fontsize=8)
    axes[0].legend(fontsize=7)
    figure.suptitle("lines: automatic; dotted: YADE's PWaveTimeStep; above 1: silent garbage", fontsize=8)
    figure.tight_layout()
    figure.savefig(folder / "time_step.png", dpi=90)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/time_step"))
    parser.add_argument("--spheres", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    a = parser.parse_args()
    a.out.mkdir(parents=True, exist_ok=True)
    engine, rows = Engine(("unbalanced_force",)), read(a.out / "table.csv")
    done = {(r["kappa"], r["stiffness_ratio"], r["size_ratio"]) for r in rows}
    for kappa, stiffness, size in itertools.product(KAPPAS, STIFFNESS_RATIOS, SIZE_RATIOS):
        if (kappa, stiffness, size) in done:
            continue
        spec = {"kappa": kappa, "stiffness_ratio": stiffness, "size_ratio": size}
        rows.append({**spec, **measure(engine, {**spec, "spheres": a.spheres, "seed": a.seed, "contact_law": "friction"})})
        r = rows[-1]
        print(kappa, stiffness, size, f"automatic/largest stable {r['automatic'] / r['largest_stable']:.3f}", flush=True)
        write(a.out, rows)
    draw(a.out, rows)
    print((a.out / "table.md").read_text())


if __name__ == "__main__":
    main()
