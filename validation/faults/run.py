#!/usr/bin/python3
"""Faults injected into runs at instants drawn by seed: what goes on, what ends with which status, and what is lost.

    validation/faults/run.py [KIND ...] [--times X] [--record]

Every injection is a run with one fault, then, where it has ended, the same run without it from its checkpoint; the end is
compared with the run that nothing has struck, to the bit (injections.py). Disks, files and kills within a write run on a
closed-form law (2 x 4 elements, 6 steps), processes on volume elements of 40 spheres in either engine.
"""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

HOME = Path(__file__).resolve().parent
sys.path.insert(0, str(HOME.parent / "tools"))
import campaign
import injections
from injections import Fault, after_rows, kill_one, ranks, trials, workers

SEED = 17
FILES = ("running.lock", "case.toml", "history.csv", "log.txt", "results.h5", "results.xdmf", "checkpoint.h5", "summary.json")
KINDS = {}


def kind(name, count, what):
    def note(make):
        KINDS[name] = (count, what, make)
        return make

    return note


def of_file(place, name, do, program="femxdem"):
    """Environment in which the calls that write this file are struck."""
    return {"LD_PRELOAD": str(place.runs / "interpose.so"), "FAULT_PROGRAM": program, "FAULT_FILE": f"/struck/{name}", "FAULT_DO": do}


def calls(place, name):
    """Calls of a whole run that write this file."""
    if name not in place.calls:
        out, environment = place.work / "count.txt", of_file(place, name, "COUNT") | {"FAULT_COUNT": str(place.work / "count.txt")}
        folder = place.work / "struck"
        subprocess.run(["rm", "-rf", str(folder)], check=True)
        subprocess.run(place.command(Fault("count"), folder, ["--overwrite"]), env={**place.environment, **environment},
                       stdout=subprocess.DEVNULL, check=True)
        place.calls[name] = int(out.read_text())
    return place.calls[name]


def at_a_call(place, rng, k, do):
    """A fault at a call drawn among those of one of the files, which take turns."""
    name = FILES[k % len(FILES)]
    at = rng.randint(1, max(calls(place, name), 1))
    return Fault(f"{name}, call {at}", environment=of_file(place, name, do) | {"FAULT_AT": str(at)})


@kind("disk_full", 40, "a file cannot be written from one call on: no space left")
def disk_full(place, rng, k):
    return at_a_call(place, rng, k, "ENOSPC")


@kind("disk_error", 16, "the same: input/output error")
def disk_error(place, rng, k):
    return at_a_call(place, rng, k, "EIO")


@kind("disk_small", 12, "results on a tmpfs of 20 to 900 kB")
def disk_small(place, rng, k):
    size = rng.randint(20, 900)

    def prepare(folder):
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k", "none", str(folder)], check=True)
        return lambda: (subprocess.run(["mount", "-o", "remount,size=50m", str(folder)], check=True),)

    return Fault(f"{size} kB", prepare=prepare)


@kind("killed_in_write", 48, "SIGKILL before a call that writes a file")
def killed_in_write(place, rng, k):
    return at_a_call(place, rng, k, "KILL")


@kind("torn_write", 24, "SIGKILL when half of a call's bytes are written")
def torn_write(place, rng, k):
    return at_a_call(place, rng, k, "TEAR")


