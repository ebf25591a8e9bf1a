#!/usr/bin/python3
"""Stability where methods fail: each row shows the failure of the naive method and the program's answer to it.

    validation/stability/run.py [ROW ...] [--list] [--record] [--runs FOLDER] [--anew]

Prints for each row `naive: ...` and `answer: ...` with numbers, each check that does not hold, then PASS or FAIL; exit
status 1 if any row fails. Without names: every row.
"""

import sys
import time
import traceback
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import grains
import laws
from row import Row

ROWS = {**grains.ROWS, **laws.ROWS}


def attempt(function, c):
    try:
        return function(c)
    except Exception:
        return Row("", "", {traceback.format_exc().strip(): False})


def verify(c, names):
    lines, failed = ["| row | the naive method fails | the program's answer | |", "|---|---|---|---|"], 0
    for name in names:
        start = time.time()
        row = attempt(ROWS[name], c)
        failed += not row.passes()
        verdict = "PASS" if row.passes() else "FAIL"
        broken = [f"  does not hold: {sentence}" for sentence, holds in row.checks.items() if not holds]
        print(f"{name} ({time.time() - start:.1f} s)", f"  naive:  {row.naive}", f"  answer: {row.answer}", *broken, verdict,
              sep="\n", flush=True)
        lines.append(f"| `{name}` | {row.naive} | {row.answer} | {verdict} |".replace("\n", " "))
    c.table(lines)
    return 1 if failed else 0


def main():
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    rows = {name: function.__doc__ for name, function in ROWS.items()}
    return campaign.main(HERE, arguments, rows, lambda c: verify(c, arguments.rows or list(ROWS)), on_meshes=True)


if __name__ == "__main__":
    sys.exit(main())
