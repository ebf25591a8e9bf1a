"""One fault in one run of femxdem: how it strikes, and what is then left of the run.

A Fault changes the run's environment, strikes from outside while the run lives, or both. `inject` lets it strike, looks at
what lies on the disk, takes the fault away, goes on (--restart, or anew where there is no checkpoint), and compares with the
run that nothing has struck: history.csv but for the columns of clocks, every data set of results.h5 but for seconds.
"""

import os
import resource
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np

CLOCKS = ("dem_seconds", "wall_s")
LONGEST = 600  # s; a run that takes longer waits for ever


@dataclass
class Fault:
    name: str
    case: str = "law"  #: of Place.cases
    environment: dict = field(default_factory=dict)
    settings: tuple = ()
    strike: object = None  #: called with (process, folder) when the run has started
    prepare: object = None  #: called with the folder before the run, returns what undoes it
    limits: dict = field(default_factory=dict)  #: resource -> bytes
    ranks: int = 1
    cuts: bool = False  #: a struck step may be done again in smaller steps: other steps than the reference's
    restored: bool = False  #: its volume elements are restored in between: see same_bits
    destroys: bool = False  #: takes results away that nothing can bring back: the run is to notice


class Place:
    """Where the runs go, and what they are compared with."""

    def __init__(self, program, runs, environment, cases):
        self.program, self.runs, self.environment, self.cases = program, Path(runs), environment, cases
        self.references = {}
        self.work = self.runs / f"of_{os.getpid()}"  # two of them may share the folder of values
        self.work.mkdir(parents=True, exist_ok=True)

    def command(self, fault, folder, existing, settings=()):
        file, own = self.cases[fault.case]
        overrides = [w for s in (*own, *fault.settings, *settings) for w in ("--set", s)]
        mpi = ["mpirun", "-n", str(fault.ranks)] if fault.ranks > 1 else []
        return [str(w) for w in (*mpi, self.program, "run", file, "--out", folder, *existing, *overrides)]

    def reference(self, fault):
        """Folder of the run that nothing has struck."""
        key = fault.case, fault.settings
        if key not in self.references:
            folder = self.work / f"reference_{len(self.references)}_{fault.case}"
            clean = Fault("reference", fault.case, settings=fault.settings)
            done = subprocess.run(self.command(clean, folder, ["--overwrite"]), env=self.environment, capture_output=True, text=True)
            if done.returncode != 0:
                raise RuntimeError(f"{folder}: the run without a fault ended with {done.returncode}: {done.stdout + done.stderr}")
            self.references[key] = folder
        return self.references[key]


def history(folder):
    """Rows of history.csv but for the clocks' columns; a row that has been left unfinished is not one."""
    file = folder / "history.csv"
    lines = file.read_text().splitlines() if file.is_file() else []
    if not lines:
        return []
    names = lines[0].split(",")
    rows = [dict(zip(names, line.split(","))) for line in lines[1:] if line.count(",") == len(names) - 1]
    return [{k: v for k, v in row.items() if k not in CLOCKS} for row in rows]


def fields(folder):
    """{name: array} of all data sets of results.h5 but for seconds; None where it cannot be read."""
    found = {}

    def take(name, item):
        if hasattr(item, "shape") and "seconds" not in name:
            found[name] = item[()]

    try:
        with h5py.File(folder / "results.h5") as h5:
            h5.visititems(take)
    except (OSError, RuntimeError, KeyError):
        return None
    return found


def steps_in(found):
    return sorted({int(name.split("/")[1]) for name in found if name.startswith("steps/")}) if found else []


def same_bits(folder, reference, restored=False):
    """Empty, or what differs first. Of volume elements that have been restored in between, contacts are summed in another order
    (fabric, unbalanced force: the last digit)."""
    ours, theirs = history(folder), history(reference)
    if ours != theirs:
        return f"history.csv: {len(ours)} rows of {len(theirs)}, or others"
    mine, its = fields(folder), fields(reference)
    if mine is None or mine.keys() != its.keys():
        return "results.h5: other data sets"
    different = (name for name in its if its[name].tobytes() != mine[name].tobytes())
    if restored:
        different = (name for name in different if not np.allclose(its[name], mine[name], rtol=1e-12, atol=1e-15))
    return next(different, "")


def strays(folder):
    """Files that no run is to leave."""
    whole = {"case.toml", "checkpoint.h5", "checkpoint.previous.h5", "history.csv", "log.txt", "results.h5", "results.xdmf", "summary.json"}
    return sorted(file.name for file in folder.iterdir() if file.name not in whole)


def same_end(folder, reference):
    """The same of the last step alone."""
    if history(folder)[-1:] != history(reference)[-1:]:
        return "history.csv: another last row"
    last = f"steps/{max(steps_in(fields(reference))):06d}/"
    theirs, ours = ({k: v for k, v in (fields(f) or {}).items() if k.startswith(last)} for f in (reference, folder))
    return next((k for k in theirs if k not in ours or theirs[k].tobytes() != ours[k].tobytes()), "")


