"""Rows on laws in closed form: the solver where methods fail. Each takes the Campaign and returns a Row."""

import math

import numpy as np

import band
import results
from row import Row

WEAK = ('region=[{name="weak",box=[0.33,0.83,0.51,1.01]}]', 'material.region=[{region="weak",cohesion=0.9e5}]', "control.end_time=0.6")
BAR_FORCE = 0.994091678  # closed form (validation/bilinear_bar), A1 e_l = 1
BAR = ("solver.qn_noise=1e-12", "control.step=0.04")  # strains of 1e-5; four points of the path before the peak


def consistent_tangent(program):
    """Newton's method in pronounced softening: points cycle between loading and unloading."""
    case, softening = "../solver/biaxial_law.toml", ("control.end_time=0.4",)
    newton = program.run(case, "newton", "solver.operator=tangent", *softening)
    learned = program.run(case, "learned", "solver.operator=quasi_newton", *softening)
    end = newton.history()["time"][-1]
    return Row(f"operator = tangent stops at {end:.3g} of 0.4 s, exit status {newton.status}: {len(newton.rejections())} rejected steps, first: "
               f"{newton.reason()}",
               f"operator = quasi_newton (default for volume elements) reaches the end, exit status {learned.status}, "
               f"{len(learned.rejections())} rejected steps, {learned.evaluations()} evaluations in {learned.steps()} steps",
               {"Newton's method does not converge": newton.status == 3,
                "it says that it oscillates or diverges": newton.reason().split()[0] in ("oscillates", "diverges"),
                "the learned tangents go through without a cut": learned.status == 0 and len(learned.rejections()) == 0})


