"""What `ve.preset` stands for: its errors in whole runs, and those that one row of each chart adds up to.

Whole runs: three packings each, from the mean of three of 1000 spheres at I = 2e-3, on a mesh of at least as many elements across the
band (0.72 m by the square root of D) as the preset advises. Added up: the roots of the sums of squares of a row of the engine
(spheres, rate; scatter of the packings included), one of the step (increment, tolerance), one of the mesh (the law's: 2.7, 5.4 and 8
elements across the band). fe_master/case/preset.cpp has the errors of the whole runs.
"""

import numpy as np

import charts
from charts import ERRORS, Chart, Found, Setting, recorded

# name: its settings, in the order of the table; its rows in (engine, step, mesh)
PRESETS = {
    "fast": ((100, "2e-2", 10, "2e-3", "1e-2", 4), ("compact, 100, 2e-2", "2e-3, 1e-2", "4 x 8 second gradient")),
    "balanced": ((400, "5e-3", 3, "1e-3", "5e-3", 6), ("compact, 400, 5e-3", "1e-3, 5e-3, from 3 DEM steps", "8 x 16 second gradient")),
    "accurate": ((1000, "5e-3", 3, "5e-4", "5e-3", 8), ("compact, 1000, 5e-3", "5e-4, 5e-3", "12 x 24 second gradient")),
}
CHARTS = (("engine", "ve"), ("step", "ve"), ("mesh", "law"))
GIVEN = ("spheres", "inertial_number", "step", "max_step", "tolerance")  # keys of the case that a preset gives
PACKINGS = (1, 2, 3)


def whole():
    """The Chart of the presets as they are, and of what lies between and beyond them."""
    mesh = lambda nx: (f"mesh.nx={nx}", f"mesh.ny={2 * nx}")
    other = lambda preset, *words: (f"ve.preset={preset}", *words, *mesh(8))
    rows = {"fast, 4 x 8": ("ve.preset=fast", *mesh(4)), "balanced, 8 x 16": other("balanced"), "accurate, 8 x 16": other("accurate"),
            "balanced at 2e-2": other("balanced", "ve.inertial_number=2e-2"),
            "accurate at 1e-2": other("accurate", "ve.inertial_number=1e-2"),
            "accurate at 2e-3": other("accurate", "ve.inertial_number=2e-3")}
    return Chart("the presets as they are", tuple(Setting(name, words, packings=PACKINGS) for name, words in rows.items()),
                 {"ve": ("accurate at 2e-3", "accurate, 8 x 16")}, over_packings=True)


def specimen(c):
    """That of the charts without what a preset gives."""
    case, usual = charts.SPECIMENS["ve"]
    file = c.runs / "preset.toml"
    lines = case.read_text().splitlines()
    file.write_text("\n".join(line for line in lines if line.partition("=")[0].strip() not in GIVEN) + "\n")
    kept = [s for s in usual if not s.startswith(("mesh.", "ve.threads"))]
    return file, (*kept, "region.0.box=[0.25, 0.75, 0.5, 1.0]", "ve.threads=2")


def added_up(c, rows):
    """Errors by kind that the rows of a preset add up to."""
    found = []
    for (chart, material), name in zip(CHARTS, rows):
        row = next((r for r in recorded(c, chart) if r["setting"] == name and r["material"] == material), None)
        if row:
            found.append(row)
    return {kind: float(np.sqrt(sum(e[kind] ** 2 for e in found))) for kind in ERRORS}


def table(c, rows):
    """Lines of the table of the presets, of the rows of their whole runs."""
    percent = lambda e: f"{100 * e:.2g}" if np.isfinite(e) else "none"
    head = ["preset", "spheres", "inertial number", "least DEM steps", "increment", "tolerance", "elements across the band",
            *(f"{k}: whole run / added up [%]" for k in ERRORS)]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for name, (values, parts) in PRESETS.items():
        mine = next(r for r in rows if r["setting"].startswith(f"{name}, "))
        by_rows = added_up(c, parts)
        cells = [f"`{name}`", *map(str, values), *(f"{percent(mine[k])} / {percent(by_rows[k])}" for k in ERRORS)]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def write(c):
    rows = charts.measure(Found(c, "presets", whole(), {"ve": specimen(c)}))
    lines = table(c, rows) + ["", *charts.table(rows)]
    print(*lines, sep="\n")
    c.table(lines, mark="presets")
