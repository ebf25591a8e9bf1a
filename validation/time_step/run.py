#!/usr/bin/python3
"""The automatic time step over the largest stable one, for stiffness, stiffness ratio and size ratio.

    validation/time_step/run.py [--spheres N] [--seed S] [--list] [--record] [--runs FOLDER]

At rest: the prepared packing is left alone, its grains stopped, for 800 steps. A step is unstable if the kinetic energy, which
comes from what the forces are off balance, ever grows by 100 from its least; the largest stable step is the last one before
the first unstable one, by 2 % of the critical step. Along a path: each packing is strained along a biaxial path by 2 %
(stiff ones by 10/kappa) with many time steps; the largest stable one is found by bisection. A step is unstable where the
mean kinetic energy of the path's second half exceeds 1.5 times that at 3/4 of the critical step, or the stresses are off by more than 1 % and more than 3 times what half and 3/4 of the critical
step differ by (where contacts slide, the energy alone does not tell). The automatic step must be stable at rest before and after the path:
exit status 1 otherwise. In the table also what the stress is off with the automatic step and at 1.5 times the critical one.
"""

import csv
import functools
import itertools
import os
import sys
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

sys.path[:0] = [str(campaign.ROOT / "yade_scripts"), str(campaign.ROOT / "tests" / "yade")]
import contact_loop
import unit_of_time
from cells import packing
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
AT_REST = np.arange(0.7, 1.5, 0.02)  # of the critical step
BATCH, BATCHES, GROWTH = 20, 40, 100.0


