#!/usr/bin/python3
"""Whether two folders hold the same results, to the bit: history.csv and results.h5, what depends on the clock apart.

    same_results.py FOLDER FOLDER     exit status 1 and the differences where they differ
"""

import csv
import sys
from pathlib import Path

import h5py
import numpy as np

OF_THE_CLOCK = {"dem_seconds", "wall_s", "seconds", "engine_seconds"}


def rows(folder):
    """history.csv as text, without the columns of the clock."""
    with open(Path(folder) / "history.csv", newline="") as file:
        return [{k: v for k, v in row.items() if k not in OF_THE_CLOCK} for row in csv.DictReader(file)]


def contents(folder):
    """{path: bytes} of all data sets and attributes of results.h5."""
    found = {}

    def note(name, item):
        if name.rsplit("/", 1)[-1] in OF_THE_CLOCK:
            return
        for key, value in item.attrs.items():
            found[f"{name}@{key}"] = np.asarray(value).tobytes()
        if isinstance(item, h5py.Dataset):
            found[name] = (item.shape, item.dtype.str, item[()].tobytes())

    with h5py.File(Path(folder) / "results.h5") as h5:
        h5.visititems(note)
    return found


def differences(one, other):
    """A line for each that differs; none where the results are equal."""
    lines = []
    a, b = rows(one), rows(other)
    if len(a) != len(b):
        lines.append(f"history.csv: {len(a)} rows and {len(b)}")
    for number, (x, y) in enumerate(zip(a, b)):
        lines += [f"history.csv, row {number}: {key} {x[key]} and {y.get(key)}" for key in x if x[key] != y.get(key)]
    a, b = contents(one), contents(other)
    lines += [f"results.h5: {name} only in one" for name in sorted(a.keys() ^ b.keys())]
    lines += [f"results.h5: {name} differs" for name in sorted(a.keys() & b.keys()) if a[name] != b[name]]
    return lines


if __name__ == "__main__":
    if len(sys.argv) != 3 or not all((Path(f) / "history.csv").exists() for f in sys.argv[1:]):
        print("give two folders with a history.csv each: same_results.py A B", file=sys.stderr)
        sys.exit(2)
    said = differences(*sys.argv[1:3])
    print("\n".join(said) or "equal to the bit")
    sys.exit(bool(said))
