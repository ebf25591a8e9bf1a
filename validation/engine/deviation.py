#!/usr/bin/python3
"""How far runs of one packing come apart along one path: relative difference of the stress from YADE's, by DEM steps.

    deviation.py [--spheres 400] [--law adhesive] [--inertial-number 2e-2] [--modules BUILD] [--json FILE]

"compact": the compact cell beside YADE that sums in the same order (loopOnSortedInteractions). "YADE's own order": YADE that sums
in the order of its container. "disturbed": YADE whose spheres have been moved by 1e-15 of the cell's width at the start.
"""

import json

import numpy as np

from cost import BIAXIAL, LAWS, options, paths

AT = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000)


def measured(spheres, law, inertial_number):
    """{name: difference after each of AT steps}."""
    import compact_scene
    from cells import packing
    from volume_element import Engine

    engine = Engine([])
    state = engine.make_template(packing(spheres=spheres, **LAWS[law]))["state"]
    elements = {name: engine.add(state) for name in ("sorted", "YADE's own order", "disturbed")}
    for name in ("disturbed", "sorted"):
        engine.info(elements[name])
        engine.O.engines[2].loopOnSortedInteractions = True
        if name == "disturbed":
            move(engine.O)
    cell = compact_scene.cell(engine.O)
    L = BIAXIAL * inertial_number / engine.info(elements["sorted"])["time_scale"] / np.linalg.norm(BIAXIAL)
    found = {name: [] for name in ("compact", "YADE's own order", "disturbed")}
    for made, until in zip((0, *AT), AT):
        stress = {}
        for name, ve in elements.items():
            engine.deform(ve, L, until - made)
            stress[name] = np.array(compact_scene.cell(engine.O).stress())
        cell.deform(L, until - made)
        stress["compact"] = np.array(cell.stress())
        for name, differences in found.items():
            size = np.linalg.norm(stress["sorted"])
            differences.append(float(np.linalg.norm(stress[name] - stress["sorted"]) / size))
    return found


def move(O):
    """Every sphere by 1e-15 of the cell's width in a random direction."""
    rng, width = np.random.default_rng(0), float(np.cbrt(O.cell.volume))
    for b in O.bodies:
        b.state.pos += 1e-15 * width * type(b.state.pos)(*rng.standard_normal(3))


def main():
    arguments = options(__doc__, 400).parse_args()
    paths(arguments.modules)
    found = measured(arguments.spheres, arguments.law, arguments.inertial_number)
    print("steps           " + "".join(f"{n:9d}" for n in AT))
    for name, differences in found.items():
        print(f"{name:16}" + "".join(f"{d:9.1e}" for d in differences))
    if arguments.json:
        arguments.json.write_text(json.dumps({"steps": AT, "difference": found}))


if __name__ == "__main__":
    main()