class Packing:
    """One packing and its answers at multiples of the critical time step."""

    def __init__(self, engine, spec):
        from yade.utils import PWaveTimeStep

        self.engine, made = engine, engine.make_template(spec)
        self.state = made["state"]
        self.strain, number = path_of(spec["kappa"])
        self.rate = number / made["manifest"]["time_scale"]
        ve = self._at_forces()
        seconds = unit_of_time.of(engine.O).seconds
        self.automatic = seconds(engine.O.dt)
        self.critical = seconds(critical_time_step(engine.O, contact_loop.contacts(engine.O)))
        self.waves = seconds(PWaveTimeStep())
        engine.remove(ve)

    def _at_forces(self, factor=None):
        """A new volume element, YADE's current scene, with its own time step or `factor` times the critical one."""
        ve = self.engine.add(self.state)
        self.engine.info(ve)  # makes it YADE's current one
        if factor:
            self.engine.O.dt *= factor * self.critical / self.automatic
        return ve

    def answers(self, factor):
        """Mean kinetic energy [J] of the second half and stresses (windows, 9) [Pa] along the path."""
        ve = self._at_forces(factor)
        answers = self._along_the_path(ve)
        self.engine.remove(ve)
        return answers

    def _along_the_path(self, ve):
        from yade._utils import kineticEnergy

        dt = self.engine.info(ve)["time_step"]
        each = int(np.ceil(max(self.strain / (self.rate * dt), LEAST_STEPS) / WINDOWS))
        L = DIRECTION * self.strain / (each * WINDOWS * dt)
        stress, report, stretch = np.empty(9), np.empty(len(self.engine.report_fields)), np.empty(9)
        energies, stresses = [], []
        for _ in range(WINDOWS):
            self.engine.deform(ve, L, each)
            self.engine.measure(ve, stress, report, stretch)
            energies.append(kineticEnergy())
            stresses.append(stress.copy())
        return np.mean(energies[WINDOWS // 2:]), np.array(stresses)

    def _rests(self, ve):
        """Whether the grains of the current scene, stopped, come to rest."""
        from yade._utils import kineticEnergy

        O, nothing = self.engine.O, np.zeros((3, 3))
        self._stop()
        O.dt /= 2
        self.engine.deform(ve, nothing, 5 * BATCH)  # grains that had just met are pushed off: stopped again, they stay
        O.dt *= 2
        self._stop()
        least = np.inf
        for _ in range(BATCHES):
            self.engine.deform(ve, nothing, BATCH)
            if kineticEnergy() > GROWTH * least:
                return False
            least = min(least, kineticEnergy())
        return True

    def _stop(self):
        for b in self.engine.O.bodies:
            b.state.vel = b.state.angVel = (0, 0, 0)

    def _stable_at_rest(self, factor):
        ve = self._at_forces(factor)
        stable = self._rests(ve)
        self.engine.remove(ve)
        return stable

    def largest_stable_at_rest(self):
        """[s]"""
        below = list(itertools.takewhile(self._stable_at_rest, AT_REST))
        return below[-1] * self.critical if below else 0.0

    def against_base(self, factor):
        """Kinetic energy over that of the reference, relative distance of the stresses from it."""
        return self._compare(*self.answers(factor), f"{factor:.3f} critical")

    def automatic_along_the_path(self):
        """Relative distance of the stresses from the reference, and whether the step is stable at the end."""
        ve = self._at_forces()
        error = self._compare(*self._along_the_path(ve), "automatic")[1]
        stable = self._rests(ve)
        self.engine.remove(ve)
        return error, stable

    def _compare(self, energy, stress, name):
        error = np.linalg.norm(stress - self.reference[1]) / np.linalg.norm(self.reference[1])
        print(f"    {name}: energy x {energy / self.reference[0]:.2f}, stress off by {100 * error:.1f} %", flush=True)
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


FIELDS = ("kappa", "stiffness_ratio", "size_ratio", "automatic", "critical", "p_waves", "stable_at_rest", "largest_stable",
          "error", "stable_at_end", "error_beyond")


@functools.cache
def engine():
    return Engine(("unbalanced_force",))


def measure(changes):
    tried = Packing(engine(), packing(contact_law="friction", **changes))
    stable, beyond = tried.largest_stable()
    error, stable_at_end = tried.automatic_along_the_path()
    return {"automatic": tried.automatic, "critical": tried.critical, "p_waves": tried.waves,
            "stable_at_rest": tried.largest_stable_at_rest(), "largest_stable": stable, "error": error,
            "stable_at_end": float(stable_at_end), "error_beyond": beyond}


def write(c, rows):
    with open(c.product("table.csv"), "w", newline="") as stream:
        writer = csv.DictWriter(stream, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    lines = ["| kappa | k_n/k_t | d_max/d_min | automatic [us] | over the largest stable at rest | over the largest stable along the path "
             "| stress off [%] | at 1.5 critical [%] | P waves over the largest stable at rest |",
             "|---|---|---|---|---|---|---|---|---|"]
    for r in rows:
        rest, path = r["stable_at_rest"], r["largest_stable"]
        lines.append(f"| {r['kappa']:g} | {r['stiffness_ratio']:g} | {r['size_ratio']:g} | {1e6 * r['automatic']:.2f} | "
                     f"{r['automatic'] / rest:.3f} | {r['automatic'] / path:.2f} | "
                     f"{100 * r['error']:.2f} | {100 * r['error_beyond']:.1f} | {r['p_waves'] / rest:.2f} |")
    c.table(lines)


def draw(file, rows):
    figure, axes = plt.subplots(1, len(SIZE_RATIOS), figsize=(9, 3), sharey=True)
    for one, ratio in zip(axes, SIZE_RATIOS):
        for k, (kappa, marker) in enumerate(zip(KAPPAS, "osd")):
            chosen = [r for r in rows if r["size_ratio"] == ratio and r["kappa"] == kappa]
            x = [r["stiffness_ratio"] for r in chosen]
            for key, style in (("automatic", "-"), ("p_waves", ":")):
                y = [r[key] / r["stable_at_rest"] for r in chosen]
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
    axes[0].set_ylabel("time step / largest stable one at rest", fontsize=8)
    axes[0].legend(fontsize=7)
    figure.suptitle("lines: automatic; dotted: YADE's PWaveTimeStep; above 1: silent garbage", fontsize=8)
    figure.tight_layout()
    figure.savefig(file, dpi=90)


GRID = {f"{kappa:g}_{stiffness:g}_{size:g}": {"kappa": kappa, "stiffness_ratio": stiffness, "size_ratio": size}
        for kappa, stiffness, size in itertools.product(KAPPAS, STIFFNESS_RATIOS, SIZE_RATIOS)}


def follow(c, spheres, seed):
    rows = []
    for name, changes in GRID.items():
        asked = {**changes, "spheres": spheres, "seed": seed}
        rows.append({**changes, **c.value(name, asked, lambda: measure(asked))})
        r = rows[-1]
        print(name, f"automatic/largest stable {r['automatic'] / r['stable_at_rest']:.3f} at rest, "
              f"{r['automatic'] / r['largest_stable']:.3f} along the path, stable at its end: {bool(r['stable_at_end'])}", flush=True)
        write(c, rows)
    draw(c.product("time_step.png"), rows)
    return int(not all(r["stable_at_end"] and r["automatic"] < r["stable_at_rest"] for r in rows))


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--spheres", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    a = parser.parse_args()
    return campaign.main(HERE, a, {name: "kappa, k_n/k_t, d_max/d_min" for name in GRID}, lambda c: follow(c, a.spheres, a.seed))


if __name__ == "__main__":
    sys.exit(main())
