#!/usr/bin/python3
"""Two spheres under each contact law against its closed form: normal cycle, sliding cycle, loss, new contact, dashpot.

    validation/contact_laws/run.py [ROW ...] [--list] [--record]

Prints one row for each quantity (measured, reference, tolerance); exit status 1 if any is off.
"""

import os
import sys
from pathlib import Path

os.environ["OMP_NUM_THREADS"] = "1"
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign
import judged

sys.path[:0] = [str(campaign.ROOT / "yade_scripts"), str(campaign.ROOT / "tests" / "yade")]
import matplotlib.pyplot as plt
import numpy as np

import contact_laws
from two_spheres import DIAMETER, F_C, FRICTION, KN, STEP, PaperPair, normal_path, slide, slider, sliding_cycle, there_and_back

UNIT = F_C / KN  # [m]
LAWS = (*contact_laws.LAWS, contact_laws.PAPER)
OVERLAP = 4.03e-6  # [m]: no step ends on delta = 0 or delta = -f_c/kn
TOLERANCE = 1e-6  # of f_c


def normal_force(law, overlaps, bound=True, lost_at=0.0):
    """Closed form of the normal force [N] along `overlaps` [m]; an adhesive contact is lost at the overlap `lost_at` and
    holds -f_c below 0 until then, the paper's ends at 0."""
    forces = []
    for delta in overlaps:
        limit = {"adhesive": lost_at, "bonded": -UNIT, "friction": 0.0, "paper": 0.0}[law]
        bound = bound and delta > limit
        if bound and law in ("adhesive", "paper"):
            forces.append(max(KN * delta - F_C, -F_C))
        else:
            forces.append(KN * delta if bound else max(KN * delta, 0.0))
    return np.array(forces)


def deviation(measured, closed_form):
    """Largest difference over f_c."""
    return float(np.abs(measured - closed_form).max() / F_C)


def row(quantity, measured, reference=0.0, tolerance=TOLERANCE):
    return judged.row(quantity, measured, reference, tolerance)


def normal_cycles(axes):
    """Opened until lost and closed again; what YADE does differently."""
    rows = []
    for law in LAWS:
        path = normal_path(law, there_and_back(90), OVERLAP)
        lost_at = -UNIT if law == "adhesive" else 0.0
        closed = normal_force(law, path[:, 0], lost_at=lost_at)
        rows.append(row(f"{law}: opened, lost and closed again, deviation / f_c", deviation(path[:, 1], closed)))
        draw(axes, path[:, 0] / UNIT, closed / F_C, path[:, 1] / F_C, law)
    path = normal_path("adhesive", there_and_back(90), OVERLAP)
    paper = normal_force("adhesive", path[:, 0])
    off = np.abs(path[:, 1] - paper) > TOLERANCE * F_C
    rows.append(row("adhesive: length of the plateau against the paper's law / (f_c/kn)",
                    float(off.sum() * STEP / UNIT), 1.0, 1.01 * STEP / UNIT))
    path = normal_path("adhesive", [-1] * 50 + [1] * 50, OVERLAP)
    opening = -path[:, 0].min()
    lost = (KN * path[50:, 0] - F_C - path[50:, 1]).mean()
    rows.append(row("adhesive: attraction lost for good over kn x opening, closed from the plateau",
                    float(-lost / (KN * opening)), 1.0, TOLERANCE))
    axes.set(title="normal cycle", xlabel=r"overlap $\delta\, k_n/f_c$", ylabel=r"$f_n/f_c$ (compression positive)")
    return rows


def sliding_cycles(axes):
    """Each law above its own limit, and the adhesive one also where its net force is attractive."""
    rows = []
    for law, overlap, label in (("friction", 3e-6, "friction"), ("adhesive", 5e-6, "adhesive, compressed"),
                                ("adhesive", 1e-6, "adhesive, attractive"),
                                ("paper", 5e-6, "paper, compressed"), ("paper", 1e-6, "paper, attractive")):
        path = sliding_cycle(3 * FRICTION * overlap)
        found, _ = slide(law, overlap, path)
        limit = FRICTION * KN * found[:, 0]
        closed = slider(found[:, 0], path, limit)
        rows.append(row(f"{label}: sliding cycle, shear force / f_c", deviation(found[:, 2], np.abs(closed))))
        attraction = 0.0 if law == "friction" else F_C
        slides = np.abs(closed) >= limit * (1 - 1e-9)
        kept = ~slides if label == "adhesive, attractive" else np.ones(len(path), bool)
        rows.append(row(f"{label}: normal force meanwhile / f_c",
                        deviation(found[kept, 1], KN * found[kept, 0] - attraction)))
        if label == "adhesive, attractive":
            law_says = KN * found[slides, 0] - attraction
            rows.append(row(f"{label}: normal force in steps that slide over the law's (YADE passes none)",
                            float((found[slides, 1] / law_says).max()), 0.0, 0.0))
        slip = np.cumsum(path) * STEP / UNIT
        draw(axes, slip, closed / F_C, np.copysign(found[:, 2], closed) / F_C, label)
    found, pair = slide("bonded", 3e-6, sliding_cycle(3 * FRICTION * (3e-6 + UNIT)))
    first = int(np.argmax(np.diff(found[:, 2]) < -TOLERANCE * F_C))
    rows.append(row("bonded: shear force at the first slip / f_c", float(found[first, 2] / F_C),
                    FRICTION * (KN * 3e-6 + F_C) / F_C, 2 * KN * STEP / F_C))
    after = np.abs(found[first + 1 :, 2])
    rows.append(row("bonded: largest shear force after it / (mu kn delta)", float(after.max() / (FRICTION * KN * 3e-6)),
                    1.0, 1e-6))
    axes.set(title="sliding cycle", xlabel=r"slip $s\, k_t/f_c$", ylabel=r"$f_t/f_c$")
    return rows


