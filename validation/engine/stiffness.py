#!/usr/bin/python3
"""Cost of the elastic stiffness of a volume element, Eq. (2), beside that of a DEM step.

    validation/engine/stiffness.py [--spheres N] [--law adhesive|bonded|friction] [--repetitions R] [--build build/release]

Processor time, least and median of the repetitions; the packing is prepared first (half a minute for 1000 spheres).
"""

import argparse
import os
import sys
import time
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
import numpy as np

ROOT = Path(__file__).resolve().parents[2]


def milliseconds(work, repetitions):
    """Least and median processor time of `work`."""
    times = []
    for _ in range(repetitions):
        start = time.process_time()
        work()
        times.append(1e3 * (time.process_time() - start))
    return min(times), float(np.median(times))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spheres", type=int, default=1000)
    parser.add_argument("--law", choices=("adhesive", "bonded", "friction"), default="adhesive")
    parser.add_argument("--repetitions", type=int, default=41)
    parser.add_argument("--build", type=Path, default=ROOT / "build/release")
    a = parser.parse_args()
    sys.path[:0] = [str(ROOT / "yade_scripts"), str(ROOT / "tests" / "yade"), str(a.build.resolve())]
    from cells import packing
    from contact_laws import note_constant_stiffness
    from volume_element import Engine

    engine = Engine(["dem_steps"])
    spec = packing(spheres=a.spheres, contact_law=a.law, cohesion=0.0 if a.law == "friction" else 1.0)
    ve = engine.add(engine.make_template(spec)["state"])
    C = np.zeros(81)
    noted = milliseconds(lambda: engine.stiffness(ve, C), a.repetitions)
    step = milliseconds(lambda: [engine.O.step() for _ in range(10)], a.repetitions)
    relaxed = milliseconds(lambda: engine.stiffness(ve, C, "relaxed"), 3)
    note_constant_stiffness(engine.O, 0.0, 0.0)  # not true: every contact is asked, as in a user's script
    read = milliseconds(lambda: engine.stiffness(ve, C), a.repetitions)
    print(f"{a.spheres} spheres, {a.law}: least and median processor time [ms]")
    for name, (least, median) in (("Eq. (2)", noted), ("Eq. (2), every contact asked for kn, ks", read), ("relaxed", relaxed)):
        print(f"  {name:40} {least:8.2f} {median:8.2f}")
    print(f"  {'DEM step':40} {step[0] / 10:8.2f} {step[1] / 10:8.2f}")
    print(f"Eq. (2) costs {noted[1] / step[1] * 10:.1f} DEM steps")


if __name__ == "__main__":
    main()
