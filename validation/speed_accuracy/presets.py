"""What `ve.preset` stands for: a row of each chart, and its errors from them.

The errors of a preset are the roots of the sums of squares of those of its rows: engine (spheres, rate; scatter of the packings
included), step (increment, tolerance), mesh (the law's: 2.7, 5.4 and 8 elements across the band, as many or fewer than advised).
fe_master/case/preset.cpp has the same numbers.
"""

import numpy as np

from charts import ERRORS, recorded

# name: its settings, in the order of the table, and its rows in (engine, step, mesh)
PRESETS = {
    "fast": ((100, "2e-2", 10, "2e-3", "1e-2", 4), ("compact, 100, 2e-2", "2e-3, 1e-2", "4 x 8 second gradient")),
    "balanced": ((400, "2e-2", 3, "1e-3", "5e-3", 6), ("compact, 400, 2e-2", "1e-3, 5e-3, from 3 DEM steps", "8 x 16 second gradient")),
    "accurate": ((1000, "2e-2", 3, "2.5e-4", "5e-3", 8), ("compact, 1000, 2e-2", "2.5e-4, 5e-3", "12 x 24 second gradient")),
}
CHARTS = (("engine", "ve"), ("step", "ve"), ("mesh", "law"))


def errors_of(c, rows):
    """By kind, of the rows of a preset; each row's own errors too, as [{kind: error}, ...]."""
    found = []
    for (chart, material), name in zip(CHARTS, rows):
        row = next((r for r in recorded(c, chart) if r["setting"] == name and r["material"] == material), None)
        if row:
            found.append({kind: row[kind] for kind in ERRORS})
    return {kind: float(np.sqrt(sum(e[kind] ** 2 for e in found))) for kind in ERRORS}, found


def write(c):
    percent = lambda e: f"{100 * e:.2g}" if np.isfinite(e) else "none"
    head = ["preset", "spheres", "inertial number", "least DEM steps", "increment", "tolerance", "elements across the band",
            *(f"{k} [%]" for k in ERRORS), "peak by engine, step, mesh [%]", "curve by engine, step, mesh [%]"]
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    for name, (values, rows) in PRESETS.items():
        errors, parts = errors_of(c, rows)
        by = lambda kind: ", ".join(percent(p[kind]) for p in parts)
        cells = [f"`{name}`", *map(str, values), *(percent(errors[k]) for k in ERRORS), by("peak"), by("curve")]
        lines.append(f"| {' | '.join(cells)} |")
    print(*lines, sep="\n")
    c.table(lines, mark="presets")
