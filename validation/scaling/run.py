#!/usr/bin/python3
"""Ranks: how evenly they share the volume elements of a localised run, measured and predicted, and what rank 0 does alone.

    validation/scaling/run.py [--list] [--record] [--runs FOLDER]

runs        a biaxial test of 512 volume elements of 200 spheres to 6 % on 1, 2 and 4 ranks: equal bits, efficiency by counted
            cost and by the clock; the costs of its points are recorded (costs.npz)
master      what rank 0 does alone in an iteration, on a law in closed form, 8 x 16 to 64 x 128 elements
simulator   schedule.hpp on the recorded costs, on those of a mesh of 20 480 points, and on synthetic ones of 1e5 points
"""

import json
import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np
from results import read_history, read_step

CASE, LAW = "../biaxial/128.toml", "../solver/biaxial_law.toml"
WINDOW = 5  # steps between checkpoints
LOCALISED = 30  # step (3 % of strain) from which on costs are compared
RUNS = (1, 2, 4)  # ranks
MESHES = (8, 16, 32, 64)  # elements along the width; twice as many along the height
LAW_END = 0.36  # s: 1.8 % of strain, past the peak
FEW_RANKS = (2, 4, 8, 16, 32, 64, 128)  # of one thread, of the recorded run
RANKS = (1, 2, 4, 16, 64, 256, 1024)  # of 20 480 points
THREADS = (4, 8, 16)  # of fewer ranks, which use as many processors
MANY_RANKS = (10, 100, 1000, 10_000)
FINER = 40  # points for each point of the recorded run: 20 480
NOISE = 0.1  # of a point's cost from step to step, where points are divided or made up
MESSAGE, BYTES, BANDWIDTH = 20e-6, 360, 1e9  # a rank's order and answer [s], of a point [byte], [byte/s]: assumed
SLOWER = 20.0  # a DEM step in YADE over one of a compact cell (validation/engine)


def run_all(c):
    """{ranks: Run}, equal to the bit."""
    settings = [c.cache, "ve.spheres=200", "ve.threads=1", "ve.balance=true", "control.end_time=1.2", "output.every=1"]
    runs = {}
    for ranks in RUNS:
        c.ranks = ranks
        runs[ranks] = c.run(CASE, f"ranks {ranks}", *settings, checkpoint_every=WINDOW)
        if runs[ranks].status != 0:
            raise campaign.CampaignError(f"{runs[ranks].folder}: {runs[ranks].last_words()}")
    first = bits(runs[1])
    for run in runs.values():
        if bits(run) != first:
            raise campaign.CampaignError(f"{run.folder}: history.csv differs from that of one rank")
    return runs


def bits(run):
    return {k: v.tolist() for k, v in read_history(run.folder).items() if k not in ("dem_seconds", "wall_s")}


def recorded(run):
    """Counted cost (steps, points) of a trial, trials of each step, seconds for a unit of cost, of a DEM step."""
    fields = [read_step(run.folder, step).fields for step in range(1, run.steps() + 1)]
    steps, contacts, seconds = ([f[name].ravel() for f in fields] for name in ("dem_steps", "contacts", "seconds"))
    costs = np.array(steps) * np.array(contacts)
    return costs, read_history(run.folder)["evaluations"].astype(int), np.sum(seconds) / costs.sum(), np.mean(contacts)


def measured(run):
    """After localisation, of the log's balances: efficiency by counted cost, by the clock, share of the evaluations' wall time
    that is trials; and points moved in all."""
    found = re.findall(r"balance of the ranks .*: ([\d.]+) of ideal by counted cost, ([\d.]+) by the clock, ([\d.]+) .*; (\d+)",
                       (run.folder / "log.txt").read_text())
    values = np.array(found, dtype=float)
    return *values[LOCALISED // WINDOW:, :3].mean(axis=0), int(values[:, 3].sum())


def schedule(c, costs, trials, ranks, step_cost, threads=1, window=WINDOW):
    """What femxdem-schedule says of costs (steps, points), each step weighted by its trials."""
    file = c.runs / "costs.f64"
    (costs * trials[:, None]).astype(np.float64).tofile(file)
    program = c.program.with_name("femxdem-schedule")
    words = [program, file, costs.shape[1], ranks, threads, window, step_cost]
    answer = json.loads(subprocess.run([str(w) for w in words], check=True, capture_output=True, text=True).stdout)
    file.unlink()
    total = (costs * trials[:, None]).sum(axis=1)
    late = slice(LOCALISED if len(costs) > LOCALISED else window, None)
    for policy in answer.values():
        busiest = np.array(policy["busiest"])
        policy["late"] = float(total[late].sum() / (ranks * threads * busiest[late].sum()))
        policy["critical"] = float(busiest[late].sum())
    return answer


def master(c):
    """{points: processor time of an iteration, all of the run's included}."""
    c.ranks, seconds = 1, {}
    for nx in MESHES:
        settings = [f"mesh.nx={nx}", f"mesh.ny={2 * nx}", "control.step=0.04", "control.max_step=0.04", f"control.end_time={LAW_END}"]
        run = c.run(LAW, f"master {nx}", *settings)
        seconds[8 * nx * nx] = run.processor_seconds / run.evaluations()
    return seconds


def fit(seconds):
    """a, p of seconds = a points^p, the two largest meshes."""
    (n0, t0), (n1, t1) = sorted(seconds.items())[-2:]
    p = np.log(t1 / t0) / np.log(n1 / n0)
    return t1 / n1**p, p


def finer(costs, seed=1):
    """Each point divided into FINER, whose costs vary independently from step to step."""
    noise = np.random.default_rng(seed).lognormal(0, NOISE, (len(costs), costs.shape[1] * FINER))
    return np.round(np.repeat(costs, FINER, axis=1) * noise)


def synthetic(points=100_000, steps=20, seed=2):
    """A tenth of the points, side by side, costs six times the rest; every step the band moves by a hundredth of itself."""
    rng = np.random.default_rng(seed)
    own = rng.lognormal(0, 0.3, points)
    band = points // 10
    rows = []
    for step in range(steps):
        row = own * rng.lognormal(0, NOISE, points)
        start = points // 3 + step * band // 100
        row[start:start + band] *= 6
        rows.append(np.round(1e5 * row))
    return np.array(rows), np.ones(steps, int)


def total_efficiency(work, critical, trials, points, ranks, unit, law):
    """Of ranks x time, what is work on points: the rest waits, for the busiest rank, for rank 0, for messages."""
    a, p = law
    alone = trials * (a * points**p + ranks * MESSAGE + points * BYTES / BANDWIDTH)
    return work * unit / (ranks * (critical * unit + alone))


def still_pays(work, trials, points, unit, law):
    """Ranks at which half of the time is work on points, balanced."""
    low, high = 1.0, 1e6
    while high / low > 1.01:
        middle = np.sqrt(low * high)
        good = total_efficiency(work, work / middle, trials, points, middle, unit, law) >= 0.5
        low, high = (middle, high) if good else (low, middle)
    return low


def figure(file, point_work, total):
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8))
    for name, rows in point_work.items():
        for policy, style in (("each_step", "o-"), ("static", "s--")):
            left.semilogx(list(rows), [row[policy]["late"] for row in rows.values()], style, label=f"{name}, {policy}")
    left.set(xlabel="ranks", ylabel="efficiency of the point work", ylim=(0, 1.05))
    for name, rows in total.items():
        right.semilogx(list(rows), list(rows.values()), "o-", label=name)
    right.set(xlabel="ranks", ylabel="total efficiency, 20 480 points", ylim=(0, 1.05))
    for axis in (left, right):
        axis.legend(fontsize=8)
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(file, dpi=90)


