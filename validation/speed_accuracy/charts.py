"""Charts of speed against accuracy of whole runs: the point, the step, the mesh, the engine.

Every chart is the biaxial test of one specimen with one thing changed at a time. Cost: processor seconds of the run and DEM
steps. Errors of what a user reads, each relative, root mean square over the packings, from the chart's reference: `peak`,
`residual` (mean stress over the last tenth of the path), `band` (its thickness), `curve` (root mean square over the path over
that of the stress). The reference stands in the table with its own error: what the next coarser setting is off it by.
"""

import csv
from dataclasses import dataclass, field
from itertools import product

import matplotlib.pyplot as plt
import numpy as np

from campaign import ROOT  # which finds band and results

from band import band_of_run
from results import ResultsError, axial_curve
from ve_runs import relative_distance

ERRORS = ("peak", "residual", "band", "curve")
COSTS = {"core_seconds": "core seconds of the run", "dem_steps": "DEM steps"}
GRIDS = {"ve": np.linspace(0.004, 0.049, 91), "law": np.linspace(0.004, 0.039, 71)}  # nominal axial strain
SPECIMENS = {  # material: (case, settings)
    "ve": (ROOT / "validation" / "solver" / "biaxial_ve.toml", ("mesh.nx=4", "mesh.ny=8", "element.D=4e3", "control.end_time=1.0", "ve.threads=1")),
    "law": (ROOT / "validation" / "bands" / "case.toml", ("output.every=1000",)),
}


@dataclass(frozen=True)
class Setting:
    """A row of a chart: settings beside its specimen's, run with each of the packings."""

    name: str
    settings: tuple = ()
    material: str = "ve"
    packings: tuple = (1, 2)


@dataclass(frozen=True)
class Chart:
    text: str
    settings: tuple
    references: dict  #: material: (name of the reference, of the next coarser setting)
    over_packings: bool = False  #: the reference is the mean of its packings, not the same packing

    def of(self, material):
        return [s for s in self.settings if s.material == material]

    def named(self, name, material):
        return next(s for s in self.of(material) if s.name == name)


def step_of(strain, least=10):
    """Increments of nominal axial strain: 0.1 m/s on 2 m."""
    seconds = 20 * strain
    return f"control.step={seconds:g}", f"control.max_step={seconds:g}", f"ve.min_steps={least}"


def law_step(seconds, tolerance):
    return f"control.step={seconds:g}", f"control.max_step={seconds:g}", f"solver.tolerance={tolerance:g}"


def tolerance(t):
    return f"solver.tolerance={t:g}", *(("solver.max_iterations=40",) if t < 1e-3 else ())


def point():
    elastic = ("solver.operator=elastic", "solver.max_iterations=40")
    operators = {
        "learned tangents": (),
        "learned, pairs met exactly": ("solver.qn_first=0", "solver.qn_scatter=0"),
        "learned, relaxed start": ('ve.stiffness="relaxed"',),
        "learned, last correction too": ('solver.last_correction="learned"',),
        "elastic, Eq. (2)": elastic,
        "elastic, relaxed": (*elastic, 've.stiffness="relaxed"', 'solver.refresh="frozen"'),  # anew in every step: 2 s of each
        "elastic, Anderson": (*elastic, "solver.acceleration=anderson", "solver.anderson_depth=8"),
        "perturbation": ("solver.operator=perturbation",),
        "reuse below 0.01": ("solver.reuse_below=0.01",),
        "reuse below 0.03": ("solver.reuse_below=0.03",),
        "reuse below 0.1": ("solver.reuse_below=0.1",),
    }
    rows = [Setting(f"{name}, 5e-3", (*words, *tolerance(5e-3)), packings=(1,) if name == "perturbation" else (1, 2))
            for name, words in operators.items()]
    rows += [Setting(f"{name}, 1e-2", (*operators[name], *tolerance(1e-2))) for name in ("learned tangents", "learned, last correction too", "elastic, relaxed", "reuse below 0.03")]
    rows += [Setting(f"learned tangents, {t}", tolerance(float(t))) for t in ("1e-3", "2e-4")]
    rows.append(Setting("learned tangents, 1e-4", tolerance(1e-4), packings=(1,)))
    of_laws = {name: operators[name] for name in ("learned tangents", "learned, last correction too", "elastic, Eq. (2)", "elastic, Anderson", "perturbation")}
    of_laws |= {"consistent tangent": ("solver.operator=tangent",), "consistent, line search": ("solver.operator=tangent", "solver.line_search=true")}
    rows += [Setting(f"{name}, 5e-3", (*words, "solver.tolerance=5e-3"), "law", (None,)) for name, words in of_laws.items()]
    rows += [Setting(f"learned tangents, {t}", (f"solver.tolerance={t}",), "law", (None,)) for t in ("5e-4", "5e-5")]
    return Chart("operator, adaptive evaluation", tuple(rows), {"ve": ("learned tangents, 2e-4", "learned tangents, 1e-3"),
                                                                "law": ("learned tangents, 5e-5", "learned tangents, 5e-4")})


