#!/usr/bin/python3
"""The compact cell beside YADE in charts: cost of a step and of a trial, memory, threads, what of a run is not the engine, how
far paths come apart, simple shear through flips.

    validation/engine/run.py [ROW ...] [--list] [--record] [--runs FOLDER]

Figures and table after every row. Times are of the processor but for the rows of threads, which want an idle machine.
"""

import json
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

from cost import STEPS

SPHERES = (100, 200, 400, 1000, 2000, 4000)
SHEARS = {"adhesive": (), "friction": ('ve.contact_law="friction"', "ve.cohesion=0")}
IN_YADE = ('ve.engine="yade"', "ve.sorted_contacts=true")
ROWS = {f"cost_{n}": f"a step and trials of {n} adhesive spheres" for n in SPHERES}
ROWS |= {"deviation": "400 adhesive spheres along one path"}
ROWS |= {f"threads_{n}": f"../biaxial/128.toml, 10 steps, {n} thread{'s' * (n > 1)}, no trials repeated in YADE" for n in (1, 2)}
ROWS |= {f"shear_{law}": f"simple shear to F_12 = 3 in both engines, {law}" for law in SHEARS}
DRIVEN = [f"{kind}_{k}" for kind in ("strain", "stress") for k in ("xx", "yy", "zz", "xy", "yz", "zx")]


def script(c, name, *words):
    """The numbers that a script of this folder writes."""
    file = c.runs / name / "numbers.json"
    command = ["/usr/bin/python3", HERE / words[0], *words[1:], "--modules", c.program.parent, "--json", file]
    run = c.once(name, {"words": list(words)},
                 lambda said: subprocess.run(command, stdout=said, stderr=said, env=campaign.ENVIRONMENT).returncode)
    if run.status != 0:
        raise campaign.CampaignError(f"{run.folder}: {run.last_words()}")
    return json.loads(file.read_text())


def costs(c, name):
    return script(c, name, "cost.py", "--spheres", name.split("_")[1])


def best(found):
    """Name of the fastest kernel."""
    return min(set(found["step_us"]) - {"before", "YADE"}, key=lambda kernel: found["step_us"][kernel][1])


def threads(c, name):
    """{what: number} of a short run on a mesh."""
    settings = ("control.end_time=0.2", "output.every=1000", f"ve.threads={name.split('_')[1]}", "ve.check_every=1000000", c.cache)
    run = c.run("../biaxial/128.toml", name, *settings)
    if run.status != 0:
        raise campaign.CampaignError(f"{run.folder}: {run.last_words()}")
    summary = json.loads((run.folder / "summary.json").read_text())
    keys = ("wall_seconds", "evaluate_seconds", "engine_seconds")
    return {**{key: summary[key] for key in keys}, "processor_seconds": run.processor_seconds}


def shear(c, name):
    """Increments, largest shear and whether both engines have the same curve."""
    settings = (*SHEARS[name.split("_")[1]], c.cache)
    curves = []
    for engine, more in {"compact": ('ve.engine="compact"',), "yade": IN_YADE}.items():
        run = c.path("simple_shear.toml", f"{name}_{engine}", *settings, *more)
        if run.status != 0:
            raise campaign.CampaignError(f"{run.folder}: {run.last_words()}")
        curves.append(run.history())
    compact, yade = curves
    equal = all(np.array_equal(compact[column], yade[column]) for column in DRIVEN)
    return {"steps": len(compact["F_12"]) - 1, "F_12": float(compact["F_12"][-1]), "equal": equal}


