#!/usr/bin/python3
"""What a step and a trial cost: YADE as it is and the compact cell's kernels, interleaved, processor time.

    cost.py [--spheres 1000] [--law adhesive] [--inertial-number 2e-2] [--modules BUILD] [--state FILE]

A step: microseconds, least and median of blocks of ten. A trial of the compact cell: copy of the committed block, n
steps, stress; least and median [ms]. YADE's own n steps stand beside it, without the fork that a trial in YADE needs as well.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
LAWS = {
    "adhesive": {"cohesion": 1.0},
    "bonded": {"cohesion": 1.0, "contact_law": "bonded"},
    "friction": {"contact_law": "friction"},
}
STEPS = (3, 10, 30)
BLOCK, BLOCKS, WARM, TRIALS = 10, 40, 100, 40
BIAXIAL = np.array([[0.6, 0.1, 0.0], [0.1, -1.0, 0.05], [0.0, 0.05, 0.0]])


def spent(action):
    """Processor time of this thread [s]."""
    start = time.thread_time()
    action()
    return time.thread_time() - start


def costs(engine, ve, start, L):
    """{engine: times of a block of steps [s]}, all from the same state along the same path."""
    import compact_cell

    cells = {k: compact_cell.CompactCell.from_scene(start) for k in compact_cell.kernels()}
    times = {name: [] for name in ("YADE", *cells)}
    for _ in range(BLOCKS):
        times["YADE"].append(spent(lambda: engine.deform(ve, L, BLOCK)))
        for kernel, cell in cells.items():
            compact_cell.use_kernel(kernel)
            times[kernel].append(spent(lambda: cell.deform(L, BLOCK)))
    return times


def trials(start, L, kernel):
    """{n: times of a trial [s]} from a state after WARM steps."""
    import compact_cell

    compact_cell.use_kernel(kernel)
    committed = compact_cell.CompactCell.from_scene(start)
    committed.deform(L, WARM)
    trial = committed.copy()

    def run(n):
        trial.assign(committed)
        trial.deform(L, n)
        trial.stress()

    return {n: [spent(lambda: run(n)) for _ in range(TRIALS)] for n in STEPS}


def line(name, times, steps):
    columns = [f"{1e6 * t / BLOCK:8.1f}" for t in (min(times), float(np.median(times)))]
    columns += [f"{1e3 * min(steps[n]):7.3f} / {1e3 * float(np.median(steps[n])):7.3f}" for n in STEPS]
    return f"{name:12}" + "  ".join(columns)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spheres", type=int, default=1000)
    parser.add_argument("--law", choices=LAWS, default="adhesive")
    parser.add_argument("--inertial-number", type=float, default=2e-2)
    parser.add_argument("--modules", type=Path, default=ROOT / "build/release", help="folder of the compiled modules")
    parser.add_argument("--state", type=Path, help="a prepared state of `femxdem ve prepare` instead of a new packing")
    arguments = parser.parse_args()
    sys.path[:0] = [str(ROOT / "yade_scripts"), str(ROOT / "tests" / "yade"), str(arguments.modules)]
    import compact_cell
    import compact_scene
    from cells import packing
    from volume_element import Engine

    engine = Engine([])
    spec = packing(spheres=arguments.spheres, **LAWS[arguments.law])
    ve = engine.add(arguments.state.read_bytes() if arguments.state else engine.make_template(spec)["state"])
    L = BIAXIAL * arguments.inertial_number / engine.info(ve)["time_scale"] / np.linalg.norm(BIAXIAL)
    exporting = time.thread_time()
    start = compact_scene.export(engine.O)
    exporting = time.thread_time() - exporting
    committed = compact_cell.CompactCell.from_scene(start)
    times = costs(engine, ve, start, L)
    print(f"{len(committed)} spheres, {committed.report()['contacts']:.0f} contacts, {arguments.law}, I = {arguments.inertial_number:g}")
    print("            a step [us]: min, median; n steps [ms], min / median, n = " + ", ".join(map(str, STEPS)))
    print(line("YADE", times["YADE"], {n: np.array(times["YADE"]) * n / BLOCK for n in STEPS}))
    for kernel in compact_cell.kernels():
        print(line(kernel.name, times[kernel], trials(start, L, kernel)))
    best = times[compact_cell.kernels()[-1]]
    ratios = [f(times["YADE"]) / f(best) for f in (min, np.median)]
    print("YADE over compact: {:.1f} (min), {:.1f} (median)".format(*ratios))
    trial = committed.copy()
    for name, action in (
        ("copy", lambda: trial.assign(committed)),
        ("stress", committed.stress),
        ("report", committed.report),
        ("save", committed.save),
        ("Eq. (2)", lambda: committed.stiffness(False)),
        ("relaxed stiffness", lambda: committed.stiffness(True)),
    ):
        print(f"{name}: {1e6 * min(spent(action) for _ in range(9)):.0f} us")
    print(f"block {committed.memory / 1e6:.3f} MB; export from YADE {exporting:.3f} s")


if __name__ == "__main__":
    main()
