"""What the campaigns of the paper's boundary value problems share: their rows, what a run cost, a run that is killed and
goes on."""

import json
import os
import re
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass

import campaign
from campaign import ENVIRONMENT, CampaignError

import numpy as np

CLOCKS = ("dem_seconds", "wall_s")  # columns that hold times of the machine


@dataclass(frozen=True)
class Row:
    """A run of a case with settings; `path`: of a single volume element."""

    case: str
    settings: tuple = ()
    text: str = ""
    path: bool = False
    checkpoint_every: int = 10  #: steps; while one is written the states of all points are in memory twice

    def run(self, c, name):
        if self.path:
            return c.path(self.case, name, *self.settings, c.cache)
        return c.run(self.case, name, *self.settings, c.cache, checkpoint_every=self.checkpoint_every)


REPORTS = {
    "restart": "small.toml killed in the middle and gone on: the same bits",
    "report": "table and figures of the rows that have results",
}


def main(home, description, runs, default, restart, report):
    """A campaign of boundary value problems. `runs`: name -> Row; `default`: names that are run when none is given.
    restart: what is said of small.toml in the row of that name, and the setting of its end. report(c) draws the figures of the
    rows that have results and returns the lines of the table, none where there are none."""
    rows = {name: row.text for name, row in runs.items()} | REPORTS
    arguments = campaign.parser(home, description, rows=True).parse_args()

    def work(c):
        for name in arguments.rows or [*default, "restart"]:
            if name == "restart":
                killed_and_restarted(c, "small.toml", name, [restart[1]], kill_after=12, checkpoint_every=5)
            elif name != "report":
                print(f"{name}: {runs[name].run(c, name).last_words()}", flush=True)
        return _report(c, restart[0], report)

    return campaign.main(home, arguments, rows, work, on_meshes=True)


def _report(c, what, report):
    """Table, figures and what the restart has shown; 1 where that has other bits."""
    lines, restart = report(c), bits_of_restart(c, "restart")
    said = ["", restart_line(restart, f"{what}, killed after step 12, gone on from step 10")] if restart else []
    if not lines and not said:
        raise CampaignError(f"{c.runs}: no row has results; run one first")
    if lines:
        c.table(lines + said)
    print(*lines, *said, sep="\n")
    return 1 if restart and restart[1] else 0


def existing(c, names):
    """Name -> Run of those that have a converged step."""
    runs = {name: c.as_it_is(name) for name in names}
    return {name: run for name, run in runs.items() if run and run.steps()}


@dataclass
class Cost:
    steps: int
    evaluations: int
    rejected: int
    dem_steps: float
    wall: float  #: [s]
    core_hours: float  #: the cores that it held, for its wall time
    most: int  #: evaluations of a step
    engine: str


def cost(run):
    """Of a run: from history.csv, and from summary.json where it has ended."""
    h = run.history()
    file = run.folder / "summary.json"
    summary = json.loads(file.read_text()) if file.exists() else {}
    wall = wall_seconds(h["wall_s"]) if "wall_s" in h else summary.get("wall_seconds", 0.0)
    cores = summary.get("ranks", 1) * summary.get("threads", os.cpu_count())
    return Cost(len(h["step"]), int(sum(h["evaluations"])), len(run.rejections()), float(sum(h["dem_steps"])), wall,
                wall * cores / 3600, int(max(h["evaluations"])), summary.get("engine", "?"))


def wall_seconds(column):
    """Of all sittings of a run: each counts from 0 again."""
    ends = np.append(column[1:] < column[:-1], True)
    return float(column[ends].sum())


def how_it_ended(run):
    """Done, or how far and why, without the paths of a machine."""
    if run.status in (0, None):
        return "done" if run.status == 0 else f"unfinished, step {run.steps()}"
    stopped = re.search(r"(stopped after step \d+).*are in [^:]*: ([^;]*)", run.last_words())
    return f"{stopped.group(1)}: {stopped.group(2)}" if stopped else f"exit status {run.status}"


