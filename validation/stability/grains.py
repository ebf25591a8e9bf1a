"""Rows on volume elements in YADE. Each takes the Campaign and returns a Row."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import zlib
from pathlib import Path

import numpy as np

from campaign import ENVIRONMENT, Run
from row import Row

CASE = "grains.toml"
STRAINED = "path=[{strain_xx=0.02,strain_yy=-0.03,strain_zz=0.0,increments=6}]"
SILENT = "ve.max_unbalanced_force=1e9"  # what YADE does by itself
TIME_COLUMNS = ("dem_seconds", "wall_s")


def cache(program, name="packings"):
    return f've.cache="{program.runs / name}"'


def stress(run):
    """Rows of stress_xx, stress_yy, stress_zz [Pa]."""
    history = run.history()
    return np.array([history[f"stress_{c}"] for c in ("xx", "yy", "zz")]).T


def distance(run, reference):
    """Largest difference of the stresses over the largest stress."""
    return float(np.abs(stress(run) - stress(reference)).max() / np.abs(stress(reference)).max())


def prepared(run):
    """The packing that a run took: its state and what is said of it."""
    state = Path(re.search(r"(\S+\.state)$", run.said, re.MULTILINE).group(1))
    return state, json.loads(state.with_suffix(".json").read_text())


def time_step(program):
    """A DEM time step beyond the critical one: YADE says nothing."""
    safe = program.path(CASE, "time_step_safe", STRAINED, cache(program))
    state, manifest = prepared(safe)
    beyond = program.runs / "retimed"
    beyond.mkdir(exist_ok=True)
    factor = 1.5 / 0.8  # to 1.5 times the critical step; ve.time_step_safety is 0.8
    subprocess.run([sys.executable, program.home / "retime.py", state, str(factor), beyond / state.name], check=True, env=ENVIRONMENT,
                   stdout=subprocess.DEVNULL)
    other = (beyond / state.name).read_bytes()
    print_of_it = {"state": f"{len(other)}-{zlib.crc32(other):08x}"}
    (beyond / state.name).with_suffix(".json").write_text(json.dumps(manifest | print_of_it))
    silent = program.path(CASE, "time_step_silent", STRAINED, cache(program, "retimed"), SILENT)
    refused = program.path(CASE, "time_step_refused", STRAINED, cache(program, "retimed"))
    asked = program.path(CASE, "time_step_asked", STRAINED, cache(program), "ve.time_step_safety=1.5")
    off = distance(silent, safe)
    unbalanced = silent.history()["unbalanced_force"][-1]
    return Row(f"1.5 times the critical time step, limit of the unbalanced force off: exit status {silent.status}, stress off by "
               f"{100 * off:.0f} %, unbalanced force {unbalanced:.2g} beside {safe.history()['unbalanced_force'][-1]:.2g}",
               f"the program finds {manifest['time_step']:.3g} s (0.8 of the critical step, from the {manifest['time_step_from']}); "
               f"the state with the larger step: exit status {refused.status}, {refused.reason()}; time_step_safety = 1.5: exit status "
               f"{asked.status}, {asked.said.strip().splitlines()[-1]}",
               {"silent garbage": silent.status == 0 and off > 0.1, "the found step serves": safe.status == 0,
                "the unstable volume element is refused": refused.status == 4 and "unbalanced force" in refused.said,
                "a factor above 1 is refused": asked.status == 2 and "time_step_safety" in asked.said})


def rate(program):
    """A rate so high that inertia enters the stress."""
    quick = ("ve.min_steps=1", "ve.inertial_number=0.3")
    reference = program.path(CASE, "rate_reference", STRAINED, cache(program), "ve.inertial_number=1e-3")
    normal = program.path(CASE, "rate_default", STRAINED, cache(program))
    silent = program.path(CASE, "rate_silent", STRAINED, cache(program), SILENT, *quick)
    refused = program.path(CASE, "rate_refused", STRAINED, cache(program), *quick)
    off, usual = distance(silent, reference), distance(normal, reference)
    report = normal.history()
    return Row(f"inertial number 0.3, limit of the unbalanced force off: exit status {silent.status}, stress off by {100 * off:.0f} %",
               f"the same: exit status {refused.status}, {refused.reason()}; at the default 5e-3 off by {100 * usual:.1f} %, reported "
               f"at every step: inertial number {report['inertial_number'][-1]:.2g}, unbalanced force {report['unbalanced_force'][-1]:.2g}",
               {"inertia spoils the stress silently": silent.status == 0 and off > 0.1,
                "it is refused": refused.status == 4 and "unbalanced force" in refused.said,
                "the default rate is closer by far": normal.status == 0 and usual < 0.1 * off,
                "inertial number and unbalanced force are reported": report["inertial_number"][-1] > 0})


def noise(program):
    """A tolerance below the volume element's own noise, of the stress of its end, as `ve path` measures it."""
    measured = program.path(CASE, "noise", cache(program), "ve.min_steps=40", noise=4)
    level = float(re.search(r"stress noise at most (\S+) of", measured.said).group(1))
    tolerance = f"solver.tolerance={0.1 * level:.1e}"
    run = ("ve.min_steps=40", 've.answer="end"', "control.step=0.02", "control.min_step=0.01", "control.end_time=0.6", tolerance)
    blind = program.run(CASE, "noise_blind", cache(program), *run)
    refused = program.run(CASE, "noise_refused", cache(program), *run, f"solver.noise={level:.1e}")
    return Row(f"{tolerance}: exit status {blind.status} after {blind.steps()} steps: {blind.reason()}",
               f"`femxdem ve path --noise 4` measures {level:.1e}; with solver.noise = {level:.1e}: exit status {refused.status}, "
               f"{refused.said.strip().splitlines()[-1].split(': ', 1)[-1]}",
               {"without the noise the run fails for no visible reason": blind.status == 3,
                "with it the tolerance is refused before the run, with the number": refused.status == 2 and f"{30 * level:.1e}" in refused.said})


