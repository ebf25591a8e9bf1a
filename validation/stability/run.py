#!/usr/bin/python3
"""Stability where methods fail: each row shows the failure of the naive method and the program's answer to it.

    validation/stability/run.py [ROW ...] [--femxdem build/release/femxdem] [--out out/stability] [--list]

Prints for each row `naive: ...` and `answer: ...` with numbers, each check that does not hold, then PASS or FAIL; exit
status 1 if any row fails. Without names: every row.
"""

import argparse
import sys
import time
import traceback
from pathlib import Path

import grains
import laws
from program import HERE, Program, Row

ROWS = {**grains.ROWS, **laws.ROWS}


def attempt(function, program):
    try:
        return function(program)
    except Exception:
        return Row("", "", {traceback.format_exc().strip(): False})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rows", metavar="ROW", nargs="*", help="rows to run; see --list")
    parser.add_argument("--femxdem", type=Path, default=HERE.parents[1] / "build" / "release" / "femxdem")
    parser.add_argument("--out", type=Path, default=Path("out/stability"), help="folder of the runs and of the packings")
    parser.add_argument("--list", action="store_true", help="say the names of the rows")
    arguments = parser.parse_args()
    if arguments.list:
        print("\n".join(f"{name:20} {function.__doc__}" for name, function in ROWS.items()))
        return 0
    unknown = [name for name in arguments.rows if name not in ROWS]
    if unknown:
        parser.error(f"no row {unknown[0]}; see --list")
    if not arguments.femxdem.exists():
        parser.error(f"{arguments.femxdem} is not there; build it, or give --femxdem")
    arguments.out.mkdir(parents=True, exist_ok=True)
    program, failed = Program(arguments.femxdem, arguments.out), 0
    for name in arguments.rows or ROWS:
        start = time.time()
        row = attempt(ROWS[name], program)
        failed += not row.passes()
        broken = [f"  does not hold: {sentence}" for sentence, holds in row.checks.items() if not holds]
        print(f"{name} ({time.time() - start:.1f} s)", f"  naive:  {row.naive}", f"  answer: {row.answer}", *broken,
              "PASS" if row.passes() else "FAIL", sep="\n", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