def newton_cycle(program):
    """The bilinear bar of 21 elements: Newton's method cycles on the kink, the learned tangent does not."""
    newton = program.run("bar.toml", "bar_newton", "solver.operator=tangent", "control.min_step=0.04", *BAR)
    default = program.run("bar.toml", "bar_default", "solver.operator=quasi_newton", "solver.tolerance=5e-3", *BAR)
    learned = program.run("bar.toml", "bar_learned", "solver.operator=quasi_newton", "solver.tolerance=1e-8", "solver.qn_min=-0.2", *BAR)
    force = learned.history()["force"][-1] * 21 * 1e3
    other = default.history()["force"][-1] * 21 * 1e3
    return Row(f"operator = tangent, no cutting: exit status {newton.status}, {newton.reason()}",
               f"quasi_newton with qn_min = -0.2, below the law's slope A2/A1 = -0.1: tolerance 1e-8, {len(learned.rejections())} rejected steps, "
               f"{learned.evaluations()} evaluations in {learned.steps()} steps, force {force:.6f}, closed form {BAR_FORCE:.6f}. The default "
               f"qn_min = 0.02 at 5e-3 ends in another equilibrium: force {other:.4f}",
               {"Newton's method cycles": newton.status == 3 and "oscillates" in newton.reason(),
                "the learned tangents go through without a cut": learned.status == 0 and len(learned.rejections()) == 0,
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
               f"default min_step: {len(cut.rejections())} attempts rejected and cut, end reached, exit status {cut.status}, "
               f"{cut.evaluations()} evaluations in {cut.steps()} steps",
               {"without cutting the run ends with 3 and its data": whole.status == 3 and whole.steps() > 0,
                "with cutting it recovers": cut.status == 0 and len(cut.rejections()) > 0 and math.isclose(cut.history()["time"][-1], 0.4)})


def invariant(run):
    """|dev ln U| of all points at the end."""
    return results.read_step(run.folder).fields["strain_invariant"]


def first_gradient(program):
    """Past localisation the band of the first gradient is as thick as an element."""
    meshes, thickness, force = {"6 x 12": (6, 12), "12 x 24": (12, 24)}, {}, {}
    for element in ("q8", "second_gradient"):
        for name, (nx, ny) in meshes.items():
            run = program.run("biaxial.toml", f"{element}_{nx}", f"mesh.nx={nx}", f"mesh.ny={ny}", f"element.type={element}", *WEAK)
            thickness[element, name] = band.band_of_run(run.folder).thickness
            force[element, name] = -run.history()["force"][-1]
    texts, ratios = {}, {}
    for element in ("q8", "second_gradient"):
        t, f = ([values[element, name] for name in meshes] for values in (thickness, force))
        ratios[element] = t[1] / t[0], f[1] / f[0]
        texts[element] = (f"thickness {t[0]:.3f} m on 6 x 12, {t[1]:.3f} m on 12 x 24 (elements {1 / 6:.3f} and {1 / 12:.3f} m), force at "
                          f"2.4 % of strain {f[0] / 1e5:.3f} and {f[1] / 1e5:.3f} sigma_0 W")
    return Row("Q8 of the first gradient: " + texts["q8"], "second gradient: " + texts["second_gradient"],
               {"without the second gradient half the element gives less than 0.7 of the thickness": ratios["q8"][0] < 0.7,
                "and a force that is more than 5 % lower": ratios["q8"][1] < 0.95,
                "with it the thickness stays within 20 %": abs(ratios["second_gradient"][0] - 1) < 0.2,
                "and the force within 1 %": abs(ratios["second_gradient"][1] - 1) < 0.01})


def coarse_mesh(program):
    """Elements too large for D: the program says so before the run, with the element or the D that would do."""
    coarse = program.run("biaxial.toml", "coarse", "element.D=250.0", *WEAK)
    fine = program.run("biaxial.toml", "second_gradient_12", "mesh.nx=12", "mesh.ny=24", *WEAK)
    warning, none = coarse.line("the expected band is"), fine.line("the expected band is")
    width, size = band.band_of_run(coarse.folder).thickness, 1 / 6
    proper = band.band_of_run(fine.folder).thickness / math.sqrt(8)
    return Row(f"D = 250 N on elements of {size:.3f} m: band {width:.3f} m = {width / size:.1f} elements, where the band of D = 2000 N on 12 x 24 "
               f"scaled by sqrt(D) is {proper:.3f} m",
               f"`{warning.removeprefix('warning: ')}`; on 12 x 24 with D = 2000 N: {'no warning' if not none else none}",
               {"the coarse mesh is off by more than 20 %": abs(width / proper - 1) > 0.2, "a warning says so": "elements of 0.167 m" in warning,
                "and none where the mesh is fine enough": not none})


def identical_points(program):
    """Without an imperfection nothing leaves the homogeneous solution."""
    same = program.run("biaxial.toml", "identical", "control.end_time=0.6")
    started = program.run("biaxial.toml", "started", "control.end_time=0.6", "solver.start_amplitude=0.5", "solver.start_time=0.26")
    weak = program.run("biaxial.toml", "second_gradient_6", *WEAK)
    uneven = [invariant(run).max() / invariant(run).mean() for run in (same, started, weak)]
    return Row(f"identical points: exit status {same.status}, largest strain {uneven[0]:.2f} of the mean at 2.4 %, past the peak at "
               f"{8 * same.history()['time'][int(np.argmin(same.history()['force']))] / 2:.2g} %",
               f"`{same.line('all points are identical').removeprefix('warning: ')}`; with solver.start_amplitude = 0.5 {uneven[1]:.2f} of the "
               f"mean, with a weak element {uneven[2]:.2f}",
               {"identical points stay homogeneous past the peak": uneven[0] < 1.1,
                "the program warns": "all points are identical" in same.said and "start_amplitude" in same.said,
                "a seeded start localises": uneven[1] > 1.4, "a weak element localises": uneven[2] > 2,
                "and neither is warned of": "identical" not in started.said + weak.said})


def solution(run):
    """Which solution a biaxial run has ended in: homogeneous, or the band and where it crosses the axis x = 1/2 m."""
    values = invariant(run)
    if values.max() < 1.2 * values.mean():
        return "homogeneous"
    found = band.band_of_run(run.folder)
    points = results.deformed_points(results.read_mesh(run.folder), results.read_step(run.folder)).reshape(-1, 2)
    across = band.axes_of(found.inclination)[1]
    strained = points[values.ravel() > 0.5 * values.max()]
    elsewhere = np.mean(np.abs((strained - found.centre) @ across) > found.thickness)
    if elsewhere > 0.25:
        return "two bands"
    height = found.centre[1] + (0.5 - found.centre[0]) * math.tan(math.radians(found.inclination))
    return f"one band at {found.inclination:+.0f} degrees through y = {height:.2f} m"


def uniqueness(program):
    """One step started in five random directions: several solutions of one problem."""
    end = "control.end_time=0.9"
    point = program.path("biaxial.toml", "homogeneous", end)  # one material point: the homogeneous solution
    history = point.history()
    homogeneous = -history["stress_yy"][-1] * math.exp(history["strain_xx"][-1]) / 1e5
    runs = {seed: program.run("biaxial.toml", f"seed_{seed}", "mesh.nx=8", "mesh.ny=16", end, "solver.start_amplitude=0.5",
                              "solver.start_time=0.26", f"solver.start_seed={seed}") for seed in range(1, 6)}
    found = {seed: solution(run) for seed, run in runs.items()}
    force = {seed: -run.history()["force"][-1] / 1e5 for seed, run in runs.items()}
    draw_solutions(runs, force, program.product("uniqueness.png"))
    bands = {sign for sign in "+-" if any(f"band at {sign}" in text for text in found.values())}
    return Row(f"one material point, or elements that stay homogeneous: {homogeneous:.3f} sigma_0 W at 3.6 %, as if it were the only solution",
               "; ".join(f"start_seed = {seed}: {found[seed]}, {force[seed]:.3f}" for seed in runs),
               {"every run comes to its end": all(run.status == 0 for run in (point, *runs.values())),
                "no start stays homogeneous": "homogeneous" not in found.values(),
                "a band and its conjugate are found": len(bands) == 2,
                "at a force below the homogeneous one": max(force.values()) < 0.97 * homogeneous})


def draw_solutions(runs, force, file):
    import matplotlib.pyplot as plt

    from plot import draw_map

    figure, panels = plt.subplots(1, len(runs), figsize=(2.0 * len(runs), 3.8))
    for axes, (seed, run) in zip(panels, runs.items()):
        draw_map(axes, results.read_mesh(run.folder), results.read_step(run.folder), "strain_invariant")
        axes.set_title(f"seed {seed}\nforce {force[seed]:.3f}", fontsize=7)
    figure.savefig(file, dpi=70, bbox_inches="tight")


AUTOMATIC = ("control.mode=automatic", 'control.loads=["inner"]', "control.measure=opening", "control.measure_edge=inner", "control.end_time=8.0")
MEASURED = ("control.mode=measure", 'control.loads=["inner"]', "control.measure=volume", "control.measure_edge=inner",
            "control.rate=0.016", "control.end_time=5.0")
LAST_OPENING = 0.05  # m, of the inner radius of 1 m


def moved_wall(nt=4):
    """Loads in place of the inner pressure: every node of the inner wall moves outwards, by LAST_OPENING at the end."""
    loads = ['{edge="start",kind="displacement",component="y",value=0.0}', '{edge="end",kind="displacement",component="x",value=0.0}']
    for k in range(2 * nt + 1):
        x, y = math.cos(math.pi / 4 * k / nt), math.sin(math.pi / 4 * k / nt)
        for component, direction, held in (("x", x, 2 * nt), ("y", y, 0)):
            if k != held:
                loads.append(f'{{point=[{x:.6f},{y:.6f}],kind="displacement",component="{component}",value={LAST_OPENING * direction!r}}}')
    return f"load=[{','.join(loads)}]"


def pressure_curve(run):
    """Opening [m] and pressure [Pa] inside: its factor, or from the reaction r_x = p (a + opening) of the moved wall."""
    h = run.history()
    opening = np.array(h["wall_x"]) * math.pi / 2  # the mean of cos over the quarter is 2 / pi
    moved = np.max(h["pressure"]) == 0
    return opening, np.array(h["reaction_x"]) / (1 + opening) if moved else np.array(h["pressure"])


def limit_pressure(program):
    """A cylinder under inner pressure: load control ends at the limit, automatic control passes it."""
    load = program.run("cylinder.toml", "load_control")
    runs = {"automatic control": program.run("cylinder.toml", "automatic_control", *AUTOMATIC),
            "cavity volume": program.run("cylinder.toml", "volume_control", *MEASURED),
            "moved wall": program.run("cylinder.toml", "moved_wall", moved_wall())}
    curves = {name: pressure_curve(run) for name, run in runs.items()}
    opening, pressure = curves["automatic control"]
    peak, end = int(np.argmax(pressure)), min(curve[0][-1] for curve in curves.values())
    grid = np.linspace(opening[peak], end, 100)
    branch = np.interp(grid, opening, pressure)
    off = {name: np.abs(np.interp(grid, *curve) / branch - 1).max() for name, curve in curves.items() if name != "automatic control"}
    draw_limit(curves, pressure_curve(load), program.product("limit_pressure.png"))
    return Row(f"load control: exit status {load.status} at {pressure_curve(load)[1][-1]:.4f} Pa, opening {pressure_curve(load)[0][-1]:.4f} m: "
               f"{load.reason()}",
               f"automatic control passes the limit {pressure.max():.4f} Pa at {opening[peak]:.4f} m and softens to {branch[-1]:.4f} Pa at "
               f"{end:.4f} m; there control by the cavity's volume differs by at most {100 * off['cavity volume']:.2f} %, by the moved wall by "
               f"{100 * off['moved wall']:.2f} %",
               {"load control ends at the limit": load.status == 3 and abs(pressure_curve(load)[1][-1] / pressure.max() - 1) < 0.01,
                "the others come to the end": all(run.status == 0 for run in runs.values()),
                "automatic control has switched": bool(runs["automatic control"].line("limit point near")),
                "the branch softens by more than 5 %": branch[-1] < 0.95 * pressure.max(),
                "within 1 % of control by displacement": off["moved wall"] < 0.01, "and by volume": off["cavity volume"] < 0.01})


def draw_limit(curves, load, file):
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(5, 3.4))
    for (name, (opening, pressure)), style in zip(curves.items(), ("-", ":", "--")):
        axes.plot(opening, pressure, style, label=name)
    axes.plot(*load, "k.", markersize=4, label="load control")
    axes.set(xlabel="opening of the inner wall [m]", ylabel="inner pressure [Pa]")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    figure.savefig(file, dpi=100, bbox_inches="tight")


ROWS = {"consistent_tangent": consistent_tangent, "newton_cycle": newton_cycle, "elastic_operator": elastic_operator,
        "large_increments": large_increments, "first_gradient": first_gradient, "coarse_mesh": coarse_mesh,
        "limit_pressure": limit_pressure, "identical_points": identical_points,
        "uniqueness": uniqueness}