def step():
    least = {"4e-3": 10, "2e-3": 10, "1e-3": 10, "5e-4": 5, "2.5e-4": 3}
    rows = [Setting(f"{e}, {t}", (*step_of(float(e), n), *tolerance(float(t)))) for (e, n), t in product(least.items(), ("5e-3", "1e-3"))]
    rows += [Setting(f"{e}, {t}", (*step_of(float(e)), *tolerance(float(t)))) for e, t in (("4e-3", "2e-2"), ("2e-3", "1e-2"), ("1e-3", "1e-2"))]
    rows.append(Setting("1e-3, 5e-3, from 3 DEM steps", (*step_of(1e-3, 3), *tolerance(5e-3))))
    increments = {"8e-3": 0.2, "4e-3": 0.1, "2e-3": 0.05, "1e-3": 0.025, "5e-4": 0.0125, "2.5e-4": 0.00625}
    law = [Setting(f"{e}, {t}", law_step(s, float(t)), "law", (None,)) for (e, s), t in product(increments.items(), ("5e-3", "5e-4"))]
    return Chart("increment, tolerance", (*law, *rows), {"ve": ("2.5e-4, 1e-3", "5e-4, 1e-3"), "law": ("2.5e-4, 5e-4", "5e-4, 5e-4")})


def mesh():
    weak = "region.0.box=[0.25, 0.75, 0.5, 1.0]"  # of the same size on every mesh
    size = lambda nx, *more: (f"mesh.nx={nx}", f"mesh.ny={2 * nx}", weak, *more)
    q8 = 'element.type="q8"'
    name = lambda nx, kind: f"{nx} x {2 * nx} {kind}"
    rows = [Setting(name(nx, "second gradient"), size(nx), "law", (None,)) for nx in (4, 8, 12, 16, 24)]
    rows += [Setting(name(nx, "q8"), size(nx, q8), "law", (None,)) for nx in (4, 8, 16)]
    rows += [Setting(name(nx, "second gradient"), size(nx), packings=(1,)) for nx in (4, 8, 12, 16)]
    rows += [Setting(name(nx, "q8"), size(nx, q8), packings=(1,)) for nx in (4, 8)]
    return Chart("elements, kind", tuple(rows), {"ve": (name(16, "second gradient"), name(12, "second gradient")),
                                                 "law": (name(24, "second gradient"), name(16, "second gradient"))})


def engine():
    ve = lambda n, i, *more: (f"ve.spheres={n}", f"ve.inertial_number={i}", *more)
    sizes_and_rates = product((100, 200, 400, 1000), ("2e-2", "1e-2", "5e-3"))
    rows = [Setting(f"compact, {n}, {i}", ve(n, i), packings=(1, 2, 3)) for n, i in sizes_and_rates]
    rows.append(Setting("YADE, 100, 2e-2", ve(100, "2e-2", 've.engine="yade"'), packings=(1,)))
    return Chart("YADE, compact; spheres, rate", tuple(rows), {"ve": ("compact, 1000, 5e-3", "compact, 1000, 1e-2")}, over_packings=True)


