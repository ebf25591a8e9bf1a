#!/usr/bin/python3
"""The finite elements against closed forms, published values and the program's own refinements.

    validation/closed_forms/run.py [CASE ...] [--list] [--record]

Prints one row for each quantity (measured, reference, tolerance, observed order); exit status 1 if any is off. Seconds a
case. --record writes table and figure into the folder of each case. The cases are those of `femxdem-verify --list`.
"""

import json
import shutil
import subprocess
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign
import judged

import matplotlib.pyplot as plt


def verify(femxdem, word):
    """What femxdem-verify, beside the program, says to a case or to --list."""
    program = femxdem.resolve().with_name("femxdem-verify")
    if not program.exists():
        raise campaign.CampaignError(f"{program} is not there; build it (bash setup.sh build), or give --femxdem")
    done = subprocess.run([program, word], capture_output=True, text=True, env=campaign.ENVIRONMENT)
    if done.returncode != 0:
        raise campaign.CampaignError(done.stderr.strip() or f"{program} {word}: ended with status {done.returncode}")
    return done.stdout


def draw(figures, file):
    """Panels side by side: closed forms as lines, finite elements as markers."""
    drawing, panels = plt.subplots(1, len(figures), figsize=(4.6 * len(figures), 3.4), squeeze=False)
    for axes, figure in zip(panels[0], figures):
        for curve in figure["curves"]:
            style = "-" if curve["closed_form"] else ("o-" if figure["logarithmic"] else ".")
            width = 1.2 if curve["closed_form"] else 0.8
            axes.plot(curve["x"], curve["y"], style, label=curve["label"], linewidth=width, markersize=3.5)
        if figure["logarithmic"]:
            axes.set_yscale("log")
            if max(max(c["x"]) for c in figure["curves"]) > 20:
                axes.set_xscale("log")
        axes.set(title=figure["title"], xlabel=figure["x_label"], ylabel=figure["y_label"])
        axes.title.set_fontsize(9)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=7)
    drawing.savefig(file, dpi=110, bbox_inches="tight")
    plt.close(drawing)


def check(c, case):
    """The rows of one case; its figure goes to the runs."""
    start = time.time()
    try:
        answer = json.loads(verify(c.program, case))
    except campaign.CampaignError as error:
        print(error, file=sys.stderr)
        return [judged.row(f"{case}: run", None)]
    seconds, rows, figure = time.time() - start, answer["rows"], c.runs / f"{case}.png"
    draw(answer["figures"], figure)
    print(f"{case} ({seconds:.1f} s)", *judged.table(rows), "", sep="\n", flush=True)
    if c.recorded:
        shutil.copy(figure, HERE / case / figure.name)
        campaign.write_between_marks(HERE / case / "README.md", judged.table(rows), f"{seconds:.0f} s", [case])
    return rows


def main():
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    try:
        cases = dict.fromkeys(verify(arguments.femxdem, "--list").split(), "")
    except campaign.CampaignError as error:
        sys.exit(f"closed_forms: {error}")
    work = lambda c: judged.verdict([row for case in arguments.rows or cases for row in check(c, case)])
    return campaign.main(HERE, arguments, cases, work)


if __name__ == "__main__":
    sys.exit(main())
