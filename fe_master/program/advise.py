#!/usr/bin/python3
"""Advice before a run, from short probes of its volume element.

    femxdem advise CASE.toml [--error 0.05] [--band METRES] [--write FILE] [--out DIR] [--set section.key=value]

Strains single volume elements along the case's [[path]], or along one that its loads tell, with one thing changed at a time,
and says: rate, time step, spheres, increment and tolerance for a wanted error of the curve, whether the material softens and
what that asks for, the cost of the run, and what the scene does not need. --write: the case file with the advice in it.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

from advice import (
    CHECKPOINT_FACTOR, ELEMENTS_FOR_FORCE, ELEMENTS_FOR_WIDTH, ENDS, Differences, band_thickness, cost_of_run, eased_by, elastic_until,
    loading_path, mean_path, modulus_for, path_of, rate_for, scatter, scatter_constant, softening, spheres_for,
    stops_rising, strained_share, toml_value, tolerance_for, with_values,
)
from results import ResultsError, read_history

SIZES, PACKINGS = (100, 400), 3  # of the scatter
RATES = (2e-2, 1e-2, 5e-3)
LOOSE = 3e-2  # tolerance of probes that do not go through at the case's
BUSIEST = 8  # trial of the busiest point over the mean one past the peak


class AdviceError(Exception):
    """What is wrong, where, and what to do: one sentence."""


class Probes:
    """Single volume elements of a case on its path, each run once."""

    def __init__(self, program, case, file, folder):
        self.program, self.folder = program, folder
        self.path = loading_path(case)
        ve = {k: v for k, v in case.get("ve", {}).items() if k not in ("region", "seeds", "assignment", "assignment_seed")}
        if case.get("ve", {}).get("seeds"):
            ve["seed"] = case["ve"]["seeds"][0]
        for key in ("script", "scene"):
            if key in ve:
                ve[key] = str((file.parent / ve[key]).resolve())
        ve.setdefault("cache", str(folder / "packings"))
        tables = [("[material]", {"type": "volume_element"}), ("[ve]", ve), *(("[[path]]", s) for s in self.path)]
        self.file = folder / "probe.toml"
        self.file.write_text("\n".join(
            [head + "\n" + "\n".join(f"{k} = {toml_value(v)}" for k, v in values.items()) for head, values in tables]) + "\n")
        self.manifest, self.summary, self.effective, self.paths = {}, {}, {}, {}
        self.solver = []  # settings of its steps

    def run(self, name, coarser=1, **ve):
        """The Path of the case's volume element with other values of [ve], in increments `coarser` times as large."""
        asked = (coarser, *sorted(ve.items()))
        if asked not in self.paths:
            self.paths[asked] = self._run(name, coarser, ve)
        return self.paths[asked]

    def first(self, tolerance):
        """The Path of the volume element as it is, at the case's tolerance or, where it does not follow the path to its end, at
        one that is looser for all probes. Raises AdviceError where that does not help."""
        for self.solver in ([] if tolerance == 5e-3 else [f"solver.tolerance={tolerance:g}"], [f"solver.tolerance={LOOSE:g}"]):
            self.paths.clear()
            path = self.run("as_it_is")
            if self.reached > 0.95:
                return path
        raise AdviceError(f"its volume element follows {self.reached:.0%} of the path: {self.summary['message']}; mend that first")

    def _run(self, name, coarser, ve):
        folder = self.folder / name
        sets = [f"ve.{k}={toml_value(v)}" for k, v in {"threads": 1, **ve}.items()] + self.solver
        sets += [f"path.{k}.increments={max(1, round(s.get('increments', 50) / coarser))}" for k, s in enumerate(self.path)]
        said = _start([self.program, "ve", "path", self.file, "--out", folder, "--overwrite", *_settings(sets)])
        if said.returncode not in (0, 3):
            raise AdviceError(f"the probe {name} ended: {(said.stderr.strip() or said.stdout.strip()).splitlines()[-1]}")
        state = re.search(r"(\S+)\.state", said.stdout)
        self.engine = (re.findall(r"^engine: (.*)$", said.stdout + _log(folder), re.MULTILINE) or ["?"])[-1]
        self.manifest = json.loads(Path(state.group(1) + ".json").read_text())
        self.summary = json.loads((folder / "summary.json").read_text())
        self.effective = tomllib.loads((folder / "case.toml").read_text())
        history = read_history(folder)
        self.reached = float(history["load_factor"][-1])
        if self.reached < 0.5 and self.paths:
            raise AdviceError(f"the probe {name} ended {self.reached:.0%} along the path: {self.summary['message']}")
        ve = self.effective["ve"]
        path = path_of(history, ve["inertial_number"])
        if any(key.startswith("stress") for segment in self.path for key in segment):
            path.eased = eased_by(path, history["evaluations"], self.manifest["spheres"], ve["inertial_number"], self.effective["solver"]["tolerance"])
        print(f"  {name}: {path.dem_steps} DEM steps of {1e6 * path.step_seconds:.0f} us", flush=True)
        return path


