"""The program as a row runs it, and what a row says."""

import csv
import os
import re
import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))  # results.py, band.py

ENVIRONMENT = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}


@dataclass
class Row:
    naive: str  #: how the naive method fails, with numbers
    answer: str  #: what the program does about it, with numbers
    checks: dict = field(default_factory=dict)  #: sentence -> whether it holds

    def passes(self):
        return all(self.checks.values())


@dataclass
class Run:
    folder: Path
    status: int  #: exit status
    said: str  #: standard output and error

    def history(self):
        """Columns of history.csv by name; no column when no step converged."""
        file = self.folder / "history.csv"
        if not file.exists():
            return {}
        with open(file) as stream:
            rows = list(csv.DictReader(stream))
        return {name: [float(row[name]) for row in rows] for name in rows[0]} if rows else {}

    def steps(self):
        return len(self.history().get("step", []))

    def evaluations(self):
        """Of the steps that converged, their rejected attempts included."""
        return int(sum(self.history().get("evaluations", [])))

    def rejected(self):
        return len(re.findall(r"^step .* rejected: ", self.said, re.MULTILINE))

    def reason(self):
        """Why the run ended, or why it first rejected a step."""
        found = re.search(r"rejected: ([^;\n]*)", self.said)
        return found.group(1) if found else self.said.strip().splitlines()[-1]

    def line(self, words):
        """The first line that has these words, or nothing."""
        return next((line for line in self.said.splitlines() if words in line), "")


class Program:
    def __init__(self, femxdem, out):
        self.femxdem, self.out = Path(femxdem).resolve(), Path(out).resolve()

    def run(self, case, name, *settings):
        return self._start(["run"], case, name, settings)

    def path(self, case, name, *settings, noise=0):
        """`femxdem ve path`."""
        return self._start(["ve", "path", *(["--noise", str(noise)] if noise else [])], case, name, settings)

    def command(self, words, case, name, settings):
        overrides = [word for setting in settings for word in ("--set", setting)]
        return [self.femxdem, *words, HERE / case, "--out", self.out / name, "--overwrite", *overrides]

    def _start(self, words, case, name, settings):
        folder = self.out / name
        if (folder / "history.csv").exists():
            (folder / "history.csv").unlink()  # bad input leaves no new one
        done = subprocess.run(self.command(words, case, name, settings), capture_output=True, text=True,
                              env=ENVIRONMENT, cwd=HERE)
        return Run(folder, done.returncode, done.stdout + done.stderr)
