#!/usr/bin/python3
"""What a step and a trial cost, processor time, interleaved: YADE as it was, YADE as it is, the compact cell's kernels.

    cost.py [--spheres 1000] [--law adhesive] [--inertial-number 2e-2] [--modules BUILD] [--state FILE] [--json FILE]

A step: microseconds, least and median of blocks of ten. A trial: n steps and the stress, in a fork that makes those of 16
(YADE) or in a copy of the committed block (compact); least and median [ms]. Memory [MB] of a committed volume element and
what a trial of 30 steps takes beside it. "before": the packing's time in seconds, so that the collider runs in every step, and rotations of
contacts followed. --json: all of it as numbers.
"""

import argparse
import json
import os
import sys
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"  # a trial is a fork, and would wait for its parent's threads for ever
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
LAWS = {
    "adhesive": {"cohesion": 1.0},
    "bonded": {"cohesion": 1.0, "contact_law": "bonded"},
    "friction": {"contact_law": "friction"},
}
STEPS = (3, 10, 30)
BLOCK, WARM, COPIES, FORKS = 10, 100, 16, 5
BIAXIAL = np.array([[0.6, 0.1, 0.0], [0.1, -1.0, 0.05], [0.0, 0.05, 0.0]])


def paths(modules):
    """What imports of the tree's Python and compiled modules need."""
    sys.path[:0] = [str(ROOT / "yade_scripts"), str(ROOT / "tests" / "yade"), str(modules)]


def spent(action):
    """Processor time of this thread [s]."""
    start = time.thread_time()
    action()
    return time.thread_time() - start


def resident():
    """Memory of this process [MB]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def as_it_was(engine, ve):
    """Takes from the volume element what has made YADE's step cheaper; its path stays."""
    import unit_of_time
    import volume_element

    engine.info(ve)
    O, unit = engine.O, unit_of_time.of(engine.O).in_a_second
    for b in O.bodies:
        b.state.mass /= unit**2
        b.state.inertia = b.state.inertia / unit**2
        b.state.vel, b.state.angVel = b.state.vel * unit, b.state.angVel * unit
    O.dt /= unit
    unit_of_time.note(O, unit_of_time.SECOND)
    geometry = O.engines[2].geomDispatcher.functors[0]
    if hasattr(geometry, "updateRotations"):
        geometry.updateRotations = True
    engine._grains[ve] = volume_element._grains(O)


def steps(engine, elements, start, L, blocks):
    """{engine: times of a block of steps [s]}, all from the same state along the same path."""
    import compact_cell

    cells = {k: compact_cell.CompactCell.from_scene(start) for k in compact_cell.kernels()}
    times = {name: [] for name in (*elements, *(k.name for k in cells))}
    for _ in range(blocks):
        for name, ve in elements.items():
            times[name].append(spent(lambda: engine.deform(ve, L, BLOCK)))
        for kernel, cell in cells.items():
            compact_cell.use_kernel(kernel)
            times[kernel.name].append(spent(lambda: cell.deform(L, BLOCK)))
    return times


def report_as_it_was(engine, ve):
    """What every trial found for its report, and is now found where a field is written; but for a look at each contact every
    200 DEM steps."""
    import volume_element

    engine._contact_network()
    volume_element._mean_rotation(engine._grains[ve].states)


def fork_trial(engine, elements, L, n, whole_report):
    """Processor time [s] of a trial in a fork that makes those of all `elements`, as a rank's worker does, and the memory that
    it takes beside the committed state [MB]; both of one of them, the fork itself included."""
    end, begin = os.pipe()
    before = time.process_time()
    child = os.fork()
    if child == 0:
        for ve in elements:
            engine.deform(ve, L, n)
            engine.measure(ve, np.empty(9), np.empty(0), np.empty(9))
            if whole_report:
                report_as_it_was(engine, ve)
        mine = sum(int(line.split()[1]) for line in open("/proc/self/smaps_rollup") if line.startswith("Private_Dirty"))
        os.write(begin, str(mine * 1024 / 1e6).encode())
        os._exit(0)
    used = os.wait4(child, 0)[2]
    seconds = time.process_time() - before + used.ru_utime + used.ru_stime
    memory = float(os.read(end, 100))
    os.close(end), os.close(begin)
    return seconds / len(elements), memory / len(elements)