@kind("file_taken", 20, "a file of the run removed, emptied, replaced or made read-only in mid-run")
def file_taken(place, rng, k):
    name, rows = ("results.h5", "history.csv", "checkpoint.h5", "log.txt", "results.xdmf")[k % 5], rng.randint(1, 4)
    how = ("removed", "emptied", "read-only", "another")[k // 5 % 4]

    def act(folder):
        file, until = folder / name, time.monotonic() + 10
        while not file.exists() and time.monotonic() < until:  # a first checkpoint follows its row
            time.sleep(0.001)
        if how == "removed":
            file.unlink(missing_ok=True)
        elif how == "emptied":
            os.truncate(file, 0)
        elif how == "another":
            file.unlink(missing_ok=True)
            file.write_text("something else\n")
        else:  # a bind mount that is read-only: permissions do not hold root
            subprocess.run(["mount", "--bind", str(file), str(file)], check=True)
            subprocess.run(["mount", "-o", "remount,ro,bind", str(file)], check=True)

    def prepare(folder):
        return lambda: subprocess.run(["umount", "-l", str(folder / name)], check=False, stderr=subprocess.DEVNULL)

    short = ("output.checkpoint_every=1", "control.step=0.005")  # 24 steps: what is taken after the last one cannot be noticed
    return Fault(f"{name} {how} after {rows}", settings=short, strike=after_rows(rows, act), prepare=prepare,
                 destroys=name in ("results.h5", "history.csv") and how != "read-only")


@kind("clock_back", 4, "the clock of the day goes back by an hour to a year")
def clock_back(place, rng, k):
    back = rng.choice((3600, 86400, 31536000))
    environment = of_file(place, "none", "CLOCK") | {"FAULT_CLOCK": str(back), "FAULT_AT": str(rng.randint(0, 200))}
    return Fault(f"by {back} s", case=("law", "compact")[k % 2], environment=environment)


@kind("memory", 8, "no more memory: a limit of the address space; fork refused")
def memory(place, rng, k):
    case = ("law", "compact", "yade", "yade")[k % 4]
    if k % 4 == 3:
        environment = {"LD_PRELOAD": str(place.runs / "interpose.so"), "FAULT_PROGRAM": "femxdem-worker", "FAULT_FORK": str(rng.randint(1, 12))}
        return Fault("fork refused", case, environment=environment, restored=True)
    most = rng.randint(*{"law": (250, 700), "compact": (400, 2500), "yade": (400, 2500)}[case]) << 20
    return Fault(f"{most >> 20} MB", case, limits={resource.RLIMIT_AS: most})


def at_random(of, numbers, cases, place, rng, k, ranks_=1):
    number, case = numbers[k % len(numbers)], cases[k // len(numbers) % len(cases)]
    strike = kill_one(of, number, rng.randint(-1 if of is not trials else 0, 3), rng.uniform(0, 0.2), rng)
    return Fault(f"{signal.Signals(number).name} of {of.__name__}, {case}", case, strike=strike, ranks=ranks_)


@kind("trial_killed", 12, "SIGSEGV or SIGKILL of a trial (engine yade)")
def trial_killed(place, rng, k):
    return at_random(trials, (signal.SIGSEGV, signal.SIGKILL), ("yade",), place, rng, k)


@kind("worker_killed", 8, "SIGSEGV or SIGKILL of a rank's worker")
def worker_killed(place, rng, k):
    return at_random(workers, (signal.SIGSEGV, signal.SIGKILL), ("yade", "compact"), place, rng, k, 1 + k // 4 % 2)


@kind("rank_killed", 8, "SIGSEGV or SIGKILL of a rank, of one or two")
def rank_killed(place, rng, k):
    return at_random(ranks, (signal.SIGSEGV, signal.SIGKILL), ("yade", "compact"), place, rng, k, 1 + k // 4 % 2)


@kind("ve_fails", 8, "a VE once raises, answers NaN, ends its process or dies of a signal")
def ve_fails(place, rng, k):
    what = ("raise", "nan", "exit", "segv", "kill", "memory", "print", "raise")[k % 8]
    return in_a_ve(place, rng, what, k)


@kind("ve_hangs", 2, "a VE once sleeps or works for ever")
def ve_hangs(place, rng, k):
    return in_a_ve(place, rng, ("hang", "loop")[k % 2], k)


@kind("ve_always_fails", 2, "from one trial on, VEs raise or answer NaN every time")
def ve_always_fails(place, rng, k):
    return in_a_ve(place, rng, ("raise", "nan")[k % 2], k, always=True)


def in_a_ve(place, rng, what, k, always=False):
    mark = "always" if always else str(place.work / "struck_once")
    at = rng.randint(40, 250)  # of some 400 calls; the first ones are the template's own

    def prepare(folder):
        Path(place.work / "struck_once").unlink(missing_ok=True)

    environment = {"PYTHONPATH": str(HOME / "hooks"), "FAULT_VE": f"{what} {at} {mark}"}
    return Fault(f"{what} at call {at}", "yade", environment=environment, prepare=prepare, cuts=what in ("raise", "nan", "memory"))


def place_of(c):
    short = ("ve.spheres=40", "control.end_time=0.08", c.cache, "ve.threads=1", "output.checkpoint_every=2")
    cases = {"law": (HOME / "../../tests/program/batch_law.toml", ("control.end_time=0.12",)),
             "compact": (HOME / "case.toml", (*short, 've.engine="compact"')),
             "yade": (HOME / "case.toml", (*short, 've.engine="yade"', "ve.sorted_contacts=true"))}
    place = injections.Place(c.program, c.runs, campaign.ENVIRONMENT, cases)
    place.calls = {}
    subprocess.run(["cc", "-O1", "-shared", "-fPIC", "-o", str(c.runs / "interpose.so"), str(HOME / "interpose.c"), "-ldl"], check=True)
    return place


def work(c, chosen, times):
    place, lines, bad = place_of(c), [], 0
    lines += ["| kind | what | injected | went on, same bits | smaller steps | ended, status | then from the checkpoint / anew, same bits | noticed | steps lost | data lost | wrong |",
              "|---|---|---|---|---|---|---|---|---|---|---|"]
    for name in chosen or KINDS:
        count, what, make = KINDS[name]
        found = []
        for k in range(max(1, round(count * times))):
            rng = random.Random(f"{SEED} {name} {k}")
            fault = make(place, rng, k)
            seen = c.value(f"injections/{name}_{k:03d}", [fault.name, fault.case, SEED], lambda: injections.inject(place, fault))
            found.append(seen)
            if seen["differs"] or seen["status"] in ("waits for ever", -signal.SIGABRT):
                bad += 1
                print(f"{name} {k}: {fault.name}: {seen}", flush=True)
        lines.append(row(name, what, found))
        print(lines[-1], flush=True)
        c.table(lines)
    return 1 if bad else 0


def row(name, what, found):
    ways = lambda way: sum(f["way"] == way and not f["differs"] for f in found)
    statuses = sorted({str(f["status"]) for f in found if f["status"] != 0})
    ended = sum(f["status"] != 0 for f in found)
    wrong = sum(bool(f["differs"]) for f in found)
    steps = sum(f["differs"].startswith("history.csv") for f in found)
    lost = sum(f["rows"] > 0 and not f["readable"] and f["way"] != "noticed" for f in found)  # there the fault itself took it
    return (f"| {name} | {what} | {len(found)} | {ways('went on')} | {ways('smaller steps')} | {ended} ({', '.join(statuses)}) | "
            f"{ways('--restart')} / {ways('--overwrite')} | {ways('noticed')} | {steps} | {lost} | {wrong} |")


if __name__ == "__main__":
    options = campaign.parser(HOME, __doc__, rows=True)
    options.add_argument("--times", type=float, default=1.0, help="so many times as many injections")
    given = options.parse_args()
    sys.exit(campaign.main(HOME, given, {n: f"{c:3} {w}" for n, (c, w, _) in KINDS.items()}, lambda c: work(c, given.rows, given.times)))