def _log(folder):
    file = folder / "log.txt"
    return file.read_text() if file.exists() else ""


def _start(words):
    return subprocess.run([str(w) for w in words], capture_output=True, text=True)


def _settings(sets):
    return [word for setting in sets for word in ("--set", setting)]


class Advice:
    """What is said, by topic, and the values that go into the case."""

    def __init__(self):
        self.lines, self.values, self.numbers = [], {}, {}

    def say(self, topic, text, **values):
        self.lines.append((topic, text))
        self.values.update({tuple(k.split("__")): v for k, v in values.items()})

    def __str__(self):
        return "\n".join(f"{topic:12} {text}" for topic, text in self.lines)


def percent(x):
    return f"{100 * x:.2g} %"


def advise(case, file, program, folder, error, band, sets):
    """The Advice on a case (dictionary) of that file and values of --set."""
    points, answers = checked(program, case, file, sets)
    probes, said = Probes(program, case, file, folder), Advice()
    given = case.get("solver", {}).get("tolerance", 5e-3)
    base = probes.first(given)
    manifest, engine, ve = probes.manifest, probes.summary["engine"], probes.effective["ve"]
    spheres = manifest["spheres"]
    if f"solver.tolerance={LOOSE:g}" in probes.solver:
        said.say("probes", f"its volume element follows the path only with {probes.solver[0]}: differences below that tell nothing")
    packings = say_spheres(said, probes, error, spheres, ve["source"] == "prepare")
    compared = lambda name, **changes: mean_path([probes.run(f"{name}_{k}", **p, **changes) for k, p in enumerate(packings)])
    usual = compared("usual")
    strained = max(1.0, points * share_strained(case))
    off = say_time_step(said, compared, usual, base, manifest, ve, strained)
    limit = max(0.4 * error, off.noise[0] / strained**0.5)
    rate = say_rate(said, compared, usual, limit, ve["inertial_number"], off)
    factor = say_increment(said, compared, usual, limit, case, off)
    tolerance, of_tolerance = tolerance_for(max(error / 2, 0.0025))
    said.numbers["tolerance"] = of_tolerance
    said.say("tolerance", f"solver.tolerance = {tolerance:g} errs by {percent(of_tolerance)} (this case: {given:g})",
             solver__tolerance=tolerance)
    say_softening(said, case, base, band, ve)
    say_not_needed(said, compared, usual, base, ve, limit, manifest["moments"] and ve["moments"], probes.engine, off)
    if points:
        own = predicted(base, case, points, spheres, ve["inertial_number"], given, ve["min_steps"], engine, answers)
        say_cost(said, "as it is", own, points)
        said.numbers["cost"] = {**vars(own), "core_hours": own.core_hours}
        advised = said.values.get(("ve", "spheres"), spheres)
        path = probes.run("increment_advised", coarser=factor) if factor > 1 else base
        slower = replace(path, steps_needed=path.steps_needed * ve["inertial_number"] / rate)
        larger = advised / spheres
        _, answers = checked(program, case, file, [*sets, f"ve.inertial_number={rate:g}"])
        cost = predicted(slower, case, points, advised, rate, tolerance, ve["min_steps"], engine, answers, larger)
        say_cost(said, "as advised", cost, points)
    return said


def say_spheres(said, probes, error, spheres, prepared):
    """Says how many; the settings of the packings on whose mean curve other settings are compared."""
    if not prepared:
        said.say("spheres", f"{spheres}, of the script or scene: one packing, whose scatter is not known")
        return [{}]
    made = {n: [{"spheres": n, "seed": s} for s in range(1, PACKINGS + 1)] for n in SIZES}
    found = {n: (scatter([probes.run(f"{n}_spheres_{k}", **p) for k, p in enumerate(made[n])]), PACKINGS) for n in SIZES}
    constant = scatter_constant(found)
    said.numbers["scatter"] = constant / spheres**0.5
    wanted = spheres_for(0.8 * error, constant)
    measured = ", ".join(f"{percent(s)} at {n}" for n, (s, _) in found.items())
    more = ", which is more than it asks for" if spheres > wanted else ""
    said.say("spheres", f"ve.spheres = {wanted}: a packing scatters by {measured} ({PACKINGS} packings each), so by "
             f"{percent(constant / wanted**0.5)} there, by {percent(constant / spheres**0.5)} at this case's {spheres}{more}",
             ve__spheres=wanted)
    return made[SIZES[-1]]