def draw_costs(c, found):
    """Steps and trials over the number of spheres."""
    n = [f["spheres"] for f in found]
    fig, axes = plt.subplots(1, 1 + len(STEPS), figsize=(13, 3.4), sharex=True, constrained_layout=True)
    names = {"before": "YADE before", "YADE": "YADE with its gains", "compact": "compact"}
    for name, label in names.items():
        of = [name if name != "compact" else best(f) for f in found]
        axes[0].loglog(n, [f["step_us"][k][1] for f, k in zip(found, of)], "o-", label=label)
        for axis, steps in zip(axes[1:], STEPS):
            axis.loglog(n, [f["trial_ms"][k][str(steps)][1] for f, k in zip(found, of)], "o-")
            axis.set_title(f"trial of {steps} steps [ms]")
    axes[0].set_title("step [us]")
    axes[0].legend(frameon=False)
    for axis in axes:
        axis.set_xlabel("spheres")
        axis.set_xticks(n, map(str, n))
        axis.set_xticks([], minor=True)
        axis.grid(alpha=0.3, which="both")
    fig.savefig(c.product("cost.png"), dpi=80)
    plt.close(fig)


def draw_deviation(c, found):
    fig, axis = plt.subplots(figsize=(6, 3.4), constrained_layout=True)
    for name, differences in found["difference"].items():
        label = "compact, YADE in the same order (0)" if name == "compact" and not any(differences) else name
        axis.loglog(found["steps"], np.maximum(differences, 1e-18), "o-", label=label)
    axis.set_xlabel("DEM steps")
    axis.set_ylabel("stress, relative difference from YADE")
    axis.legend(frameon=False)
    axis.grid(alpha=0.3)
    fig.savefig(c.product("deviation.png"), dpi=80)
    plt.close(fig)


def cost_lines(found):
    yield "| spheres | a step [us]: YADE before / with its gains / compact | trial [ms], n = " + " | n = ".join(map(str, STEPS)) \
        + " | committed [MB]: YADE / compact | a trial beside it [MB]: YADE / compact |"
    yield "|---" * (4 + len(STEPS)) + "|"
    for f in found:
        names = ("before", "YADE", best(f))
        slash = lambda values, digits: " / ".join(f"{v:.{digits}f}" for v in values)
        steps = slash((f["step_us"][k][1] for k in names), 0)
        trials = [slash((f["trial_ms"][k][str(n)][1] for k in names), 2) for n in STEPS]
        m = f["memory_mb"]
        memory = slash((m["YADE"], m["compact"]), 2), slash((m["a trial of YADE"], m["compact"]), 2)
        yield "| " + " | ".join((str(f["spheres"]), steps, *trials, *memory)) + " |"


def run_lines(of_threads):
    for name, r in of_threads.items():
        share = r["engine_seconds"] / r["processor_seconds"]
        yield f"* {ROWS[name]}: {r['wall_seconds']:.1f} s, {r['evaluate_seconds']:.1f} of them in trials; of {r['processor_seconds']:.1f} s " \
              f"of the processor, packings included, {share:.2f} are the engine's"
    if len(of_threads) == 2:
        one, two = of_threads.values()
        ratio = lambda key: f"{one[key] / two[key]:.2f}"
        yield f"* two threads against one: {ratio('evaluate_seconds')} in trials, {ratio('wall_seconds')} of the run"


def work(c, rows):
    found, of_threads, lines = [], {}, []
    for name in rows:
        if name.startswith("cost"):
            found.append(costs(c, name))
            draw_costs(c, found)
        elif name == "deviation":
            deviation = script(c, name, "deviation.py")
            draw_deviation(c, deviation)
            at = dict(zip(deviation["steps"], zip(*deviation["difference"].values())))
            for steps in (1, 10, 100, 1000):
                parts = [f"{what} {size:.0e}" for what, size in zip(deviation["difference"], at[steps])]
                lines.append(f"* stress after {steps} steps, from YADE in the compact cell's order: " + ", ".join(parts))
        elif name.startswith("threads"):
            of_threads[name] = threads(c, name)
        else:
            s = shear(c, name)
            same = "equal to the bit" if s["equal"] else "NOT EQUAL"
            lines.append(f"* {ROWS[name]}: {s['steps']} increments to F_12 = {s['F_12']:.2f}, stresses and strains of the engines {same}")
        c.table([*cost_lines(found), "", *lines, *run_lines(of_threads)] if found else [*lines, *run_lines(of_threads)])


if __name__ == "__main__":
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    sys.exit(campaign.main(HERE, arguments, ROWS, lambda c: work(c, arguments.rows or ROWS)))
