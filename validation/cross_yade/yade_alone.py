#!/usr/bin/python3
"""A prepared packing strained by YADE alone: PeriTriaxController for the paths along the axes, the cell's velocity
gradient for simple shear. Nothing of femxdem takes part.

    yade_alone.py STATE PATH RATE CURVE.csv

STATE is a file of the cache of `femxdem ve prepare`, PATH a name of paths.py, RATE [1/s] that of its driven component. The
scene counts time in the unit that its tag names.
CURVE.csv: logarithmic strains (simple shear: xy is gamma) and Cauchy stresses [Pa], tension positive, every 5 steps.
"""

import csv
import math
import os
import sys

os.environ["OMP_NUM_THREADS"] = "1"
sys.path.insert(0, os.environ.get("FEMXDEM_YADE_DIR", "/usr/lib/x86_64-linux-gnu/yade-double/py"))
import yade
import yade._utils
import yade.utils
import yade.wrapper as y
from yade.minieigenHP import Matrix3

from paths import CONFINING_STRESS, PATHS

EVERY = 5
O = y.Omega()


def load(file):
    """The packing as it was saved, inside a step: forces are found again and that step is ended in no time."""
    with open(file, "rb") as stream:
        O.stringToScene(stream.read())
    O.forces.reset()
    time_step, O.dt = O.dt, 0.0
    O.step()
    O.dt = time_step


def row():
    F, s = O.cell.trsf, yade._utils.getStress()
    strains = [math.log(F[0, 0]), math.log(F[1, 1]), math.log(F[2, 2]), F[0, 1]]
    return strains + [s[0, 0], s[1, 1], s[2, 2], 0.5 * (s[0, 1] + s[1, 0])]


def driven(path):
    F = O.cell.trsf
    return F[0, 1] if path.name == "simple_shear" else math.log(F[1, 1])


def follow(path, rate):
    """Rows along the path's targets of its driven component. A new direction acts one step after it is given: where the path
    turns, it is given one step early, at a rate that comes to the target in whole steps."""
    rows = [row()]
    before = 0.0
    for target in path.targets:
        way, turns = target - before, target != path.targets[-1]
        speed = abs(way) / O.dt / math.ceil(abs(way) / (rate * O.dt)) if turns else rate
        if path.name == "simple_shear":
            O.cell.velGrad = Matrix3(0, math.copysign(speed, way), 0, 0, 0, 0, 0, 0, 0)
        else:
            controller(path, target + 0.5 * way, speed)
        left = 1.5 * speed * O.dt if turns else 0.0
        steps = 0
        while math.copysign(1.0, way) * (target - driven(path)) > left:
            O.step()
            steps += 1
            if steps == 1 or steps % EVERY == 0:
                rows.append(row())
        rows.append(row())
        before = target
    return rows


def controller(path, aim, rate):
    """PeriTriaxController: lateral stress kept where the path says so, strains driven at the rate towards `aim`, which lies
    beyond the target: it slows down before what it aims at, and the stress relaxes."""
    mask = sum(1 << axis for axis in path.held)
    goal = [-CONFINING_STRESS if axis in path.held else aim * path.strains[axis] for axis in range(3)]
    speed = [5 * rate if axis in path.held else max(rate * abs(path.strains[axis]), 1e-9) for axis in range(3)]
    mass = 0.1 * sum(b.state.mass for b in O.bodies)  # of the cell's wall: a heavy one lags, without one (dynCell=False) stress is missed
    kept = [e for e in O.engines if not isinstance(e, y.PeriTriaxController)]
    triax = y.PeriTriaxController(
        goal=goal, stressMask=mask, maxStrainRate=speed, globUpdate=1, dynCell=True, mass=mass, maxUnbalanced=0, relStressTol=0
    )
    O.engines = kept[:-1] + [triax] + kept[-1:]


def main():
    state, name, rate, curve = sys.argv[1:]
    load(state)
    rows = follow(PATHS[name], float(rate) / float(O.tags["femxdem_units_of_time_in_a_second"]))
    with open(curve, "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["strain_xx", "strain_yy", "strain_zz", "shear", "stress_xx", "stress_yy", "stress_zz", "stress_xy"])
        writer.writerows(rows)


if __name__ == "__main__":
    main()