def say_rate(said, compared, usual, limit, own, off_by):
    """Says the rate; the inertial number that it advises."""
    paths = {i: usual if i == own else compared(f"rate_{i:g}", inertial_number=i) for i in sorted({own, *RATES}, reverse=True)}
    rate, slowest = rate_for(limit, paths, off_by), min(paths)
    off = said.numbers["rate"] = {f"{i:g}": off_by(p, paths[slowest]) for i, p in paths.items() if i != slowest}
    measured = ", ".join(f"{percent(e)} at {i}" for i, e in off.items())
    said.say("rate", f"ve.inertial_number = {rate:g}: against {slowest:g} the curve is off by {measured}; {percent(limit)} is what "
             "the error allows, or what cannot be told apart", ve__inertial_number=rate)
    return rate


def say_time_step(said, compared, usual, base, manifest, ve, strained):
    """Says the time step; the Differences that half of it tells: a stable one is exact enough, so that what it moves is how far grains
    go other ways for no reason, which the strained points of a body average out."""
    safety = ve["time_step_safety"]
    text = f"{manifest['time_step']:.3g} s, from {manifest['time_step_from']}"
    if "contact network" in manifest["time_step_from"]:
        text += f": {safety:g} of the critical {manifest['time_step'] / safety:.3g} s"
    finer = compared("half_the_time_step", time_step_safety=safety / 2)
    off = Differences(usual, finer, strained)
    said.numbers["time_step"] = off(usual, finer)
    said.say("time step", f"{text}; half of it moves the curve of one volume element by {percent(off.noise[0])}, as any small change does, that of "
             f"{strained:.0f} strained points by {percent(said.numbers['time_step'])}; largest unbalanced force {base.unbalanced:.1e}, limit {ve['max_unbalanced_force']:g}")
    return off


def say_increment(said, compared, usual, limit, case, off_by):
    """Says the increment; its size over the case's."""
    finer, coarser = compared("half_the_increment", coarser=0.5), compared("twice_the_increment", coarser=2)
    off = {1: off_by(usual, finer), 2: off_by(coarser, finer)}
    said.numbers["increment"] = off[2]
    factor = 2 if off[2] <= limit else 1
    own = case.get("control", {}).get("max_step", case.get("control", {}).get("step"))
    values = {"control__step": factor * own, "control__max_step": factor * own} if own else {}
    name = f"control.max_step = {factor * own:g} s" if own else f"{factor} times the path's"
    said.say("increment", f"{name}: against half of this case's the curve is off by {percent(off[1])}, at twice by "
             f"{percent(off[2])}", **values)
    return factor


def say_softening(said, case, base, band, ve):
    peak, fall = softening(base)
    element, sigma_0 = case.get("element", {}), ve["confining_stress"]
    if stops_rising(base) > 0.8 * base.strain[-1]:
        said.say("softening", "none: the stress rises to the path's end; 8-node elements (element.type = \"q8\") do")
        return
    gradient = element.get("type") == "second_gradient"
    said.say("softening", f"the stress stops rising at a strain of {percent(stops_rising(base))} and falls by "
             f"{percent(fall)} from its peak at {percent(peak)}: bands of q8 elements are one element wide; "
             + ("the second gradient is there" if gradient else "element.type = \"second_gradient\" with D"),
             **({} if gradient else {"element__type": "second_gradient"}))
    D = modulus_for(band, sigma_0) if band else element.get("D") or modulus_for(0.3, sigma_0)
    thickness = band_thickness(D, sigma_0)
    values = {"element__D": float(f"{D:.4g}")} if band or not element.get("D") else {}
    said.say("band", f"element.D = {D:.4g} N: {thickness:.2g} m thick, as sqrt(D), within a third; elements of at most "
             f"{thickness / ELEMENTS_FOR_FORCE:.2g} m for the force, {thickness / ELEMENTS_FOR_WIDTH:.2g} m for the thickness", **values)


def say_not_needed(said, compared, usual, base, ve, limit, moments, engine, off_by):
    if ve["source"] == "prepare" and ve["contact_law"] != "friction":
        if ve["cohesion"] == 0:
            said.say("not needed", "cohesion: ve.cohesion is 0, ve.contact_law = \"friction\" is the same and cheaper",
                     ve__contact_law="friction")
        else:
            off = off_by(compared("without_cohesion", contact_law="friction", cohesion=0.0), usual)
            values = {"ve__contact_law": "friction", "ve__cohesion": 0.0} if off <= limit else {}
            said.say("not needed" if values else "needed", f"cohesion: without it the curve is off by {percent(off)}; "
                     f"{percent(base.adhesive)} of the contacts adhere at the end", **values)
    if moments:
        without = compared("without_moments", moments=False)
        off = off_by(without, usual)
        values = {"ve__moments": False} if off <= limit else {}
        said.numbers["moments"] = off
        said.say("not needed" if values else "needed", f"moments of the contacts: without them the curve is off by "
                 f"{percent(off)}, and a DEM step takes {1e6 * without.step_seconds:.0f} us instead of {1e6 * base.step_seconds:.0f}", **values)
    said.say("elastic", f"points whose strain stays below {percent(elastic_until(base))} (secant stiffness above 0.8 of the first)")
    said.say("engine", engine)


