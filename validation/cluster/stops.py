#!/usr/bin/python3
"""Stops a run at random moments, by signals and by kill -9, and goes on with other numbers of ranks: the same bits?

    validation/cluster/stops.py [--stops 20] [--seed 1] [--ranks 1 2 4] [--record] [--runs FOLDER] [--femxdem PROGRAM]

For each number of ranks, --stops runs on so many are stopped; each goes on, on another number, until it is stopped or
done. Whoever comes to the end is compared with the run that nobody stopped (same_results.py). A signal goes to every
process of the job, as schedulers send it; kill -9 to one rank, or to all of them. Exit status 1 where a bit differs.
"""

import argparse
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

HOME = Path(__file__).resolve().parent
sys.path.insert(0, str(HOME))
sys.dont_write_bytecode = True

from same_results import differences, rows

ROOT = HOME.parents[1]
RUN_AGAIN = 75
SIGNALS = (signal.SIGTERM, signal.SIGINT, signal.SIGUSR1)
ENVIRONMENT = os.environ | {
    "OMP_NUM_THREADS": "1", "OMPI_MCA_rmaps_base_oversubscribe": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1",
    "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}


@dataclass
class Stop:
    ranks: int
    how: str  #: the signal, "kill -9 of one rank" or "kill -9 of all"
    step: int  #: the last row of history.csv when it came
    status: int  #: of mpirun


class Job:
    """Runs of one case into one folder, each going on from the last."""

    def __init__(self, program, case, folder, settings=()):
        self.program, self.case, self.folder = Path(program).resolve(), Path(case).resolve(), Path(folder).resolve()
        self.settings = [word for setting in settings for word in ("--set", setting)]

    def start(self, ranks):
        how = "--restart" if (self.folder / "checkpoint.h5").exists() else "--overwrite"
        mpi = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
        command = [*mpi, self.program, "run", self.case, "--out", self.folder, how, *self.settings]
        self.folder.mkdir(parents=True, exist_ok=True)
        self.ranks, self.started = ranks, time.time()
        with open(self.folder / "said.txt", "a") as said:
            self.process = subprocess.Popen([str(w) for w in command], stdout=said, stderr=said, env=ENVIRONMENT,
                                            cwd=self.folder.parent)

    def finish(self):
        status = self.process.wait(timeout=600)
        if status not in (0, RUN_AGAIN):
            raise SystemExit(f"{self.folder}: ended with status {status}, see said.txt in it")
        return status

    def members(self):
        """The ranks' processes."""
        pids = [self.process.pid]
        if self.ranks > 1:
            children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children")
            pids = [int(pid) for pid in children.read_text().split()] if children.exists() else []
        return [pid for pid in pids if _executable(pid) == self.program]

    def stop(self, how):
        """Stops it so; what came of it, or None where it was done before."""
        ranks = self.members()
        if self.process.poll() is not None or not ranks:
            return None
        step = len(rows(self.folder))
        if how in SIGNALS:
            for pid in ranks:
                _kill(pid, how)
        else:
            for pid in ranks if how == "all" else [random.choice(ranks)]:
                _kill(pid, signal.SIGKILL)
        status = self.process.wait(timeout=120)
        for pid in ranks:  # mpirun may be gone before they are
            while _executable(pid) == self.program:
                time.sleep(0.01)
        if status == 0:
            return None
        if how in SIGNALS and status != RUN_AGAIN:
            raise SystemExit(f"{self.folder}: {how.name} ended it with status {status}, see said.txt in it")
        name = how.name if how in SIGNALS else f"kill -9 of {how}"
        return Stop(self.ranks, name, step, status)

    def wait_for_history(self):
        """Until it makes steps; false where it ended before."""
        file = self.folder / "log.txt"
        while self.process.poll() is None:
            if file.exists() and file.stat().st_mtime > self.started and re.search(r"(?:start:|restart after).*\n", file.read_text()):
                return True
            time.sleep(0.01)
        return False


def _executable(pid):
    try:
        return Path(os.readlink(f"/proc/{pid}/exe"))
    except OSError:
        return None


def _kill(pid, number):
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        pass


def stop_and_go_on(job, wanted, seconds, counts):
    """Stops one job until it is done, or enough stops are made: `wanted` says how many on each number of ranks."""
    stops = []
    ranks = max(counts, key=lambda n: wanted[n])
    while True:
        job.start(ranks)
        how = random.choice([*SIGNALS, "one", "all"])
        stop = None
        if wanted[ranks] > 0 and job.wait_for_history():
            time.sleep(random.uniform(0, seconds))
            stop = job.stop(how)
        if stop is None:
            if job.finish() == 0:
                return stops
            raise SystemExit(f"{job.folder}: was not told to end, and has")
        wanted[ranks] -= 1
        stops.append(stop)
        others = [n for n in counts if n != ranks] or counts
        ranks = max(others, key=lambda n: (wanted[n], random.random()))


def campaign(program, case, runs, number, counts, settings=()):
    """[(stops, differences)] of the jobs that it took to stop `number` runs on each number of ranks."""
    whole = Job(program, case, runs / "whole", settings)
    whole.start(1)
    if whole.wait_for_history():
        begin = time.time()
    whole.finish()
    seconds = time.time() - begin
    wanted, jobs = dict.fromkeys(counts, number), []
    while any(n > 0 for n in wanted.values()):
        job = Job(program, case, runs / f"job_{len(jobs)}", settings)
        stops = stop_and_go_on(job, wanted, seconds, counts)
        jobs.append((stops, differences(whole.folder, job.folder)))
        print(f"job {len(jobs)}: " + ", ".join(f"{s.how} on {s.ranks} after step {s.step}" for s in stops) + ": " +
              ("; ".join(jobs[-1][1][:3]) or "equal to the bit"), flush=True)
    return jobs


def table(jobs):
    """Stops by kind and ranks."""
    stops = [stop for of_job, _ in jobs for stop in of_job]
    counts = sorted({s.ranks for s in stops})
    lines = ["| stopped by | " + " | ".join(f"on {n}" for n in counts) + " | after steps |", "|---" * (len(counts) + 2) + "|"]
    for how in sorted({s.how for s in stops}):
        of_kind = [s for s in stops if s.how == how]
        steps = ", ".join(str(n) for n in sorted({s.step for s in of_kind}))
        lines.append(f"| {how} | " + " | ".join(str(sum(s.ranks == n for s in of_kind)) for n in counts) + f" | {steps} |")
    struck = [different for of_job, different in jobs if of_job]  # others were over before their stop
    equal = sum(not different for different in struck)
    lines += ["", f"{len(stops)} stops in {len(struck)} jobs, each of which went on on another number of ranks after every stop: "
              f"{equal} of {len(struck)} end with the bits of the run that nobody stopped."]
    return lines


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--stops", type=int, default=20, help="on each number of ranks")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--ranks", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--case", type=Path, default=HOME / "stops.toml")
    parser.add_argument("--runs", type=Path, default=ROOT / "out" / "stops", help="a new folder")
    parser.add_argument("--femxdem", type=Path, default=ROOT / "build" / "release" / "femxdem")
    parser.add_argument("--anew", action="store_true", help="remove what is in that folder")
    parser.add_argument("--record", action="store_true", help="the table into README.md")
    arguments = parser.parse_args()
    random.seed(arguments.seed)
    runs = arguments.runs.resolve()
    if arguments.anew:
        shutil.rmtree(runs, ignore_errors=True)
    if runs.exists() and any(runs.iterdir()):
        raise SystemExit(f"{runs}: holds something; give another --runs, or --anew")
    jobs = campaign(arguments.femxdem, arguments.case, runs, arguments.stops, arguments.ranks,
                    [f've.cache="{runs / "packings"}"'])
    lines = table(jobs)
    print("\n".join(lines))
    if arguments.record:
        page = HOME / "README.md"
        text = re.sub(r"(<!-- stops -->\n).*?(<!-- end of stops -->)", lambda m: m[1] + "\n".join(lines) + "\n" + m[2],
                      page.read_text(), flags=re.DOTALL)
        page.write_text(text)
    return any(different for _, different in jobs)


if __name__ == "__main__":
    sys.exit(main())