def near(folder, reference):
    """Empty where the run has reached the same end and its first monitor lies within 2 % of the reference's largest there."""
    ours, theirs = history(folder), history(reference)
    if not ours or float(ours[-1]["time"]) != float(theirs[-1]["time"]):
        return "it has not reached its end"
    force = np.array([float(r["force_top"]) for r in theirs])
    off = abs(float(ours[-1]["force_top"]) - force[-1]) / np.abs(force).max()
    return "" if off < 0.02 else f"force_top is {off:.3f} off"


def inject(place, fault):
    """What came of it: {status, said, readable, steps, restart, differs, way}."""
    folder = place.work / "struck"
    try:
        return _inject(place, fault, folder)
    finally:
        if os.path.ismount(folder):  # a small disk
            subprocess.run(["umount", "-l", str(folder)], check=True)


def _inject(place, fault, folder):
    reference = place.reference(fault)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    undo = fault.prepare(folder) if fault.prepare else None
    try:
        status, said = _struck(place, fault, folder)
        found = fields(folder)
        rows = history(folder)
    finally:
        if undo:
            undo()
    seen = {"status": status, "said": said[-300:], "rows": len(rows), "readable": found is not None, "in_results": len(steps_in(found))}
    if status == 0:
        differs = same_bits(folder, reference, fault.restored)
        if fault.destroys and differs:
            return {**seen, "way": "went on", "differs": "results were taken away, and the run did not notice"}
        if not differs:
            return {**seen, "way": "went on", "differs": ""}
        if fault.cuts:
            return {**seen, "way": "smaller steps", "differs": near(folder, reference)}
        return {**seen, "way": "went on", "differs": differs}
    clean = Fault(fault.name, fault.case, settings=fault.settings, ranks=fault.ranks)
    existing = ["--restart"] if (folder / "checkpoint.h5").exists() else ["--overwrite"]
    again = subprocess.run(place.command(clean, folder, existing), env=place.environment, capture_output=True, text=True, timeout=LONGEST)
    if fault.destroys and again.returncode in (2, 5):  # 5: "has been removed or changed"
        return {**seen, "way": "noticed", "differs": "", "restart": (again.stdout + again.stderr).strip()[-300:]}
    if again.returncode != 0:
        last = (again.stdout + again.stderr).strip().splitlines()[-1:]
        return {**seen, "way": existing[0], "differs": f"ended with {again.returncode}: {last}"}
    if fault.destroys:
        return {**seen, "way": "noticed", "differs": same_end(folder, reference)}
    left = strays(folder)
    return {**seen, "way": existing[0], "differs": f"left behind: {left}" if left else same_bits(folder, reference)}


def _struck(place, fault, folder):
    """(status, what it said) of the run with the fault."""

    def limit():
        for what, most in fault.limits.items():
            resource.setrlimit(what, (most, most))

    said = place.work / "said.txt"
    with open(said, "w") as out:
        run = subprocess.Popen(place.command(fault, folder, ["--overwrite"]), env={**place.environment, **fault.environment},
                               stdout=out, stderr=out, preexec_fn=limit if fault.limits else None)
        try:
            if fault.strike:
                fault.strike(run, folder)
            status = run.wait(timeout=LONGEST)
        except subprocess.TimeoutExpired:
            run.kill()
            run.wait()
            status = "waits for ever"
    return status, said.read_text(errors="replace").strip()


def children(pid):
    try:
        return [int(p) for t in os.listdir(f"/proc/{pid}/task") for p in Path(f"/proc/{pid}/task/{t}/children").read_text().split()]
    except OSError:
        return []


def program_of(pid):
    try:
        return os.path.basename(os.readlink(f"/proc/{pid}/exe"))
    except OSError:
        return ""


def below(pid):
    """Processes below this one: (pid, name of the executable)."""
    found, todo = [], [pid]
    while todo:
        more = children(todo.pop())
        found += [(child, program_of(child)) for child in more]
        todo += more
    return found


def ranks(run):
    """The run's processes of femxdem, under mpirun or not."""
    return [run.pid] if program_of(run.pid) == "femxdem" else [p for p, name in below(run.pid) if name == "femxdem"]


def workers(run):
    return [p for rank in ranks(run) for p in children(rank) if program_of(p) == "femxdem-worker"]


def trials(run):
    return [p for worker in workers(run) for p in children(worker) if program_of(p) == "femxdem-worker"]


def wait_for(run, what, seconds=120.0):
    """What `what()` finds, once it finds something; None when the run has ended before."""
    until = time.monotonic() + seconds
    while run.poll() is None and time.monotonic() < until:
        if found := what():
            return found
        time.sleep(0.002)
    return None


def kill_one(of, number, rows, delay, rng):
    """A strike: when history.csv has so many rows (-1: at once), and after `delay` seconds, signal `number` for one of of(run)."""

    def strike(run, folder):
        if rows >= 0:
            wait_for(run, lambda: (folder / "history.csv").exists() and len(history(folder)) >= rows)
        time.sleep(delay)
        if found := wait_for(run, lambda: of(run)):
            try:
                os.kill(rng.choice(found), number)
            except ProcessLookupError:  # it has just ended
                pass

    return strike


def after_rows(rows, act):
    """A strike: act(folder) when history.csv has so many rows."""

    def strike(run, folder):
        if wait_for(run, lambda: len(history(folder)) >= rows):
            act(folder)

    return strike


def stop(run):
    run.send_signal(signal.SIGSTOP)
