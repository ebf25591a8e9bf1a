"""What short probes of a volume element say about the run of a case: numbers in, numbers out, no program is started.

Curves are arrays over the steps of one path. What a single volume element cannot tell (iterations of a mesh, width of a
band, memory) comes from the measured runs of validation/, named where it is used.
"""

import math
import re
import tomllib
from dataclasses import dataclass, replace

import numpy as np

BAND = 0.572, 0.025  # [m] thickness at D = 0.025 m^2 sigma_0, as sqrt(D) (validation/biaxial, 128 elements)
BAND_ANGLE = math.radians(52)  # of a band to the lateral axis (the same)
ELEMENTS_FOR_FORCE, ELEMENTS_FOR_WIDTH = 4, 14  # across a band (validation/closed_forms/bilinear_bar)
# Error of the curve by the tolerance (validation/solver, before localisation, three seeds; 1e-2: between 0.7 % of
# validation/advise and 2.8 % of validation/speed_accuracy).
TOLERANCES = ((1e-2, 0.014), (5e-3, 0.005), (1e-3, 0.0025))
# Evaluations a step before the peak and past it, by ve.answer and solver.last_correction: at 1000 spheres, I = 2e-2, tolerance
# 5e-3, and powers of 1000/spheres, 2e-2/I and 5e-3/tolerance. Least squares of the runs of validation/biaxial, solver and
# quasi_static.
EVALUATIONS = {
    ("end", "evaluated"): ((1.9, 0.08, 0.25, 0.33), (2.4, 0.20, 0.35, 0.27)),
    ("mean", "evaluated"): ((1.57, 0.33, 0.14, 0.33), (1.78, 0.25, 0.27, 0.27)),
    ("end", "learned"): ((1.44, 0.16, 0.16, 0.31), (1.95, 0.11, 0.14, 0.24)),
    ("mean", "learned"): ((1.34, 0.14, 0.05, 0.31), (1.84, 0.12, 0.13, 0.24)),
}
ENDS = ("end", "evaluated")  # as single volume elements are strained
BYTES_A_SPHERE = 2700.0  # of a point in compact cells: committed state, spare ones, contacts that grew (validation/biaxial, 128)
BYTES_A_SPHERE_YADE = 10_000.0  # of a volume element in YADE with its trial (validation/engine)
BYTES_OF_PROGRAM = 1.0e8  # and as much for YADE in its worker (validation/advise)
# Processor time of an evaluation on rank 0, for each element (assembly, learned tangents, solution; 32 to 512 elements of the
# second gradient), and of a run's start (YADE's import, comparison of the engines, repeated trials): validation/advise.
SERIAL_SECONDS, START_SECONDS = 4e-4, 2.5
CHECKPOINT_FACTOR = 1.8  # memory while a checkpoint is written (validation/biaxial, 512)
POINTS_OF_AN_ELEMENT = 4
PLATEAU = 0.97
PACKING_STEP = 50  # spheres are advised in multiples of this


@dataclass
class Path:
    """One volume element along the case's path; all (steps,)."""

    strain: np.ndarray  #: norm of the logarithmic strain since the start
    stress: np.ndarray  #: largest principal compression over the mean stress of the start
    steps_needed: np.ndarray  #: DEM steps of one trial that the rate asks for, which ve.min_steps may exceed
    dem_steps: int
    step_seconds: float  #: of one DEM step: the median over the steps, which other work on the machine moves little
    adhesive: float  #: share of the contacts that adhere at the end
    unbalanced: float  #: largest unbalanced force
    eased: float = 1.0  #: eased_by()