def work(c):
    seconds = master(c)
    runs = run_all(c)
    costs, trials, unit, contacts = recorded(runs[1])
    np.savez_compressed(c.product("costs.npz"), costs=costs.astype(np.uint32), trials=trials)
    late = costs[LOCALISED:]
    table = [f"After localisation the busiest point costs {(late.max(axis=1) / late.mean(axis=1)).mean():.1f} times the mean.", "",
             "| ranks | counted cost: measured | predicted | by the clock | share of the evaluations' wall time | points moved |",
             "|---|---|---|---|---|---|"]
    for ranks in RUNS[1:]:
        count, clock, share, moved = measured(runs[ranks])
        predicted = schedule(c, costs, trials, ranks, contacts)["each_step"]
        table.append(f"| {ranks} | {count:.3f} | {predicted['late']:.3f} | {clock:.3f} | {share:.3f} | {moved} |")

    law = fit(seconds)
    table += ["", "| points | rank 0 alone, s an iteration |", "|---|---|"]
    table += [f"| {n} | {t:.3f} |" for n, t in sorted(seconds.items())]
    table += [f"\nFit of the two largest: {law[0]:.2e} points^{law[1]:.2f} s."]

    fine = finer(costs)
    point_work = {"512 points": {r: schedule(c, costs, trials, r, contacts) for r in FEW_RANKS}}
    point_work["20 480 points"] = {r: schedule(c, fine, trials, r, contacts) for r in RANKS}
    made, ones = synthetic()
    point_work["1e5 points, synthetic"] = {r: schedule(c, made, ones, r, 1e4) for r in MANY_RANKS}
    rows = [(name, f"{r}", row) for name, known in point_work.items() for r, row in known.items()]
    rows += [("20 480 points", f"{RANKS[-1] // t} of {t} threads", schedule(c, fine, trials, RANKS[-1] // t, contacts, t))
             for t in THREADS]
    table += ["", "| points | ranks | static | at checkpoints | each step | moving free | moves a step |", "|---|---|---|---|---|---|---|"]
    table += [f"| {name} | {ranks} | {row['static']['late']:.3f} | {row['balanced']['late']:.3f} | {row['each_step']['late']:.3f} | "
              f"{row['foreseen']['late']:.3f} | {row['each_step']['moved'] / len(row['each_step']['busiest']):.1f} |" for name, ranks, row in rows]

    engines = {"compact, 200 spheres": unit, "compact, 1000 spheres": 5 * unit, "YADE, 1000 spheres": 5 * SLOWER * unit}
    done, count = float((fine[LOCALISED:] * trials[LOCALISED:, None]).sum()), int(trials[LOCALISED:].sum())
    total = {}
    table += ["", "| 20 480 points | " + " | ".join(map(str, RANKS)) + " | still pays |", "|---" * (len(RANKS) + 2) + "|"]
    for name, one in engines.items():
        total[name] = {r: total_efficiency(done, row["each_step"]["critical"], count, fine.shape[1], r, one, law)
                       for r, row in point_work["20 480 points"].items()}
        pays = still_pays(done, count, fine.shape[1], one, law)
        table.append(f"| {name} | " + " | ".join(f"{e:.2f}" for e in total[name].values()) + f" | {pays:.0f} |")
    figure(c.product("efficiency.png"), point_work, total)
    c.table(table)
    print("\n".join(table))


ROWS = {"runs": "512 volume elements on 1, 2 and 4 ranks", "master": "what rank 0 does alone", "simulator": "many ranks"}

if __name__ == "__main__":
    sys.exit(campaign.main(HERE, campaign.parser(HERE, __doc__).parse_args(), ROWS, work, on_meshes=True))
