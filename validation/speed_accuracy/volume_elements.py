"""Cost of a volume element against its error: spheres x inertial number x time-step safety.

The biaxial path of validation/ve_biaxial to 5 %; safeties below the largest only at the three highest rates. Two errors of
the axial stress, each a root mean square over the path over that of the stress and over the packings: `same packing`, from the
same packing at the slowest setting; `total`, from the reference, the mean over the packings of the most spheres at the slowest
setting. The reference's own error: what the next faster setting differs from it by (`same packing`), and the standard error
of its mean over the packings.
"""

import csv
import itertools

import matplotlib.pyplot as plt
import numpy as np

import campaign
from charts import front
from results import read_history
from ve_runs import biaxial, dem_steps, relative_distance, strain_until, stresses

SPHERES, PACKINGS, NUMBERS, SAFETIES = (100, 200, 400, 1000), (1, 2, 3), (2e-2, 1e-2, 5e-3, 2e-3, 1e-3), (0.8, 0.4)
STRAIN = 0.05
FINER_RATES = 3  # highest rates at which time steps below the largest are tried
GRID = np.linspace(0.0, STRAIN, 51)


def name_of(key):
    spheres, number, safety, seed = key
    return f"ve/{spheres}_{number:g}_{safety:g}_{seed}"


class Curves:
    """Curves and DEM steps of (spheres, inertial number, safety, seed)."""

    def __init__(self, c):
        self.c, self.curves, self.steps, self.seconds = c, {}, {}, {}

    def run(self, spheres, number, safety, seed):
        key = (spheres, number, safety, seed)
        settings = {"ve.spheres": spheres, "ve.inertial_number": number, "ve.time_step_safety": safety, "ve.seed": seed}
        folder, early = biaxial(self.c, name_of(key), {**settings, **strain_until(STRAIN)})
        if early:
            print(f"left out: {folder}: {early}", flush=True)
            return
        self.curves[key], self.steps[key] = stresses(folder, GRID), dem_steps(folder)
        history = read_history(folder)
        strained = history["dem_steps"] > 0
        self.seconds[key] = np.median(history["dem_seconds"][strained] / history["dem_steps"][strained])
        print(key, self.steps[key], f"peak {self.curves[key].max():.2f}", flush=True)

    def settings(self):
        return list(dict.fromkeys(key[:3] for key in self.curves))

    def reference(self):
        """Mean curve and the standard error of that mean, relative."""
        most, slowest, safety = self.slowest()
        curves = np.array([c for key, c in self.curves.items() if key[:3] == (most, slowest, safety)])
        mean = curves.mean(axis=0)
        spread = np.sqrt(np.mean([relative_distance(c, mean) ** 2 for c in curves]))
        return mean, spread / np.sqrt(max(len(curves) - 1, 1)) if len(curves) > 1 else float("nan")

    def slowest(self, spheres=None):
        spheres = spheres or max(key[0] for key in self.curves)
        number = min(key[1] for key in self.curves if key[0] == spheres)
        return spheres, number, min(key[2] for key in self.curves if key[:2] == (spheres, number))

    def errors(self, setting):
        """Same packing, total; root mean squares over the seeds."""
        mean, slowest = self.reference()[0], self.slowest(setting[0])
        mine = {key[3]: c for key, c in self.curves.items() if key[:3] == setting}
        same = [relative_distance(c, self.curves[slowest + (seed,)]) for seed, c in mine.items() if slowest + (seed,) in self.curves]
        total = [relative_distance(c, mean) for c in mine.values()]
        rms = lambda x: float(np.sqrt(np.mean(np.square(x)))) if x else float("nan")
        return rms(same), rms(total)

    def seconds_a_step(self, spheres):
        """Of one DEM step: the median over a path's trials, of the path in which it is least: other work on the machine moves that little."""
        return float(min(s for key, s in self.seconds.items() if key[0] == spheres))

    def mean_steps(self, setting):
        return float(np.mean([n for key, n in self.steps.items() if key[:3] == setting]))


def rows_of(curves):
    rows = []
    for setting in curves.settings():
        same, total = curves.errors(setting)
        steps = curves.mean_steps(setting)
        rows.append({"spheres": setting[0], "inertial_number": setting[1], "safety": setting[2], "dem_steps": steps,
                     "sphere_steps": steps * setting[0], "core_seconds": steps * curves.seconds_a_step(setting[0]),
                     "same_packing": same, "total": total})
    chosen = front(rows, "sphere_steps", "total")
    for r in rows:
        r["front"] = r in chosen
    return sorted(rows, key=lambda r: r["sphere_steps"])


def write(c, rows):
    with open(c.product("ve.csv"), "w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    lines = ["| spheres | inertial number | safety | DEM steps | sphere steps [1e6] | core seconds | same packing [%] | total [%] | non-dominated |",
             "|---|---|---|---|---|---|---|---|---|"]
    for r in rows:
        lines.append(f"| {r['spheres']} | {r['inertial_number']:g} | {r['safety']:g} | {r['dem_steps']:.0f} | "
                     f"{1e-6 * r['sphere_steps']:.2f} | {r['core_seconds']:.2f} | "
                     f"{100 * r['same_packing']:.1f} | {100 * r['total']:.1f} | {'yes' if r['front'] else ''} |")
    c.table(lines, mark="ve")
    print("\n".join(lines))


def draw(file, rows):
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.3))
    for one, error in zip(axes, ("same_packing", "total")):
        for k, spheres in enumerate(sorted({r["spheres"] for r in rows})):
            mine = [r for r in rows if r["spheres"] == spheres and r[error] > 0]
            one.loglog([r["sphere_steps"] for r in mine], [100 * r[error] for r in mine], "o", color=f"C{k}", markersize=4,
                       label=f"{spheres} spheres")
            for r in mine:
                one.annotate(f"{r['inertial_number']:g}", (r["sphere_steps"], 100 * r[error]), fontsize=5)
        one.set_xlabel("sphere steps of the path (spheres x DEM steps)")
        one.grid(alpha=0.3, which="both")
    best = [r for r in rows if r["front"]]
    axes[1].loglog([r["sphere_steps"] for r in best], [100 * r["total"] for r in best], "k-", linewidth=0.8, label="non-dominated")
    axes[0].set_ylabel("error [%], same packing at the slowest setting", fontsize=8)
    axes[1].set_ylabel("error [%], against the reference", fontsize=8)
    axes[1].legend(fontsize=6)
    figure.tight_layout()
    figure.savefig(file, dpi=90)


def keys():
    """(spheres, inertial number, safety, packing) of every run."""
    fast = sorted(NUMBERS)[-FINER_RATES:]
    for safety, spheres, seed, number in itertools.product(SAFETIES, SPHERES, PACKINGS, NUMBERS):
        if safety == max(SAFETIES) or number in fast:
            yield spheres, number, safety, seed


def write_chart(c):
    """Runs the chart; its table, numbers and figure."""
    curves = Curves(c)
    for key in keys():
        curves.run(*key)
    rows = rows_of(curves)
    write(c, rows)
    draw(c.product("ve.png"), rows)
    print(f"reference's own scatter of the mean: {100 * curves.reference()[1]:.1f} %; of a DEM step [us]: "
          f"{ {n: round(1e6 * curves.seconds_a_step(n), 1) for n in SPHERES} }")