def share_strained(case):
    """Of a body in which one band takes the strain; 1 where its mesh is no rectangle."""
    mesh = case.get("mesh", {})
    if mesh.get("type", "rectangle") != "rectangle" or "height" not in mesh:
        return 1.0
    D, sigma_0 = case.get("element", {}).get("D"), case.get("ve", {}).get("confining_stress", 1e5)
    return strained_share(band_thickness(D, sigma_0) if D else 1.5 * mesh["height"] / mesh["ny"], mesh["height"])


def predicted(path, case, points, spheres, rate, tolerance, min_steps, engine, answers, larger=1.0):
    """Cost of the run of `case`; larger: spheres of the run over those of the Path."""
    return cost_of_run(path, points, spheres, rate, tolerance, min_steps, share_strained(case), larger * path.step_seconds,
                       engine == "compact", answers)


def say_cost(said, name, cost, points):
    said.say(name, f"{cost.evaluations:.0f} evaluations, {cost.dem_steps:.2e} DEM steps, {cost.core_hours:.2g} core hours, "
             f"{cost.bytes / 1e9:.2g} GB ({cost.bytes * CHECKPOINT_FACTOR / 1e9:.2g} GB while a checkpoint is written), up to "
             f"{cost.ranks_that_pay(points, BUSIEST)} cores pay")


def checked(program, case, file, sets):
    """Material points of the case's mesh, 0 for a case without loads, and what its run answers with: (ve.answer,
    solver.last_correction). Raises AdviceError with the first mistake of a case."""
    said = _start([program, "check", "--effective", file, *_settings(sets)])
    if said.returncode == 0:
        effective = tomllib.loads(said.stdout)
        points = int(re.search(r"(\d+) material points", said.stdout).group(1))
        return points, (effective["ve"]["answer"], effective["solver"]["last_correction"])
    if case.get("load"):
        raise AdviceError((said.stderr.strip() or said.stdout.strip()).splitlines()[0])
    return 0, ENDS


def read(file, sets):
    """The case with the values of --set."""
    if not file.is_file():
        raise AdviceError(f"{file}: no such file; correct the path")
    try:
        case = tomllib.loads(file.read_text())
        for setting in sets:
            key, _, value = setting.partition("=")
            section, _, name = key.partition(".")
            case.setdefault(section, {})[name] = _value(value)
    except (tomllib.TOMLDecodeError, TypeError) as error:
        raise AdviceError(f"{file}: {error}") from error
    if case.get("material", {}).get("type", "volume_element") != "volume_element":
        raise AdviceError(f"{file}: its material is a law in closed form, which needs no advice; material.type = \"volume_element\"")
    return case


def _value(text):
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return text


def main():
    p = argparse.ArgumentParser(prog="femxdem advise", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("case", type=Path)
    p.add_argument("--error", type=float, default=0.05, help="wanted error of the curve (default 0.05)")
    p.add_argument("--band", type=float, help="wanted thickness of a shear band [m]")
    p.add_argument("--write", type=Path, help="write the case with the advice in it to this file")
    p.add_argument("--out", type=Path, help="folder of the probes (default: out/NAME_advice)")
    p.add_argument("--set", dest="sets", action="append", default=[], metavar="section.key=value")
    a = p.parse_args()
    program = os.environ.get("FEMXDEM", "femxdem")  # of program/tools.cpp
    try:
        if not 1e-3 <= a.error <= 0.5:
            raise AdviceError(f"--error {a.error:g}: a relative error between 0.001 and 0.5")
        if a.band is not None and not a.band > 0:
            raise AdviceError(f"--band {a.band:g}: a thickness in metres")
        case = read(a.case, a.sets)
        folder = (a.out or Path("out") / (a.case.stem + "_advice")).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        said = advise(case, a.case.resolve(), program, folder, a.error, a.band, a.sets)
        print(said)
        values = {".".join(key): value for key, value in said.values.items()}
        (folder / "advice.json").write_text(json.dumps({"advice": said.lines, "values": values, **said.numbers}, indent=1))
        if a.write:
            overrides = {tuple(s.partition("=")[0].split(".", 1)): _value(s.partition("=")[2]) for s in a.sets}
            comment = "".join(f"# {line}\n" for line in ["Made by femxdem advise:", *str(said).splitlines()])
            a.write.write_text(comment + "\n" + with_values(a.case.read_text(), overrides | said.values))
    except (AdviceError, ValueError, ResultsError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