CHARTS = {"point": point(), "step": step(), "mesh": mesh(), "engine": engine()}


@dataclass
class Reading:
    """What a user reads of one run, or the mean of several; `reached`: axial strain at its end."""

    peak: float
    residual: float
    band: float  #: [m]; nan without one
    curve: np.ndarray = field(repr=False)

    def errors_from(self, other):
        relative = lambda mine, its: abs(mine / its - 1)
        return {"peak": relative(self.peak, other.peak), "residual": relative(self.residual, other.residual),
                "band": relative(self.band, other.band), "curve": relative_distance(self.curve, other.curve)}


def read(folder, material):
    """The Reading of a run that came to the end of its grid; else how far it came, as a strain."""
    grid, curve = GRIDS[material], axial_curve(folder, nominal=True)
    if curve.strain[-1] < grid[-1]:
        return float(curve.strain[-1])
    stress = np.interp(grid, curve.strain, curve.stress)
    try:
        band = band_of_run(folder).thickness
    except ResultsError:
        band = float("nan")
    last = grid >= 0.9 * grid[-1]
    return Reading(float(curve.stress[curve.strain <= grid[-1]].max()), float(stress[last].mean()), band, stress)


def mean_of(readings):
    mean = lambda key: np.mean([getattr(r, key) for r in readings], axis=0)
    return Reading(float(mean("peak")), float(mean("residual")), float(np.nanmean([r.band for r in readings])), mean("curve"))


def root_mean_square(values):
    """Of those that are numbers; nan where there are none."""
    values = [v for v in values if np.isfinite(v)]
    return float(np.sqrt(np.mean(np.square(values)))) if values else float("nan")


