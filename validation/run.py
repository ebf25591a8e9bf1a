#!/usr/bin/python3
"""Verification against closed forms, published values and the program's own refinements.

    validation/run.py NAME ... | --all | --list    [--build build/release] [--record | --no-figures]

Prints one row for each quantity (measured, reference, tolerance, observed order) and draws the figure of each case into
its folder; exit status 1 if any quantity is off. --record also writes the table into the README of the folder.
A case is a name that `femxdem-verify` knows, or a folder beside this file with a verify.py, whose function
verify(build, folder) returns its rows and draws its figure.
"""

import argparse
import importlib.util
import json
import os
import platform
import subprocess
import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent
BEGIN, END = "<!-- results -->", "<!-- end of results -->"


def closed_forms(build):
    """Names that femxdem-verify knows."""
    program = build / "femxdem-verify"
    if not program.exists():
        sys.exit(f"run.py: {program} is not there; build it (cmake --build {build} --target femxdem-verify) or give --build")
    return subprocess.run([program, "--list"], capture_output=True, text=True, check=True).stdout.split()


def folders():
    return sorted(file.parent.name for file in HERE.glob("*/verify.py"))


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


def run_closed_form(name, build, figures=True):
    program = subprocess.run([build / "femxdem-verify", name], capture_output=True, text=True)
    if program.returncode != 0:
        print(program.stderr.strip(), file=sys.stderr)
        return [{"quantity": "run", "measured": None, "reference": None, "tolerance": 0, "order": None}]
    answer = json.loads(program.stdout)
    if figures and answer["figures"]:
        (HERE / name).mkdir(exist_ok=True)
        draw(answer["figures"], HERE / name / f"{name}.png")
    return answer["rows"]


def run_folder(name, build):
    specification = importlib.util.spec_from_file_location(f"verify_{name}", HERE / name / "verify.py")
    module = importlib.util.module_from_spec(specification)
    sys.path.insert(0, str(HERE))
    specification.loader.exec_module(module)
    return module.verify(build, HERE / name)


def passes(row):
    if row["measured"] is None or row["reference"] is None:
        return False
    return abs(row["measured"] - row["reference"]) <= row["tolerance"]


def number(value, digits=7):
    return "" if value is None else f"{value:.{digits}g}"


def table(rows):
    """Rows of a Markdown table."""
    lines = ["| quantity | measured | reference | tolerance | order | |", "|---|---|---|---|---|---|"]
    for row in rows:
        lines.append(f"| {row['quantity']} | {number(row['measured'])} | {number(row['reference'])} | "
                     f"{number(row['tolerance'], 3)} | {number(row['order'], 3)} | {'ok' if passes(row) else 'OFF'} |")
    return lines


def processor():
    for line in open("/proc/cpuinfo"):
        if line.startswith("model name"):
            return f"{line.split(':', 1)[1].strip()}, {os.cpu_count()} cores"
    return platform.machine()


def record(name, rows, seconds):
    """Puts the table between the marks of the folder's README."""
    file = HERE / name / "README.md"
    text = file.read_text() if file.exists() else f"# {name}\n\n{BEGIN}\n{END}\n"
    if BEGIN not in text or END not in text:
        text = f"{text.rstrip()}\n\n{BEGIN}\n{END}\n"
    head, tail = text.split(BEGIN)[0], text.split(END)[1]
    note = f"{time.strftime('%Y-%m-%d')}, {processor()}, {seconds:.0f} s: `validation/run.py {name}`"
    file.write_text("\n".join([head + BEGIN, note, "", *table(rows), END]) + tail)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", metavar="NAME", nargs="*", help="cases to run")
    parser.add_argument("--all", action="store_true", help="run every case")
    parser.add_argument("--list", action="store_true", help="say the names of the cases")
    parser.add_argument("--build", metavar="DIR", type=Path, default=HERE.parent / "build" / "release", help="build folder")
    parser.add_argument("--record", action="store_true", help="write the tables into the READMEs")
    parser.add_argument("--no-figures", action="store_true", help="closed forms: only the rows, nothing in the folders is touched")
    arguments = parser.parse_args()
    build = arguments.build.resolve()
    in_program, in_folder = closed_forms(build), folders()
    if arguments.list:
        print("\n".join(sorted(in_program + in_folder)))
        return 0
    names = sorted(in_program + in_folder) if arguments.all else arguments.names
    unknown = [name for name in names if name not in in_program + in_folder]
    if unknown or not names:
        parser.error(f"no case {unknown[0]}; see --list" if unknown else "name a case, or --all, or --list")
    off = 0
    for name in names:
        start = time.time()
        rows = run_closed_form(name, build, not arguments.no_figures) if name in in_program else run_folder(name, build)
        seconds = time.time() - start
        print(f"{name} ({seconds:.1f} s)", *table(rows), "", sep="\n", flush=True)
        off += sum(not passes(row) for row in rows)
        if arguments.record:
            record(name, rows, seconds)
    print(f"{off} quantities are off" if off else "all quantities within their tolerances")
    return 1 if off else 0


if __name__ == "__main__":
    sys.exit(main())
