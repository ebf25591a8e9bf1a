"""Rows on laws in closed form: the solver where methods fail. Each takes a Program and returns a Row."""

import math

import numpy as np

from program import Row

BAR_FORCE = 0.994091678  # closed form (validation/bilinear_bar), A1 e_l = 1
BAR = ("solver.qn_noise=1e-12", "control.step=0.04")  # strains of 1e-5; four points of the path before the peak


def consistent_tangent(program):
    """Newton's method in pronounced softening: points cycle between loading and unloading."""
    case, softening = "../solver/biaxial_law.toml", ("control.end_time=0.4",)
    newton = program.run(case, "newton", "solver.operator=tangent", *softening)
    learned = program.run(case, "learned", "solver.operator=quasi_newton", *softening)
    end = newton.history()["time"][-1]
    return Row(f"operator = tangent stops at {end:.3g} of 0.4 s, exit status {newton.status}: {newton.rejected()} rejected steps, first: "
               f"{newton.reason()}",
               f"operator = quasi_newton (default for volume elements) reaches the end, exit status {learned.status}, "
               f"{learned.rejected()} rejected steps, {learned.evaluations()} evaluations in {learned.steps()} steps",
               {"Newton's method does not converge": newton.status == 3,
                "it says that it oscillates or diverges": newton.reason().split()[0] in ("oscillates", "diverges"),
                "the learned tangents go through without a cut": learned.status == 0 and learned.rejected() == 0})


def newton_cycle(program):
    """The bilinear bar of 21 elements: Newton's method cycles on the kink, the learned tangent does not."""
    newton = program.run("bar.toml", "bar_newton", "solver.operator=tangent", "control.min_step=0.04", *BAR)
    default = program.run("bar.toml", "bar_default", "solver.operator=quasi_newton", "solver.tolerance=5e-3", *BAR)
    learned = program.run("bar.toml", "bar_learned", "solver.operator=quasi_newton", "solver.tolerance=1e-8", "solver.qn_min=-0.2", *BAR)
    force = learned.history()["force"][-1] * 21 * 1e3
    other = default.history()["force"][-1] * 21 * 1e3
    return Row(f"operator = tangent, no cutting: exit status {newton.status}, {newton.reason()}",
               f"quasi_newton with qn_min = -0.2, below the law's slope A2/A1 = -0.1: tolerance 1e-8, {learned.rejected()} rejected steps, "
               f"{learned.evaluations()} evaluations in {learned.steps()} steps, force {force:.6f}, closed form {BAR_FORCE:.6f}. The default "
               f"qn_min = 0.02 at 5e-3 ends in another equilibrium: force {other:.4f}",
               {"Newton's method cycles": newton.status == 3 and "oscillates" in newton.reason(),
                "the learned tangents go through without a cut": learned.status == 0 and learned.rejected() == 0,
                "to the closed form within 1e-4": abs(force - BAR_FORCE) < 1e-4 * BAR_FORCE})


def elastic_operator(program):
    """The paper's operator with a tight tolerance."""
    case, settings = "../solver/biaxial_law.toml", ("solver.tolerance=1e-4", "control.end_time=0.26", "control.min_step=0.02")
    elastic = program.run(case, "elastic", "solver.operator=elastic", *settings)
    patient = program.run(case, "elastic_patient", "solver.operator=elastic", "solver.max_iterations=200", *settings)
    learned = program.run(case, "elastic_learned", "solver.operator=quasi_newton", *settings)
    return Row(f"operator = elastic at 1e-4: stops after {elastic.steps()} of 13 steps, exit status {elastic.status}: {elastic.reason()}; "
               f"with 200 iterations allowed: {patient.evaluations()} evaluations",
               f"operator = quasi_newton: all {learned.steps()} steps with at most 15 iterations, exit status {learned.status}, "
               f"{learned.evaluations()} evaluations",
               {"the elastic operator is too slow or stagnates, and the log names it":
                    elastic.status == 3 and ("too slowly" in elastic.reason() or "stagnates" in elastic.reason()),
                "the learned tangents converge": learned.status == 0,
                "at less than half the evaluations": patient.status != 0 or 2 * learned.evaluations() < patient.evaluations()})


def large_increments(program):
    """Increments too large at the peak, with and without cutting."""
    case, settings = "../solver/biaxial_law.toml", ("control.step=0.1", "control.end_time=0.4")
    whole = program.run(case, "no_cutting", "control.min_step=0.1", *settings)
    cut = program.run(case, "cutting", *settings)
    return Row(f"without cutting (min_step = step = 5e-3 of strain): exit status {whole.status} at {whole.history()['time'][-1]:.2g} s, "
               f"{whole.reason()}; its {whole.steps()} steps are kept",
               f"default min_step: {cut.rejected()} attempts rejected and cut, end reached, exit status {cut.status}, "
               f"{cut.evaluations()} evaluations in {cut.steps()} steps",
               {"without cutting the run ends with 3 and its data": whole.status == 3 and whole.steps() > 0,
                "with cutting it recovers": cut.status == 0 and cut.rejected() > 0 and math.isclose(cut.history()["time"][-1], 0.4)})


ROWS = {"consistent_tangent": consistent_tangent, "newton_cycle": newton_cycle, "elastic_operator": elastic_operator,
        "large_increments": large_increments}