class Found:
    """The runs of one chart: readings and costs by (setting, packing). `specimens`: as SPECIMENS, of a chart with its own."""

    def __init__(self, c, name, chart, specimens=SPECIMENS):
        self.c, self.name, self.chart, self.specimens = c, name, chart, specimens
        self.readings, self.costs, self.ended = {}, {}, {}

    def run(self, setting, packing):
        case, usual = self.specimens[setting.material]
        settings = (*usual, *setting.settings)
        if packing is not None:
            settings = (*settings, f"ve.seed={packing}", self.c.cache)
            made = next((s for s in setting.settings if s.startswith(("ve.spheres=", "ve.preset="))), "ve.spheres=200")
            self.c.run(case, f"start/{made.partition('=')[2]}_{packing}", *usual, made, f"ve.seed={packing}", self.c.cache, "control.end_time=0.02")
        word = setting.name.replace(", ", "_").replace(" ", "_")
        run = self.c.run(case, f"{self.name}/{setting.material}/{word}_{packing}", *settings)
        key = setting.name, setting.material, packing
        history = run.history()
        self.costs[key] = (run.processor_seconds, sum(history.get("dem_steps", [])), run.evaluations(), len(run.rejections()))
        found = read(run.folder, setting.material) if history else 0.0
        if isinstance(found, Reading):
            self.readings[key] = found
        else:
            self.ended[key] = found, run.reason()
        print(f"{self.name}: {setting.name} ({setting.material}, {packing}): {run.processor_seconds:.1f} s, {found}", flush=True)

    def reference(self, material, packing):
        """The Reading that others of that packing are compared with."""
        name = self.chart.references[material][0]
        if self.chart.over_packings:
            return mean_of([r for key, r in self.readings.items() if key[:2] == (name, material)])
        return self.readings.get((name, material, packing))

    def errors(self, setting):
        """Root mean squares over the packings by kind, not of those that did not come to the end; `band` of those that have one."""
        found = []
        for packing in setting.packings:
            mine, its = self.readings.get((setting.name, setting.material, packing)), self.reference(setting.material, packing)
            if mine and its:
                found.append(mine.errors_from(its))
        return {kind: root_mean_square([e[kind] for e in found]) for kind in ERRORS}

    def own_errors(self, material):
        """Of the reference: what the next coarser setting differs from it by; and of a mean over packings also its standard error."""
        name, coarser = (self.chart.named(n, material) for n in self.chart.references[material])
        if not self.chart.over_packings:
            return self.errors(coarser)
        mean = self.reference(material, None)
        its = mean_of([r for key, r in self.readings.items() if key[:2] == (coarser.name, material)])
        refined, scatter = its.errors_from(mean), self.errors(name)
        return {kind: float(np.hypot(refined[kind], scatter[kind] / np.sqrt(len(name.packings) - 1))) for kind in ERRORS}

    def rows(self):
        rows = []
        for material in self.chart.references:
            own = self.own_errors(material)
            mine = [self.row(setting, own) for setting in self.chart.of(material)]
            for cost in COSTS:
                chosen = front([r for r in mine if np.isfinite(r["curve"]) and r[cost] > 0], cost, "curve", own["curve"])
                for r in mine:
                    r[f"front_{cost}"] = r in chosen
            rows += sorted(mine, key=lambda r: r["core_seconds"])
        return rows

    def row(self, setting, own):
        costs = np.mean([self.costs[setting.name, setting.material, p] for p in setting.packings], axis=0)
        ended = [self.ended[key] for key in self.ended if key[:2] == (setting.name, setting.material)]
        mine = [r for key, r in self.readings.items() if key[:2] == (setting.name, setting.material)]
        is_reference = setting.name == self.chart.references[setting.material][0]
        errors = own if is_reference else self.errors(setting)
        if ended:
            errors = dict.fromkeys(ERRORS, float("nan"))
        return {"chart": self.name, "material": setting.material, "setting": setting.name, "packings": len(setting.packings),
                "core_seconds": round(costs[0], 2), "dem_steps": round(costs[1]), "evaluations": round(costs[2], 1), "rejected": round(costs[3], 1),
                **{k: float(f"{e:.3g}") for k, e in errors.items()}, "bands": sum(np.isfinite(r.band) for r in mine), "reference": is_reference,
                "stopped_at": min(e[0] for e in ended) if ended else ""}


def front(rows, cost, error, floor=0.0):
    """Rows than which no other is both cheaper and more accurate; errors within `floor` are alike."""
    at = lambda r: max(r[error], floor)
    better = lambda o, r: o[cost] <= r[cost] and at(o) <= at(r) and (o[cost] < r[cost] or at(o) < at(r))
    return [r for r in rows if not any(better(o, r) for o in rows)]


