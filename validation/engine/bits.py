#!/usr/bin/python3
"""The compact cell against YADE to the bit, over packings: three values each of kappa, k_n/k_t and size ratio, laws in turn.

    bits.py [--spheres N] [--steps 1,10,100,1000] [--inertial-number I] [--modules BUILD]

Each row: a packing, strained in both engines (YADE with loopOnSortedInteractions) by another random velocity gradient
for every count of steps; then what differs among positions, velocities, spins, forces, torques, cell, contacts and
their forces, of every kernel that the processor has. Ends with status 1 if anything does.
"""

import argparse
import itertools
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
LAWS = (
    {"contact_law": "friction"},
    {"cohesion": 1.0},
    {"cohesion": 1.0, "contact_law": "bonded"},
    {"cohesion": 1.0, "new_contacts": "adhesive"},
)
KAPPA, STIFFNESS_RATIO, SIZE_RATIO = (100.0, 1000.0, 10000.0), (0.2, 1.0, 2.0), (1.0, 2.0, 4.0)


def packings(spheres):
    values = itertools.product(KAPPA, STIFFNESS_RATIO, SIZE_RATIO)
    for seed, (kappa, stiffness_ratio, size_ratio) in enumerate(values):
        shape = {"kappa": kappa, "stiffness_ratio": stiffness_ratio, "size_ratio": size_ratio}
        yield {"spheres": spheres, "seed": seed, **shape, **LAWS[seed % len(LAWS)]}


def different(a, b):
    """Names of what is not equal in two exports; orientations, which act on nothing, only agree to round-off."""
    import compact_scene

    a, b = compact_scene.Scene(a), compact_scene.Scene(b)
    names = [name for name in vars(a) if not name.startswith("_") and name != "turned"]
    return [name for name in names if not np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True)]


def compare(engine, state, steps, inertial_number, seed):
    """Counts of contacts at the start and the end, contacts ever changed, and names of what differs."""
    import compact_cell
    import compact_scene

    ve = engine.add(state)
    engine.info(ve)
    engine.O.engines[2].loopOnSortedInteractions = True
    start = compact_scene.export(engine.O)
    cells = {kernel: compact_cell.CompactCell.from_scene(start) for kernel in compact_cell.kernels()}
    rate = inertial_number / engine.info(ve)["time_scale"]
    rng, wrong, seen = np.random.default_rng(seed), set(), [set(map(tuple, compact_scene.Scene(start).ids))]
    for count in steps:
        L = rng.standard_normal((3, 3))
        L *= rate / np.linalg.norm(L)
        engine.deform(ve, L, count)
        theirs = compact_scene.export(engine.O)
        seen.append(set(map(tuple, compact_scene.Scene(theirs).ids)))
        for kernel, cell in cells.items():
            compact_cell.use_kernel(kernel)
            cell.deform(L, count)
            wrong |= {f"{name} ({kernel.name}, {count})" for name in different(cell.to_scene(), theirs)}
    engine.remove(ve)
    return len(seen[0]), len(seen[-1]), sum(len(p ^ q) for p, q in zip(seen, seen[1:])), sorted(wrong)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spheres", type=int, default=100)
    parser.add_argument("--steps", default="1,10,100,1000")
    parser.add_argument("--inertial-number", type=float, default=2e-2)
    parser.add_argument("--modules", type=Path, default=ROOT / "build/release", help="folder of the compiled modules")
    arguments = parser.parse_args()
    sys.path[:0] = [str(ROOT / "yade_scripts"), str(ROOT / "tests" / "yade"), str(arguments.modules)]
    from cells import packing
    from volume_element import Engine

    engine, steps = Engine([]), [int(s) for s in arguments.steps.split(",")]
    print("kappa  kn/kt  d_max/d_min  law                    contacts       changed  equal")
    failed = 0
    for spec in packings(arguments.spheres):
        state = engine.make_template(packing(**spec))["state"]
        first, last, changed, wrong = compare(engine, state, steps, arguments.inertial_number, spec["seed"])
        law = spec.get("contact_law", "adhesive") + (", new too" if "new_contacts" in spec else "")
        shape = f"{spec['kappa']:5.0f}  {spec['stiffness_ratio']:5.1f}  {spec['size_ratio']:11.1f}"
        verdict = "NO: " + ", ".join(wrong) if wrong else "yes"
        print(f"{shape}  {law:21}  {first:4d} -> {last:4d}  {changed:8d}  {verdict}", flush=True)
        failed += bool(wrong)
    print(f"{27 - failed} of 27 packings equal YADE to the bit after {arguments.steps} steps each")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
