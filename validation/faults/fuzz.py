#!/usr/bin/python3
"""The readers of files that others write, fuzzed: case file, .msh, checkpoint (libFuzzer, AddressSanitizer; clang).

    validation/faults/fuzz.py [READER ...] [--minutes 10] [--record]

Builds preset fuzz, then gives each reader an equal share of the minutes, one after the other, from tests/fuzz/corpus and, for
the checkpoint, that of a run of tests/program/batch_law.toml. What ends a reader is left in --runs; it goes into the corpus,
where every build's tests read it, with its mending. Status 1 where anything has.
"""

import re
import subprocess
import sys
from pathlib import Path

HOME = Path(__file__).resolve().parent
sys.path.insert(0, str(HOME.parent / "tools"))
import campaign
from campaign import ROOT

READERS = {"case": "case file", "msh": "Gmsh's mesh", "checkpoint": "checkpoint"}
LIMITS = ("-timeout=60", "-rss_limit_mb=3000", "-malloc_limit_mb=0", "-detect_leaks=0")  #: a file: 60 s, 3 GB
ENVIRONMENT = campaign.ENVIRONMENT | {"ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1"}  # Gmsh's library leaks


def seeds(c, reader):
    """Files to start from, beside the corpus; words of the case's language."""
    given = ROOT / "tests" / "fuzz" / "corpus" / reader
    if reader == "checkpoint":
        c.run(ROOT / "tests" / "program" / "batch_law.toml", "seed", "control.end_time=0.02", "output.checkpoint_every=1")
        return [given, c.runs / "seed"]
    if reader == "case":
        said = subprocess.run([c.program, "parameters", "--markdown"], capture_output=True, text=True, check=True).stdout
        words = sorted(set(re.findall(r"`([\w.]+)`", said)))
        (c.runs / "case.dict").write_text("".join(f'"{word}"\n' for word in words))
        return [f"-dict={c.runs / 'case.dict'}", given]
    return [given]


def fuzz(c, reader, seconds):
    """{executions, edges, found} of so many seconds; libFuzzer goes on after a crash."""
    folder, executions, covered = c.runs / reader, 0, 0
    (folder / "corpus").mkdir(parents=True, exist_ok=True)
    begin = seeds(c, reader)
    command = [ROOT / "build" / "fuzz" / "tests" / "fuzz" / f"fuzz_{reader}", *LIMITS, f"-max_total_time={seconds:.0f}",
               "-fork=1", "-ignore_crashes=1", "-ignore_timeouts=1", "-ignore_ooms=1", f"-artifact_prefix={folder}/", folder / "corpus", *begin]
    before = set(folder.iterdir())
    with open(folder / "said.txt", "w") as said:
        subprocess.run([str(w) for w in command], stdout=said, stderr=said, env=ENVIRONMENT, cwd=folder)
    text = (folder / "said.txt").read_text(errors="replace")
    for line in re.findall(r"^#(\d+): cov: (\d+)", text, re.MULTILINE):
        executions, covered = int(line[0]), int(line[1])
    found = sorted(f.name for f in set(folder.iterdir()) - before if f.name.startswith(("crash-", "oom-", "timeout-")))
    return {"executions": executions, "edges": covered, "found": found}


def work(c, chosen, minutes):
    subprocess.run(["cmake", "--preset", "fuzz"], cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    subprocess.run(["cmake", "--build", "--preset", "fuzz"], cwd=ROOT, check=True)
    chosen = chosen or list(READERS)
    lines, bad = ["| reader | seconds | executions | edges covered | crashes, hangs, memory |", "|---|---|---|---|---|"], 0
    for reader in chosen:
        seen = fuzz(c, reader, 60 * minutes / len(chosen))
        bad += len(seen["found"])
        lines.append(f"| {READERS[reader]} | {60 * minutes / len(chosen):.0f} | {seen['executions']} | {seen['edges']} | {len(seen['found'])} |")
        print(lines[-1], *seen["found"], sep="\n", flush=True)
        c.table(lines, mark="fuzz")
    return 1 if bad else 0


if __name__ == "__main__":
    options = campaign.parser(HOME, __doc__, rows=True)
    options.add_argument("--minutes", type=float, default=10)
    given = options.parse_args()
    sys.exit(campaign.main(HOME, given, READERS, lambda c: work(c, given.rows, given.minutes)))
