"""What every run.py of validation/ shares: its options, runs that are kept or go on, tables and figures in its folder.

A campaign is a folder with a run.py: its docstring, the names of its rows, and the work. Everything that it makes goes to
--runs; --record then copies figures and tables beside run.py. A run is known by its case, its settings and what it was
asked for; where they have changed, or with --anew, it starts from the beginning.
"""

import argparse
import hashlib
import json
import os
import platform
import re
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "fe_master" / "program"))  # results, band, plot

ONE_CORE = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PYTHONDONTWRITEBYTECODE": "1"}
os.environ.update(ONE_CORE)  # before NumPy is loaded: on a busy machine its threads wait for each other, a hundred times as long

import matplotlib

matplotlib.use("Agg")

from results import ResultsError, read_history

ANY_RANKS = {"OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
ENVIRONMENT = os.environ | ANY_RANKS
KEPT = (0, 2, 3)  # exit status: done, bad input, not converged; a failed volume element (4) may have been the machine's fault


class CampaignError(Exception):
    """What is wrong, where, and what to do: one sentence."""


@dataclass
class Run:
    """A run of femxdem that has ended."""

    folder: Path
    status: int  #: exit status
    said: str  #: standard output and error
    processor_seconds: float

    def history(self):
        """Columns of history.csv by name; no column when no step converged."""
        try:
            return read_history(self.folder)
        except ResultsError:
            return {}

    def steps(self):
        return len(self.history().get("step", []))

    def evaluations(self):
        """Of the steps that converged, their rejected attempts included."""
        return int(sum(self.history().get("evaluations", [])))

    def rejections(self):
        """Why each rejected attempt was rejected."""
        return re.findall(r"^step .* rejected: ([^;\n]*)", self.said, re.MULTILINE)

    def reason(self):
        """Why the run ended, or why it first rejected a step."""
        found = re.search(r"rejected: ([^;\n]*)", self.said)
        return found.group(1) if found else self.last_words()

    def last_words(self):
        return (self.said.strip().splitlines() or [""])[-1]

    def line(self, words):
        """The first line that has these words, or nothing."""
        return next((line for line in self.said.splitlines() if words in line), "")


class Campaign:
    """One campaign at work: `home` is the folder of its run.py, `runs` where everything goes."""

    def __init__(self, home, arguments):
        self.home, self.runs = Path(home), arguments.runs.resolve()
        self.program, self.ranks, self.anew = arguments.femxdem.resolve(), arguments.ranks, arguments.anew
        self.recorded = arguments.record
        self.processor_seconds = 0.0  # of all runs, those that were kept included
        self._products, self._tables = [], {}
        self.runs.mkdir(parents=True, exist_ok=True)

    @property
    def cache(self):
        """Setting of the folder of its packings."""
        return f've.cache="{self.runs / "packings"}"'

    def run(self, case, name, *settings, checkpoint_every=0):
        """`femxdem run` of a case into the folder of that name, on all ranks; one that takes long says how many steps lie
        between its checkpoints."""
        checkpoints = [f"output.checkpoint_every={checkpoint_every}"] if checkpoint_every else []
        return self._femxdem(["run"], case, name, [*settings, *checkpoints], self.ranks)

    def path(self, case, name, *settings, noise=0):
        """`femxdem ve path`."""
        return self._femxdem(["ve", "path", *(["--noise", str(noise)] if noise else [])], case, name, settings, 1)

    def command(self, words, case, name, settings, ranks=1, existing="--overwrite"):
        overrides = [word for setting in settings for word in ("--set", setting)]
        mpi = ["mpirun", "-n", ranks] if ranks > 1 else []
        return [str(w) for w in (*mpi, self.program, *words, self.home / case, "--out", self.runs / name, existing, *overrides)]

    def _femxdem(self, words, case, name, settings, ranks):
        if not self.program.exists():
            raise CampaignError(f"{self.program} is not there; build it (bash setup.sh build), or give --femxdem")
        folder, text = self.runs / name, (self.home / case).read_bytes()
        asked = {"words": words, "case": hashlib.sha256(text).hexdigest(), "settings": list(settings)}
        goes_on = self._went(folder, asked) and (folder / "checkpoint.h5").exists()

        def start(said):
            if not goes_on:
                for left in ("history.csv", "checkpoint.h5"):  # bad input leaves no new ones
                    (folder / left).unlink(missing_ok=True)
            command = self.command(words, case, name, settings, ranks, "--restart" if goes_on else "--overwrite")
            return subprocess.run(command, stdout=said, stderr=said, env=ENVIRONMENT, cwd=self.home).returncode

        run = self.once(name, asked, start, goes_on)
        if goes_on and run.status == 2:
            raise CampaignError(f"{folder}: {run.last_words()}; --anew starts every run again")
        return run

    def once(self, name, asked, start, goes_on=False):
        """The Run of that name: kept where it has ended and was asked for the same, else start(said) is called, which writes
        to the open file `said` and returns an exit status."""
        folder = self.runs / name
        if not (self._went(folder, asked) and self._note(folder)["status"] in KEPT):
            folder.mkdir(parents=True, exist_ok=True)
            before = self._note(folder)["processor_seconds"] if goes_on else 0.0
            self._write_note(folder, asked, None, before)
            used = _processor_seconds()
            with open(folder / "said.txt", "a" if goes_on else "w") as said:
                status = start(said)
            self._write_note(folder, asked, status, before + _processor_seconds() - used)
        run = self.as_it_is(name)
        self.processor_seconds += run.processor_seconds
        return run

    def value(self, name, asked, measure):
        """What measure() returns, a value of JSON; kept as a run is."""
        file = self.runs / name / "value.json"

        def start(said):
            file.write_text(json.dumps(measure()))
            return 0

        self.once(name, asked, start)
        return json.loads(file.read_text())

    def as_it_is(self, name):
        """The run of that name as far as it has come; its status is None while it has not ended. None without one."""
        folder = self.runs / name
        if not (folder / "campaign.json").exists():
            return None
        note = self._note(folder)
        return Run(folder, note["status"], (folder / "said.txt").read_text(errors="replace"), note["processor_seconds"])

    def _went(self, folder, asked):
        """Whether there is a run that was asked for the same."""
        return not self.anew and (folder / "campaign.json").exists() and self._note(folder)["asked"] == asked

    def _note(self, folder):
        return json.loads((folder / "campaign.json").read_text())

    def _write_note(self, folder, asked, status, processor_seconds):
        note = {"asked": asked, "status": status, "processor_seconds": processor_seconds}
        (folder / "campaign.json").write_text(json.dumps(note, indent=1))

    def product(self, file_name):
        """Where a figure or a table of numbers goes; --record copies it into the folder."""
        if file_name not in self._products:
            self._products.append(file_name)
        return self.runs / file_name

    def table(self, lines, page="README.md", mark="results"):
        """The lines of the campaign's Markdown table, as far as it has come, and where --record puts them: on a page of the
        folder between <!-- results --> and <!-- end of results -->."""
        self._tables[page, mark] = list(lines)
        (self.runs / "table.md").write_text("\n".join(lines) + "\n")

    def record(self):
        """Puts figures, numbers and the table into the folder; as table.md where the page has no place for it."""
        for file_name in self._products:
            shutil.copy(self.runs / file_name, self.home / file_name)
        for (page, mark), lines in self._tables.items():
            if f"<!-- {mark} -->" in (self.home / page).read_text():
                write_between_marks(self.home / page, lines, f"{self.processor_seconds:.0f} s of processor time", mark=mark)
            else:
                (self.home / "table.md").write_text("\n".join(lines) + "\n")


def _processor_seconds():
    """Of all children so far, and of this process."""
    uses = [resource.getrusage(who) for who in (resource.RUSAGE_CHILDREN, resource.RUSAGE_SELF)]
    return sum(use.ru_utime + use.ru_stime for use in uses)


def given_words(arguments):
    """What a campaign was asked for, without --record and the folders of a machine."""
    words, following = [], iter(arguments)
    for word in following:
        if word in ("--runs", "--femxdem"):
            next(following, None)
        elif word != "--record" and not word.startswith(("--runs=", "--femxdem=")):
            words.append(word)
    return words


def write_between_marks(page, lines, cost, words=None, mark="results"):
    """Replaces what stands between the marks of a page by a line of date, machine, cost and command (with `words` for those
    of the command line), and the table."""
    text, begin, end = page.read_text(), f"<!-- {mark} -->", f"<!-- end of {mark} -->"
    if begin not in text or end not in text:
        raise CampaignError(f"{page}: no place for the table; put {begin} and {end} on two lines of it")
    words = given_words(sys.argv[1:]) if words is None else words
    command = " ".join([str(Path(sys.argv[0]).resolve().relative_to(ROOT)), *words])
    note = f"{time.strftime('%Y-%m-%d')}, {processor()}, {cost}: `{command}`"
    page.write_text("\n".join([text.split(begin)[0] + begin, note, "", *lines, end]) + text.split(end)[1])


def processor():
    for line in open("/proc/cpuinfo"):
        if line.startswith("model name"):
            return f"{line.split(':', 1)[1].strip()}, {os.cpu_count()} cores"
    return platform.machine()


def parser(home, description, rows=False):
    """The options of every campaign; `rows`: their names may be given to run these alone."""
    p = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    if rows:
        p.add_argument("rows", metavar="ROW", nargs="*", help="rows to run (default: all); see --list")
    p.add_argument("--list", action="store_true", help="say the rows, run nothing")
    p.add_argument("--record", action="store_true", help="write table and figures into the campaign's folder")
    p.add_argument("--runs", metavar="FOLDER", type=Path, default=ROOT / "out" / Path(home).name,
                   help="where runs, tables and figures go; finished runs in it are kept, others go on (default: out/NAME)")
    p.add_argument("--anew", action="store_true", help="finished runs are repeated")
    p.add_argument("--ranks", metavar="N", type=int, default=1, help="MPI ranks of each run on a mesh of volume elements")
    p.add_argument("--femxdem", metavar="PROGRAM", type=Path, default=ROOT / "build" / "release" / "femxdem")
    return p


def main(home, arguments, rows, work, on_meshes=False):
    """Lists the rows (name -> a line of text, or nothing), or does the work, work(campaign); returns the exit status."""
    try:
        chosen = getattr(arguments, "rows", [])
        unknown = [name for name in chosen if name not in rows]
        if unknown:
            raise CampaignError(f"no row {unknown[0]}; --list names them")
        if arguments.ranks > 1 and not on_meshes:
            raise CampaignError(f"--ranks {arguments.ranks}: this campaign has no mesh of volume elements; leave it out")
        if arguments.list:
            print("\n".join(f"{name:20} {text}".rstrip() for name, text in rows.items()))
            return 0
        campaign = Campaign(home, arguments)
        status = work(campaign)
        if arguments.record:
            campaign.record()
        return status or 0
    except (CampaignError, ResultsError) as error:
        print(f"{Path(home).name}: {error}", file=sys.stderr)
        return 2