def path_of(history, inertial_number):
    """The Path of the columns of history.csv of `femxdem ve path`, run at that inertial number."""
    components = ("xx", "yy", "zz", "xy", "yz", "zx")
    strain, stress = (
        np.array([history[f"{what}_{c}"] for c in components])[[[0, 3, 5], [3, 1, 4], [5, 4, 2]]].transpose(2, 0, 1)
        for what in ("strain", "stress")
    )
    principal = np.sort(-np.linalg.eigvalsh(stress), axis=1)
    strained = history["dem_steps"] > 0
    trial = np.divide(history["dem_steps"], history["evaluations"], out=np.zeros(len(stress)), where=history["evaluations"] > 0)
    return Path(
        strain=np.linalg.norm(strain, axis=(1, 2)),
        stress=principal[:, 2] / principal[0].mean(),
        steps_needed=trial * history["inertial_number"] / inertial_number,
        dem_steps=int(history["dem_steps"].sum()),
        step_seconds=float(np.median(history["dem_seconds"][strained] / history["dem_steps"][strained])),
        adhesive=float(history["adhesive_contacts"][-1]),
        unbalanced=float(history["unbalanced_force"].max()),
    )


def distance(one, other, end=np.inf):
    """Root mean square of the difference of two Paths' curves over that of `other`, where both are, to a strain of `end`."""
    end = min(one.strain[-1], other.strain[-1], end)
    at = np.linspace(0, end, 101)[1:]
    a, b = (np.interp(at, p.strain, p.stress) for p in (one, other))
    return float(np.sqrt(np.mean((a - b) ** 2) / np.mean(b**2)))


def scatter(paths):
    """Standard deviation of single packings, root mean square over the curve, over the mean curve's."""
    at = np.linspace(0, min(p.strain[-1] for p in paths), 101)[1:]
    curves = np.array([np.interp(at, p.strain, p.stress) for p in paths])
    return float(np.sqrt((curves.var(axis=0, ddof=1)).mean() / (curves.mean(axis=0) ** 2).mean()))


def scatter_constant(found):
    """s_0 of scatter = s_0 / sqrt(spheres), from {spheres: (scatter, packings)}."""
    weights = {n: k - 1 for n, (_, k) in found.items()}
    return math.sqrt(sum(weights[n] * n * s * s for n, (s, _) in found.items()) / sum(weights.values()))


def spheres_for(error, constant):
    """Least number of spheres, in steps of PACKING_STEP, whose scatter is within `error`."""
    return max(PACKING_STEP, PACKING_STEP * math.ceil((constant / error) ** 2 / PACKING_STEP - 1e-9))


def mean_path(paths):
    """The first of several Paths with the mean curve of all: what one packing does of itself is less in it."""
    at = np.linspace(0, min(p.strain[-1] for p in paths), 101)
    mean = np.mean([np.interp(at, p.strain, p.stress) for p in paths], axis=0)
    return replace(paths[0], strain=at, stress=mean)


def beyond(off, noise, points):
    """What a setting moves the curve of a body of that many strained points by, of what it moves that of a single volume element
    by, `off`, and what any small change does, `noise`: the one is the same in all points, the other averages out."""
    return math.sqrt(max(off**2 - noise**2, 0.0) + noise**2 / points)


class Differences:
    """What settings move the curve of a body of `points` strained points by: beyond() over the whole path and over its part to 1.5
    times the strain at which the stress stops rising, where any small change does less; the larger of the two."""

    def __init__(self, usual, changed, points):
        """Two Paths that any small change has parted."""
        self.points, self.ends = points, (np.inf, 1.5 * stops_rising(usual))
        self.noise = [distance(usual, changed, end) for end in self.ends]

    def __call__(self, one, other):
        return max(beyond(distance(one, other, end), noise, self.points) for end, noise in zip(self.ends, self.noise))


def rate_for(error, paths, off=distance):
    """The largest inertial number whose curve is within `error` of that of every lower one, as `off` tells; {I: Path}."""
    good = [i for i, p in paths.items() if all(off(p, q) <= error for j, q in paths.items() if j < i)]
    return max(good)