def compact_trials(start, L, kernel, count):
    """{n: times of a trial [s]} from a state after WARM steps, and the memory of that state [MB]."""
    import compact_cell

    compact_cell.use_kernel(kernel)
    committed = compact_cell.CompactCell.from_scene(start)
    committed.deform(L, WARM)
    trial = committed.copy()

    def run(n):
        trial.assign(committed)
        trial.deform(L, n)
        trial.stress()

    return {n: [spent(lambda: run(n)) for _ in range(count)] for n in STEPS}, committed.memory / 1e6


def measured(spheres, law, inertial_number, state=None):
    """Everything as numbers, see the table of main."""
    import compact_cell
    import compact_scene
    from cells import packing
    from volume_element import Engine

    engine = Engine([])
    state = state or engine.make_template(packing(spheres=spheres, **LAWS[law]))["state"]
    many = {"before": [engine.add(state) for _ in range(COPIES)]}
    before = resident()
    many["YADE"] = [engine.add(state) for _ in range(COPIES)]
    of_yade = (resident() - before) / COPIES
    L = BIAXIAL * inertial_number / engine.info(many["YADE"][0])["time_scale"] / np.linalg.norm(BIAXIAL)
    exporting = time.thread_time()
    start = compact_scene.export(engine.O)
    exporting = time.thread_time() - exporting
    for ve in many["before"]:
        as_it_was(engine, ve)
    committed = compact_cell.CompactCell.from_scene(start)
    few = max(5, min(40, 40000 // len(committed)))
    times, trials = steps(engine, {name: ves[0] for name, ves in many.items()}, start, L, few), {}
    for name, ves in many.items():
        forked = {n: [fork_trial(engine, ves, L, n, name == "before") for _ in range(FORKS)] for n in STEPS}
        trials[name] = {n: [seconds for seconds, _ in found] for n, found in forked.items()}
        of_trial = float(np.median([memory for _, memory in forked[STEPS[-1]]]))
    for kernel in compact_cell.kernels():
        trials[kernel.name], of_compact = compact_trials(start, L, kernel, few)
    trial = committed.copy()
    parts = {
        "copy": lambda: trial.assign(committed),
        "stress": committed.stress,
        "report": committed.report,
        "save": committed.save,
        "Eq. (2)": lambda: committed.stiffness("affine"),
        "relaxed stiffness": lambda: committed.stiffness("relaxed"),
    }
    both = lambda values: (float(min(values)), float(np.median(values)))
    return {
        "spheres": len(committed),
        "contacts": int(committed.report()["contacts"]),
        "step_us": {name: both(1e6 * np.array(t) / BLOCK) for name, t in times.items()},
        "trial_ms": {name: {n: both(1e3 * np.array(t)) for n, t in of.items()} for name, of in trials.items()},
        "memory_mb": {"YADE": of_yade, "a trial of YADE": of_trial, "compact": of_compact},
        "part_us": {name: 1e6 * min(spent(action) for _ in range(9)) for name, action in parts.items()},
        "export_s": exporting,
    }


def options(text, spheres):
    """What is asked of one packing."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spheres", type=int, default=spheres)
    parser.add_argument("--law", choices=LAWS, default="adhesive")
    parser.add_argument("--inertial-number", type=float, default=2e-2)
    parser.add_argument("--modules", type=Path, default=ROOT / "build/release", help="folder of the compiled modules")
    parser.add_argument("--json", type=Path, help="where the numbers go")
    return parser


def main():
    parser = options(__doc__, 1000)
    parser.add_argument("--state", type=Path, help="a prepared state of `femxdem ve prepare` instead of a new packing")
    arguments = parser.parse_args()
    paths(arguments.modules)
    state = arguments.state.read_bytes() if arguments.state else None
    found = measured(arguments.spheres, arguments.law, arguments.inertial_number, state)
    print(f"{found['spheres']} spheres, {found['contacts']} contacts, {arguments.law}, I = {arguments.inertial_number:g}")
    print("            a step [us]: min, median; a trial [ms]: min / median, n = " + ", ".join(map(str, STEPS)))
    for name, (least, median) in found["step_us"].items():
        trials = ["{:7.3f} / {:7.3f}".format(*found["trial_ms"][name][n]) for n in STEPS]
        print(f"{name:12}{least:8.1f}{median:8.1f}  " + "  ".join(trials))
    print("".join(f"{name}: {us:.0f} us\n" for name, us in found["part_us"].items()), end="")
    print("".join(f"{name}: {mb:.2f} MB\n" for name, mb in found["memory_mb"].items()), end="")
    print(f"export from YADE: {found['export_s']:.3f} s")
    if arguments.json:
        arguments.json.write_text(json.dumps(found))


if __name__ == "__main__":
    main()
