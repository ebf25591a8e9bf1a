#!/usr/bin/python3
"""What a hold at the end of every trial does to a volume element: why there is no such option.

    validation/solver/hold.py [--spheres N] [--inertial-number I] [--holds H ...] [--list] [--record]

An adhesive packing is strained in increments of 1e-3 in plane strain (axial -1, lateral 0.6), each followed by H DEM steps at
rest. From the states at 0.8, 1.4 and 3 % increments of other sizes are tried, back and forth, in forked processes: secant
modulus of the axial stress over sigma_0. Noise: rest of a straight line through the stresses of five increments that
differ by 2e-7, over the stress. One minute of one core.
"""

import functools
import math
import os
import sys
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import numpy as np

sys.path[:0] = [str(campaign.ROOT / "yade_scripts"), str(campaign.ROOT / "tests" / "yade")]
DIRECTION = np.diag([0.6, -1.0, 0.0])
INCREMENT = 1e-3
STATES = (8, 14, 30)  # increments
SIZES = (-1e-3, -3e-4, -1e-4, 1e-4, 3e-4, 1e-3)
CONFINING_STRESS = 1e5  # [Pa]
HEADER = ["| hold | axial strain | stress | noise |" + "".join(f" {s:g} |" for s in SIZES), "|---|---|---|---|" + "---|" * len(SIZES)]


class Element:
    """A volume element under increments of DIRECTION, each with a hold of `hold` DEM steps at its end."""

    def __init__(self, engine, state, inertial_number, hold):
        self.engine, self.ve, self.hold = engine, engine.add(state), hold
        info = engine.info(self.ve)
        self.time_step, self.rate = info["time_step"], inertial_number / info["time_scale"]

    def strain(self, size):
        n = max(10, math.ceil(abs(size) * np.linalg.norm(DIRECTION) / (self.rate * self.time_step)))
        self.engine.deform(self.ve, DIRECTION * size / (n * self.time_step), n)
        if self.hold:
            self.engine.deform(self.ve, np.zeros((3, 3)), self.hold)

    def axial(self):
        """Axial stress over sigma_0, compression positive."""
        stress, report, stretch = np.zeros(9), np.zeros(1), np.zeros(9)
        self.engine.measure(self.ve, stress, report, stretch)
        return -stress[4] / CONFINING_STRESS

    def tried(self, size):
        """Axial stress after an increment in a forked process: this one stays where it is."""
        reader, writer = os.pipe()
        child = os.fork()
        if child == 0:
            self.strain(size)
            os.write(writer, np.float64(self.axial()).tobytes())
            os._exit(0)
        os.close(writer)
        with os.fdopen(reader, "rb") as answer:
            stress = np.frombuffer(answer.read())[0]
        os.waitpid(child, 0)
        return stress

    def noise(self):
        x = np.arange(5.0)
        y = np.array([self.tried(INCREMENT + 2e-7 * k) for k in x])
        return np.abs(y - np.polyval(np.polyfit(x, y, 1), x)).max() / abs(y.mean())


@functools.cache
def packing(build, spheres):
    """YADE's engine and the state of the packing."""
    sys.path.insert(0, str(build))
    from cells import packing as specification
    from volume_element import Engine

    engine = Engine(["dem_steps"])
    spec = specification(spheres=spheres, cohesion=1.0, compaction_friction=0.1, confining_stress=CONFINING_STRESS)
    return engine, engine.make_template(spec)["state"]


def rows(build, spheres, inertial_number, hold):
    """Markdown rows of one hold."""
    element, lines = Element(*packing(build, spheres), inertial_number, hold), []
    for k in range(max(STATES) + 1):
        if k in STATES:
            now = element.axial()
            moduli = "".join(f" {(element.tried(s) - now) / s:.0f} |" for s in SIZES)
            lines.append(f"| {hold} | {100 * k * INCREMENT:.1f} % | {now:.3f} | {element.noise():.1e} |{moduli}")
        element.strain(INCREMENT)
    return lines


def follow(c, a):
    lines = list(HEADER)
    for hold in a.holds:
        asked = {"spheres": a.spheres, "inertial_number": a.inertial_number, "hold": hold}
        lines += c.value(f"hold/{hold}", asked, lambda: rows(c.program.parent, **asked))
        print(*lines[-len(STATES):], sep="\n", flush=True)
        c.table(lines, page="noise.md", mark="results of hold.py")


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--spheres", type=int, default=200)
    parser.add_argument("--inertial-number", type=float, default=1e-2)
    parser.add_argument("--holds", type=int, nargs="+", default=[0, 20, 100, 400])
    a = parser.parse_args()
    return campaign.main(HERE, a, {f"hold/{hold}": "" for hold in a.holds}, lambda c: follow(c, a))


if __name__ == "__main__":
    sys.exit(main())
