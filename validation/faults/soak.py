#!/usr/bin/python3
"""Runs under a fault every few seconds: memory, processes, shared memory and temporary files that they leave behind.

    validation/faults/soak.py [--minutes 30] [--femxdem PROGRAM] [--runs FOLDER]

One run in YADE's engine goes on and on, its trials killed by SIGSEGV or SIGKILL; a trial that has become the committed state in the
moment of its kill was the worker, and the run ends with status 4: it goes on from its checkpoint. Beside it runs on a closed-form law are
killed within a write and started again. Says one line a minute, and at the end the slope of the memory of the long run's rank and worker
(least squares over the samples of the longest time without a restart, but the first five steps), zombies below it, and what is new in /dev/shm, the temporary folder and
the results. Fields are written every hundred steps: HDF5 keeps up to some 40 MB of an open file's index. Status 1 where something is left.
"""

import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HOME = Path(__file__).resolve().parent
sys.path.insert(0, str(HOME.parent / "tools"))
import campaign
import injections
import run as faults

MOST = 1.0  # MB/min: what a committed process may grow by; its pages are copied anew at each trial


def proportional_size(pid):
    """Of a process [MB]; nothing once it has ended."""
    try:
        words = next(line for line in open(f"/proc/{pid}/smaps_rollup") if line.startswith("Pss:")).split()
        return int(words[1]) / 1024
    except (OSError, StopIteration):
        return None


def state_of(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return ""


def slope(samples):
    """MB/min of [(s, MB), ...]."""
    n = len(samples)
    if n < 3:
        return 0.0
    t, m = sum(s for s, _ in samples) / n, sum(v for _, v in samples) / n
    return 60 * sum((s - t) * (v - m) for s, v in samples) / sum((s - t) ** 2 for s, _ in samples)


def temporary():
    """What programs of ours could leave outside of their folder."""
    return {str(f) for folder in ("/dev/shm", tempfile.gettempdir()) for f in Path(folder).glob("*")
            if any(word in f.name for word in ("femxdem", "yade", "ompi"))}


class LongRun:
    """A run of volume elements in YADE that ends only when it is told to."""

    def __init__(self, place):
        self.place, self.folder = place, place.work / "long"
        self.said = open(place.work / "long.txt", "w")
        self.killed, self.struck, self.zombies, self.restarts, self.started = 0, 0, 0, 0, time.monotonic()
        self.longest = {"rank": [], "worker": []}
        self.start("--overwrite", 0)

    def start(self, existing, done):
        settings = ("control.end_time=20", "control.step=1e-4", "control.max_step=1e-4", "output.every=100")
        command = self.place.command(injections.Fault("long", "yade", settings=settings), self.folder, [existing])
        self.process = subprocess.Popen(command, env=self.place.environment, stdout=self.said, stderr=self.said)
        injections.wait_for(self.process, lambda: len(injections.history(self.folder)) >= done + 5, 600)
        self.samples = {"rank": [], "worker": []}

    def keep_longest(self):
        """Samples of the longest time without a restart."""
        time_of = lambda samples: samples[-1][0] - samples[0][0] if samples else 0.0
        self.longest = {name: max(self.longest[name], self.samples[name], key=time_of) for name in self.samples}

    def strike(self, rng):
        """Once a step: two kills of one trial are a failed point, and a busy machine takes long for a trial."""
        trials, steps = injections.trials(self.process), len(injections.history(self.folder))
        if trials and steps > self.struck:
            try:
                injections.os.kill(trials[0], rng.choice((signal.SIGSEGV, signal.SIGKILL)))
                self.killed, self.struck = self.killed + 1, steps
            except ProcessLookupError:
                pass

    def sample(self):
        now = time.monotonic() - self.started
        if self.process.poll() == 4 and "its volume elements are lost" in Path(self.said.name).read_text().splitlines()[-1]:
            self.restarts += 1
            self.keep_longest()
            self.struck = len(injections.history(self.folder))
            self.start("--restart", self.struck)
        if self.process.poll() is not None:
            raise SystemExit(f"{self.folder}: the long run has ended with status {self.process.returncode}, see {self.said.name}")
        workers = injections.workers(self.process)
        for name, pid in (("rank", self.process.pid), ("worker", workers[0] if workers else 0)):
            if size := proportional_size(pid):
                self.samples[name].append((now, size))

    def end(self):
        self.keep_longest()
        time.sleep(1)
        dead = [pid for pid, _ in injections.below(self.process.pid) if state_of(pid) == "Z"]
        time.sleep(1)
        self.zombies = sum(state_of(pid) == "Z" for pid in dead)  # one that has just been killed is none
        below = [pid for pid, _ in injections.below(self.process.pid)]
        self.process.kill()
        self.process.wait()
        time.sleep(2)
        return [pid for pid in below if state_of(pid) not in ("", "Z")]


def work(c, minutes):
    rng, place, before = random.Random(faults.SEED), faults.place_of(c), temporary()
    long, began, said, runs, wrong = LongRun(place), time.monotonic(), 0, 0, 0
    while time.monotonic() - began < 60 * minutes:
        for _ in range(5):
            time.sleep(rng.uniform(0.2, 1.5))
            long.strike(rng)
            long.sample()
        fault = faults.at_a_call(place, rng, runs, rng.choice(("KILL", "TEAR", "ENOSPC")))
        wrong += bool(injections.inject(place, fault)["differs"])
        runs += 1
        if time.monotonic() - began > 60 * said:
            said += 1
            print(f"{said - 1} min: {long.killed} trials killed, {len(injections.history(long.folder))} steps, {runs} runs struck, "
                  f"{wrong} wrong, {long.samples['rank'][-1:]} {long.samples['worker'][-1:]}", flush=True)
    alive = long.process.poll() is None
    steps, left = len(injections.history(long.folder)), long.end()
    slopes = {name: slope(samples) for name, samples in long.longest.items()}
    new = sorted(temporary() - before)
    strays = injections.strays(place.work / "struck")
    lines = ["| minutes | trials killed | of which had become the worker: restarts | steps of the long run | runs struck | wrong | memory of rank, worker [MB/min] | zombies | processes left | new in /dev/shm and temporary folder | strays beside results |",
             "|---|---|---|---|---|---|---|---|---|---|---|",
             f"| {minutes:g} | {long.killed} | {long.restarts} | {steps} | {runs} | {wrong} | {slopes['rank']:.2f}, {slopes['worker']:.2f} | {long.zombies} | {len(left)} | {len(new)} | {len(strays)} |"]
    print("\n".join(lines), new, strays, sep="\n")
    c.table(lines, mark="soak")
    left_by_kills = len(new) > long.restarts  # YADE's folder of a worker that was killed
    return 0 if alive and not (wrong or left or left_by_kills or strays or long.zombies) and max(slopes.values()) < MOST else 1


if __name__ == "__main__":
    options = campaign.parser(HOME, __doc__)
    options.add_argument("--minutes", type=float, default=30)
    given = options.parse_args()
    sys.exit(campaign.main(HOME, given, {"soak": ""}, lambda c: work(c, given.minutes)))