def killed_and_restarted(c, case, name, settings, kill_after, checkpoint_every):
    """Runs a case whole, and once more with a kill (SIGKILL) after `kill_after` steps, from whose last checkpoint it goes on."""
    whole = c.run(case, f"{name}/whole", *settings, c.cache, checkpoint_every=checkpoint_every)
    if whole.status != 0:
        raise CampaignError(f"{whole.folder}: {whole.last_words()}; the restart has nothing to be compared with")

    def start(said):
        folder = c.runs / name / "killed"
        every = [*settings, c.cache, f"output.checkpoint_every={checkpoint_every}"]
        for left in ("history.csv", "checkpoint.h5"):
            (folder / left).unlink(missing_ok=True)
        first = subprocess.Popen(c.command(["run"], case, f"{name}/killed", every), stdout=said, stderr=said, env=ENVIRONMENT, cwd=c.home)
        while first.poll() is None and steps_of(folder) < kill_after:
            time.sleep(0.02)
        if first.poll() is not None:
            raise CampaignError(f"{folder}: ended before step {kill_after}; nothing was killed")
        os.kill(first.pid, signal.SIGKILL)
        first.wait()
        shutil.copy(folder / "history.csv", folder / "history_when_killed.csv")
        again = c.command(["run"], case, f"{name}/killed", every, existing="--restart")
        return subprocess.run(again, stdout=said, stderr=said, env=ENVIRONMENT, cwd=c.home).returncode

    killed = c.once(f"{name}/killed", {"case": (c.home / case).read_text(), "settings": list(settings), "kill": kill_after}, start)
    if killed.status != 0:
        raise CampaignError(f"{killed.folder}: {killed.last_words()}")


def bits_of_restart(c, name):
    """What killed_and_restarted left: (steps compared, columns of history.csv but the clocks that differ), or nothing."""
    whole, killed = (c.as_it_is(f"{name}/{part}") for part in ("whole", "killed"))
    if not whole or not killed or whole.status != 0 or killed.status != 0:
        return None
    one, other = whole.history(), killed.history()
    differ = [key for key in one if key not in CLOCKS and not np.array_equal(one[key], other.get(key))]
    return len(one["step"]), differ


def restart_line(found, what):
    """A sentence for the page on what bits_of_restart found."""
    steps, differ = found
    bits = f"**columns that differ: {', '.join(differ)}**" if differ else "every column but the clocks has the same bits"
    return f"`restart`: {what}: {steps} steps, {bits}."


def strength(one, other):
    """Mohr-Coulomb line through the peaks of the volume element at two confinements: phi [degrees], c / sigma_0; and psi at the
    first one's peak [degrees], sin psi = -(d eps_v / d gamma) over 1 % of strain around it, in plane strain."""
    circles = []
    for run in (one, other):
        h = run.history()
        peak = int(np.argmax(-h["stress_yy"]))
        sigma = np.array([-h["stress_yy"][peak], -h["stress_xx"][peak]]) / 1e5
        circles.append((sigma.sum() / 2, (sigma[0] - sigma[1]) / 2))
    (s1, t1), (s2, t2) = circles
    sin_phi = (t2 - t1) / (s2 - s1)
    phi = np.arcsin(sin_phi)
    cohesion = (t1 - s1 * sin_phi) / np.cos(phi)
    h = one.history()
    peak = int(np.argmax(-h["stress_yy"]))
    a, b = max(peak - 5, 0), min(peak + 5, len(h["step"]) - 1)
    dx, dy = h["strain_xx"][b] - h["strain_xx"][a], h["strain_yy"][b] - h["strain_yy"][a]
    return float(np.degrees(phi)), float(cohesion), float(np.degrees(np.arcsin((dx + dy) / (dx - dy))))


def steps_of(folder):
    """Rows of history.csv so far."""
    file = folder / "history.csv"
    return max(0, file.read_text().count("\n") - 1) if file.exists() else 0