def table(rows):
    """Markdown lines of a chart's rows, cheapest first."""
    percent = lambda e: f"{100 * e:.2g}" if np.isfinite(e) else ""
    missing = lambda r: f" ({r['bands']:.0f} of {r['packings']:.0f} have one)" if r["bands"] < r["packings"] else ""
    lines = []
    for material, text in (("ve", "Volume elements"), ("law", "A softening law in closed form")):
        mine = [r for r in rows if r["material"] == material]
        if not mine:
            continue
        head = ["setting", "packings", "core seconds", "DEM steps [1e3]", "evaluations", "rejected", *(f"{k} [%]" for k in ERRORS), "non-dominated by"]
        lines += ["", f"{text}:", "", f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
        for r in mine:
            name = f"**{r['setting']}: the reference, its own error**" if r["reference"] else r["setting"]
            errors = [percent(r[k]) + missing(r) * (k == "band") for k in ERRORS]
            if r["stopped_at"] != "":
                errors = [f"stopped at {100 * r['stopped_at']:.1f} %", "", "", ""]
            best = ", ".join(word for word, cost in (("seconds", "core_seconds"), ("DEM steps", "dem_steps")) if r[f"front_{cost}"])
            steps = f"{1e-3 * r['dem_steps']:.0f}" if r["dem_steps"] else ""
            cost = [f"{r['packings']:.0f}", f"{r['core_seconds']:.1f}", steps, f"{r['evaluations']:.0f}", f"{r['rejected']:.0f}"]
            lines.append(f"| {' | '.join([name, *cost, *errors, best])} |")
    return lines[1:]


def measure(found):
    """Runs a chart, writes its numbers; its rows."""
    for setting in found.chart.settings:
        for packing in setting.packings:
            found.run(setting, packing)
    rows = found.rows()
    with open(found.c.product(f"{found.name}.csv"), "w", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    for material, (name, _) in found.chart.references.items():
        mean = mean_of([r for key, r in found.readings.items() if key[:2] == (name, material)])
        print(f"{found.name}, {material}: reference peak {mean.peak:.3f}, residual {mean.residual:.3f}, band {mean.band:.3f} m")
    return rows


def write(c, name):
    """Runs the chart of that name; its table."""
    lines = table(measure(Found(c, name, CHARTS[name])))
    print(*lines, sep="\n")
    c.table(lines, mark=name)


def recorded(c, name):
    """Rows of the chart's numbers: of this campaign, else those beside it; none where there are none."""
    file = next((f for f in (c.runs / f"{name}.csv", c.home / f"{name}.csv") if f.exists()), None)
    if not file:
        return []
    words = {"True": True, "False": False}
    value = lambda k, v: v if k in ("chart", "material", "setting") or v == "" else words[v] if v in words else float(v)
    with open(file, newline="") as stream:
        return [{k: value(k, v) for k, v in r.items()} for r in csv.DictReader(stream)]


def draw(c):
    """The four charts on common axes: error of the whole curve against either cost."""
    figure, axes = plt.subplots(2, 4, figsize=(12, 6), sharex="row", sharey=True)
    for column, (name, chart) in zip(axes.T, CHARTS.items()):
        rows = [r for r in recorded(c, name) if np.isfinite(r["curve"])]
        for axis, cost in zip(column, COSTS):
            draw_panel(axis, rows, cost)
            axis.set_xlabel(COSTS[cost], fontsize=8)
        column[0].set_title(f"{name}: {chart.text}", fontsize=9)
    for axis in axes[:, 0]:
        axis.set_ylabel("error of the curve [%]", fontsize=8)
    axes[0, 0].legend(fontsize=6)
    figure.tight_layout()
    figure.savefig(c.product("charts.png"), dpi=80)
    plt.close(figure)


def draw_panel(axis, rows, cost):
    for material, marker in (("ve", "o"), ("law", "s")):
        mine = [r for r in rows if r["material"] == material and r[cost]]
        if not mine:
            continue
        color = {"ve": "C0", "law": "C1"}[material]
        best = sorted((r for r in mine if r[f"front_{cost}"]), key=lambda r: r[cost])
        axis.loglog([r[cost] for r in mine], [100 * r["curve"] for r in mine], marker, color=color, markersize=4, fillstyle="none",
                    label={"ve": "volume elements", "law": "law in closed form"}[material])
        axis.loglog([r[cost] for r in best], [100 * r["curve"] for r in best], marker + "-", color=color, markersize=5, linewidth=1)
        for r in mine:
            if r["reference"]:
                axis.axhline(100 * r["curve"], color=color, linestyle=":", linewidth=0.8)
        for k, r in enumerate(apart(best, cost)):
            axis.annotate(r["setting"], (r[cost], 100 * r["curve"]), fontsize=5, xytext=(4, 3 if k % 2 else -7), textcoords="offset points")
    axis.grid(alpha=0.3, which="both")
    axis.tick_params(labelsize=7)


def apart(rows, cost):
    """Of rows by rising cost, those whose labels do not lie on each other."""
    chosen = []
    for r in rows:
        if not any(r[cost] < 2 * o[cost] and max(r["curve"], o["curve"]) < 2 * min(r["curve"], o["curve"]) for o in chosen):
            chosen.append(r)
    return chosen