def tolerance_for(error):
    """The loosest measured tolerance within `error`, and what it errs by."""
    return next(((t, e) for t, e in TOLERANCES if e <= error), TOLERANCES[-1])


def softening(path):
    """(strain at the peak, fall from there to the path's end over the peak): 0 without a peak inside the path. Curves are
    smoothed over three steps, so that jumps of few spheres are none."""
    smooth = np.convolve(path.stress, np.ones(3) / 3, mode="valid")
    peak = int(np.argmax(smooth))
    if peak == len(smooth) - 1:
        return path.strain[-1], 0.0
    return float(path.strain[peak + 1]), float(1 - smooth[-1] / smooth[peak])


def stops_rising(path):
    """Strain at which the smoothed stress first has PLATEAU of its largest: from there on bands form, be it before a peak or
    on a plateau."""
    smooth = np.convolve(path.stress, np.ones(3) / 3, mode="valid")
    return float(path.strain[1 + int(np.argmax(smooth >= PLATEAU * smooth.max()))])


def elastic_until(path, share=0.8):
    """Strain at which the secant stiffness has fallen below that share of the first step's."""
    moved = path.strain > 0
    secant = (path.stress[moved] - path.stress[0]) / path.strain[moved]
    below = np.flatnonzero(secant < share * secant[0])
    return float(path.strain[moved][below[0]]) if len(below) else float(path.strain[-1])


def band_thickness(D, sigma_0):
    """[m] full width at half height of a band."""
    return BAND[0] * math.sqrt(D / (BAND[1] * sigma_0))


def modulus_for(thickness, sigma_0):
    """D [N] of a band of that thickness [m]."""
    return BAND[1] * sigma_0 * (thickness / BAND[0]) ** 2


def evaluations(spheres, inertial_number, tolerance, past, answers=ENDS):
    """Mean evaluations a step, past the peak or before it; answers: (ve.answer, solver.last_correction)."""
    at, by_spheres, by_rate, by_tolerance = EVALUATIONS[answers][past]
    found = at * (1000 / spheres) ** by_spheres * (2e-2 / inertial_number) ** by_rate * (5e-3 / tolerance) ** by_tolerance
    return max(1.0, found)


def eased_by(path, trials, spheres, inertial_number, tolerance):
    """By what evaluations() are to be multiplied before the peak, where the Path kept a stress and took `trials` (steps,) for it:
    the square root of their mean over that of the fit, halfway between the two."""
    before = (path.strain <= stops_rising(path)) & (trials > 0)
    return math.sqrt(trials[before].mean() / evaluations(spheres, inertial_number, tolerance, False))


def steps_of_a_trial(needed, min_steps, strained):
    """Mean DEM steps of a point's trial where the strain of the body goes into the share `strained` of it."""
    return strained * np.maximum(min_steps, needed / strained) + (1 - strained) * min_steps


def strained_share(thickness, height):
    """Share of a body of that height that lies in one band through it."""
    return min(1.0, thickness / (height * math.cos(BAND_ANGLE)))


@dataclass
class Cost:
    evaluations: float
    dem_steps: float
    dem_seconds: float  #: of one core
    serial_seconds: float  #: assembly and solution on rank 0
    bytes: float

    @property
    def core_hours(self):
        return (self.dem_seconds + self.serial_seconds + START_SECONDS) / 3600

    def ranks_that_pay(self, points, busiest):
        """The most ranks, or threads, of which each still does more than half of what it could: against what rank 0 does
        alone, and against the busiest point, which no rank shares (its trial over the mean one)."""
        return max(1, math.floor(min(self.dem_seconds / max(self.serial_seconds, 1e-9), points / busiest)))