def new_contacts(axes):
    """Frictional, and adhesive from the next look on."""
    rows = []
    for adhesion, label in ((None, "new contact, frictional"), ((F_C, FRICTION), "new contact, adhesive")):
        path = normal_path("adhesive", [1] * 60 + [-1] * 80, -1.03e-6, adhesion)
        touching = np.flatnonzero(path[:, 0] > 0)
        stuck_from = touching[0] + contact_laws.EVERY if adhesion else len(path)
        stuck = np.arange(len(path)) >= stuck_from
        adhesive = np.where(path[:, 0] > -UNIT, np.maximum(KN * path[:, 0] - F_C, -F_C), 0.0)
        closed = np.where(stuck, adhesive, np.maximum(KN * path[:, 0], 0.0))
        known = stuck | (np.arange(len(path)) < touching[0]) if adhesion else np.full(len(path), True)
        rows.append(row(f"{label}: deviation / f_c", deviation(path[known, 1], closed[known])))
        draw(axes, path[:, 0] / UNIT, closed / F_C, path[:, 1] / F_C, label)
    path = normal_path("paper", [1] * 60 + [-1] * 80, -1.03e-6, (F_C, FRICTION))
    closed = np.where(path[:, 0] > 0, KN * path[:, 0] - F_C, 0.0)
    rows.append(row("paper: new contact, adhesive from the first touch on: deviation / f_c", deviation(path[:, 1], closed)))
    draw(axes, path[:, 0] / UNIT, closed / F_C, path[:, 1] / F_C, "paper, new contact, adhesive")
    axes.set(title="new contact of adhesive spheres", xlabel=r"overlap $\delta\, k_n/f_c$", ylabel=r"$f_n/f_c$")
    return rows


def dashpot(axes):
    """The paper's law with viscous damping: pressed together, drawn apart at one speed and at five times it, let go."""
    mass, speed = 2600.0 * np.pi / 6 * DIAMETER**3, STEP / 1e-6
    ratio = 0.5 * F_C / (speed * 2 * np.sqrt(KN * mass / 2))  # half of f_c at that speed
    moves = np.array([1] * 30 + [0] * 5 + [-1] * 10 + [-5] * 6)
    path = normal_path("paper", moves, 2.03e-6, viscous_damping=ratio)
    repulsion = np.maximum(KN * path[:, 0] + 0.5 * F_C * moves, 0.0)
    closed = np.where(path[:, 0] > 0, repulsion - F_C, 0.0)
    draw(axes, path[:, 0] / UNIT, closed / F_C, path[:, 1] / F_C, "paper, with a dashpot")
    axes.set(title="dashpot", xlabel=r"overlap $\delta\, k_n/f_c$", ylabel=r"$f_n/f_c$")
    held = PaperPair(2.03e-6, viscous_damping=ratio)
    held.move(-STEP, 0)
    moving = held.normal_force
    held.cell.hold(1)
    return [row("paper with a dashpot: deviation / f_c", deviation(path[:, 1], closed), tolerance=1e-4),
            row("what of its force a hold takes / f_c", float((moving - held.normal_force) / F_C), 0.5, 1e-4)]


def draw(axes, x, closed, measured, label):
    line = axes.plot(x, closed, "-", linewidth=1)[0]
    axes.plot(x, measured, ".", color=line.get_color(), markersize=3, label=label)


ROWS = {"normal_cycles": normal_cycles, "sliding_cycles": sliding_cycles, "new_contacts": new_contacts, "dashpot": dashpot}


def verify(c, names):
    sys.path.insert(0, str(c.program.parent))  # compact_cell
    figure, panels = plt.subplots(1, len(names), figsize=(4.3 * len(names), 3.8), squeeze=False)
    rows = []
    for name, axes in zip(names, panels[0]):
        rows += ROWS[name](axes)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=6, loc="upper left")
    figure.savefig(c.product("contact_laws.png"), dpi=100, bbox_inches="tight")
    c.table(judged.table(rows))
    print(*judged.table(rows), sep="\n")
    return judged.verdict(rows)


if __name__ == "__main__":
    arguments = campaign.parser(HERE, __doc__, rows=True).parse_args()
    sys.exit(campaign.main(HERE, arguments, {name: row.__doc__ for name, row in ROWS.items()}, lambda c: verify(c, arguments.rows or list(ROWS))))
