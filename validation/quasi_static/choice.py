"""What a rate, an answer and a damping cost and err by, against the slowest rate: the chart from which defaults are chosen.

Errors are those of one packing against itself, so that what is left is the rate's and the answer's; beside them stands what
another packing of as many spheres would change.
"""

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

AT = np.linspace(0.002, 0.049, 95)  # axial strain
READ = ("peak", "at 3 %", "curve")
MARKERS = {"end": "s", "mean": "o", "mean, damping 0.7": "^", "mean, learned": "v", "end, learned": "D"}


@dataclass
class Run:
    """One run; strain and force over sigma_0 and width: (steps,)."""

    spheres: int
    number: float
    answer: str  #: of MARKERS
    strain: np.ndarray
    force: np.ndarray
    evaluations: np.ndarray
    dem_steps: float
    rejected: int


def errors(run, reference):
    """{of READ: over the reference's peak}; the whole curve's: root mean square."""
    own, true = (np.interp(AT, r.strain, r.force) for r in (run, reference))
    peak = reference.force.max()
    at = lambda r: np.interp(0.03, r.strain, r.force)
    values = abs(run.force.max() - peak), abs(at(run) - at(reference)), np.sqrt(np.mean((own - true) ** 2))
    return dict(zip(READ, (v / peak for v in values)))


def rows(runs):
    """(Run, errors, non-dominated) of the runs to the end, of which a size has its reference: "mean", the slowest rate; the
    cheapest first. Non-dominated: no run of its size with less DEM steps has a smaller error of the curve."""
    found = []
    for spheres in sorted({r.spheres for r in runs}):
        of_size = [r for r in runs if r.spheres == spheres and r.strain[-1] >= AT[-1]]
        slowest = [r for r in of_size if r.answer == "mean" and r.number == min(q.number for q in runs)]
        if not slowest:
            continue
        best = np.inf
        for run in sorted((r for r in of_size if r is not slowest[0]), key=lambda r: r.dem_steps):
            off = errors(run, slowest[0])
            found.append((run, off, off["curve"] < best))
            best = min(best, off["curve"])
    return found


def table(found):
    lines = ["| spheres | I | answer | evaluations a step, most | rejected | DEM steps | "
             + " | ".join(f"{name} [%]" for name in READ) + " | non-dominated |", "|" + "---|" * (7 + len(READ))]
    for run, off, best in found:
        lines.append(f"| {run.spheres} | {run.number:g} | {run.answer} | {run.evaluations.mean():.2f}, {run.evaluations.max():.0f} | {run.rejected} | "
                     f"{run.dem_steps:.2e} | " + " | ".join(f"{100 * off[name]:.1f}" for name in READ) + f" | {'x' * best} |")
    return lines


def draw(found, scatters, file):
    """Error of the curve over DEM steps, a panel for each size; scatters: {spheres: of one packing}."""
    sizes = sorted({run.spheres for run, *_ in found})
    figure, axes = plt.subplots(1, len(sizes), figsize=(3.7 * len(sizes), 3.2), sharey=True, squeeze=False)
    for axis, spheres in zip(axes[0], sizes):
        of_size = [(run, off, best) for run, off, best in found if run.spheres == spheres]
        for answer, marker in MARKERS.items():
            line = [(run.dem_steps, 100 * off["curve"], run.number) for run, off, _ in of_size if run.answer == answer]
            if not line:
                continue
            axis.loglog(*zip(*[p[:2] for p in line]), marker=marker, color=f"C{list(MARKERS).index(answer)}", linestyle="", label=answer)
            for x, y, number in line:
                axis.annotate(f"{number:g}", (x, y), fontsize=6, xytext=(3, 3), textcoords="offset points")
        axis.loglog(*zip(*[(run.dem_steps, 100 * off["curve"]) for run, off, best in of_size if best]), "k-", linewidth=0.7)
        if spheres in scatters:
            axis.axhline(100 * scatters[spheres], color="0.6", linestyle="--", label="scatter of packings")
        axis.set(title=f"{spheres} spheres", xlabel="DEM steps of the run")
        axis.legend(fontsize=6)
    axes[0, 0].set(ylabel="off the curve at the slowest rate [%]")
    figure.savefig(file, dpi=90, bbox_inches="tight")
    plt.close(figure)


def scatter(runs):
    """Standard deviation of one packing's curve, root mean square, over their mean peak; of Runs that differ in the packing."""
    curves = np.array([np.interp(AT, r.strain, r.force) for r in runs])
    return float(np.sqrt(curves.var(axis=0, ddof=1).mean()) / np.mean([r.force.max() for r in runs]))