def cost_of_run(path, points, spheres, inertial_number, tolerance, min_steps, strained, step_seconds, compact, answers=ENDS):
    """Cost of a run of one step for each step of the Path; from where the stress stops rising the share `strained` of the
    points strains. step_seconds: of a DEM step of one point."""
    past = path.strain > stops_rising(path)
    after, before = (evaluations(spheres, inertial_number, tolerance, when, answers) for when in (True, False))
    number = np.where(past, after, max(1.0, path.eased * before))
    trial = np.where(past, *(steps_of_a_trial(path.steps_needed, min_steps, share) for share in (strained, 1.0)))
    number, trial = number[1:], trial[1:]  # the first row is the start
    steps = float(points * (number * trial).sum())
    a_sphere = BYTES_A_SPHERE if compact else BYTES_A_SPHERE_YADE
    memory = BYTES_OF_PROGRAM * (1 if compact else 2) + points * spheres * a_sphere
    serial = float(number.sum()) * SERIAL_SECONDS * points / POINTS_OF_AN_ELEMENT
    return Cost(float(number.sum()), steps, steps * step_seconds, serial, memory)


def loading_path(case):
    """[[path]] of one volume element that stands for the case's loads: its own, or that of a biaxial test, or that of the wall
    of a cylinder. Raises ValueError, what to write, where there is none."""
    if case.get("path"):
        return case["path"]
    control, mesh, loads = case.get("control", {}), case.get("mesh", {}), case.get("load", [])
    increments = max(1, round(control.get("end_time", 1) / control.get("max_step", control.get("step", 0.02))))
    if mesh.get("type") == "annulus":
        e = 0.05
        return [{"strain_xx": e, "strain_yy": -e, "increments": 50}]
    ends = [l for l in loads if l.get("edge") in ("top", "bottom") and l.get("component") == "y"]
    moved = [l for l in ends if l.get("value") and not l.get("table")]
    sides = [l for l in loads if l.get("edge") in ("left", "right")]
    kinds = ("displacement", "velocity")
    if mesh.get("type", "rectangle") != "rectangle" or len(moved) != 1 or moved[0].get("kind", kinds[0]) not in kinds:
        raise ValueError("no path can be told from its loads; give the case a [[path]] that a typical point follows")
    way = moved[0]["value"] * (control["end_time"] if moved[0].get("kind") == "velocity" else 1.0)
    height = mesh["height"]
    shortening = (-way if moved[0]["edge"] == "top" else way) / height
    if shortening >= 1:
        raise ValueError(f"its loads shorten the specimen by {shortening:.0%}; correct the [[load]] of edge \"{moved[0]['edge']}\"")
    segment = {"strain_yy": math.log(1 - shortening), "increments": increments}
    pressure = [l["value"] for l in sides if l.get("kind") == "pressure"]
    if pressure:
        segment["stress_xx"] = -float(pressure[0])
    elif not sides:
        segment["stress_xx"] = 0.0
    return [segment]


def toml_value(value):
    """A number, text, Boolean or list as TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    return repr(value)


def with_values(text, values):
    """The text of a case file with {(section, key): value} in place; comments and order stay."""
    for (section, key), value in values.items():
        line = f"{key} = {toml_value(value)}"
        header = re.search(rf"^[ \t]*\[{section}\][^\n]*$", text, re.MULTILINE)
        if not header:
            text = text.rstrip("\n") + f"\n\n[{section}]\n{line}\n"
            continue
        end = re.search(r"^[ \t]*\[", text[header.end():], re.MULTILINE)
        end = header.end() + end.start() if end else len(text)
        body = text[header.end():end]
        given = re.search(rf"^[ \t]*{key}[ \t]*=[^\n#]*", body, re.MULTILINE)
        if given:
            comment = body[given.end():]
            body = body[:given.start()] + line + (" " if comment.startswith("#") else "") + comment
        else:
            body = f"\n{line}" + body
        text = text[:header.end()] + body + text[end:]
    for (section, key), value in values.items():
        if _read(text).get(section, {}).get(key) != value:
            raise ValueError(f"{section}.{key} cannot be set in this file, which writes it in another way; set it by hand")
    return text


def _read(text):
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {}