def lost_contacts(program):
    """A volume element that loses all its contacts, and one whose cell degenerates."""
    extension = "path=[{strain_xx=0.05,strain_yy=0.05,strain_zz=0.05,increments=20}]"
    apart = program.path(CASE, "apart", extension, cache(program), SILENT)  # the last contacts are out of balance
    flat = program.path(CASE, "flat", "path=[{strain_xx=-4.0,strain_yy=0.0,strain_zz=0.0,increments=40}]", cache(program))
    last, ended = apart.history(), flat.said.strip().splitlines()[-1].rsplit("are in ", 1)[-1].split(": ", 1)[-1]
    return Row(f"5 % of extension without cohesion: {last['contacts'][0]:.0f} contacts become {last['contacts'][-1]:.0f} in "
               f"{apart.steps()} steps; a cell squeezed to exp(-4): YADE ends it in an exception after {flat.steps()} steps",
               f"exit status {apart.status}, {apart.reason()}; exit status {flat.status}, {ended}; all steps before are kept",
               {"no contacts: a failure that says so": apart.status == 4 and "contacts" in apart.reason(),
                "degenerate cell: a failure that says so": flat.status == 4 and "cell" in ended,
                "the steps before are kept": apart.steps() > 1 and flat.steps() > 1})


def crash(program):
    """The engine dies of SIGSEGV in the middle of a trial."""
    settings = (cache(program), 've.engine="yade"', "control.end_time=0.2", "control.step=0.05", "control.max_step=0.05")
    untouched = program.run(CASE, "crash_reference", *settings)
    lost = killed(program, "crash_serialise", 've.snapshot="serialise"', *settings)
    saved = killed(program, "crash_fork", *settings)
    equal = saved.steps() > 0 and same_history(saved, untouched)
    return Row(f"volume elements strained in the process that holds them (ve.snapshot = serialise): exit status {lost.status} after "
               f"{lost.steps()} steps: {lost.said.strip().splitlines()[-1]}",
               f"a fork for each trial: exit status {saved.status}, {saved.said.count('it is repeated')} trials repeated, history.csv "
               f"{'equal to the bit' if equal else 'DIFFERENT'} but for the clock's columns",
               {"in one process the job is lost, and says so": lost.status != 0 and "ended by itself" in lost.said,
                "a killed trial is repeated": saved.status == 0 and "it is repeated" in saved.said,
                "and does not change the result": equal})


def same_history(one, other):
    """Whether two runs have the same history, to the bit but for the clock's columns."""
    a, b = one.history(), other.history()
    return a.keys() == b.keys() and all(np.array_equal(a[k], b[k], equal_nan=True) for k in a if k not in TIME_COLUMNS)


def strains(pid):
    """Whether a process computes; a trial that waits for its verdict sleeps."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "R"
    except OSError:
        return False


def children(pid, executable):
    """Children of a process that run this executable."""
    try:
        ids = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return [int(i) for i in ids if os.readlink(f"/proc/{i}/exe") == str(executable)]
    except OSError:
        return []


def killed(program, name, *settings):
    """A run whose straining process is killed once, after the first step."""
    worker = program.program.with_name("femxdem-worker")
    folder = program.runs / name
    shutil.rmtree(folder, ignore_errors=True)
    process = subprocess.Popen(program.command(["run"], CASE, name, settings), stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                               text=True, env=ENVIRONMENT, cwd=program.home)
    done = False
    while process.poll() is None and not done:
        time.sleep(0.002)
        if not (folder / "history.csv").exists() or (folder / "history.csv").read_text().count("\n") < 2:
            continue
        holders = children(process.pid, worker)
        victims = holders if "serialise" in " ".join(settings) else [c for h in holders for c in children(h, worker)]
        victims = [pid for pid in victims if strains(pid)]
        if victims:
            os.kill(victims[0], signal.SIGSEGV)
            done = True
    said, _ = process.communicate()
    return Run(folder, process.returncode, said, 0.0)


ROWS = {"time_step": time_step, "rate": rate, "noise": noise, "lost_contacts": lost_contacts, "crash": crash}
