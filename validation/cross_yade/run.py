#!/usr/bin/python3
"""One element driven by the finite-element master against YADE alone, on the same packings.

    validation/cross_yade/run.py [--spheres N] [--seeds 1 2 3 4 5] [--laws NAME ...] [--paths NAME ...] [--limit DISTANCE]
                                 [--list] [--record] [--runs FOLDER]

Table and figure after every row (a law on a path, all seeds), those of the paper's case first. Exit status 1 where an
element is further from YADE alone than --limit.
"""

import csv
import functools
import json
import re
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "tools"))
import campaign

import matplotlib.pyplot as plt
import numpy as np

from paths import CONFINING_STRESS, INCREMENT, PATHS
from results import read_columns

LAWS = {"cohesive": 'contact_law = "adhesive"\ncohesion = 1.0', "cohesionless": 'contact_law = "friction"\ncohesion = 0.0'}
INERTIAL_NUMBER = 5e-3
RATES = {"yade": 1.0, "yade_0.7_rate": 0.7, "yade_half_rate": 0.5}  # of YADE alone, over the element's
STRESSES = ("stress_xx", "stress_yy", "stress_zz", "stress_xy")

CASE = """# Made by validation/cross_yade/run.py: the volume element of one packing on one path.
[material]
type = "volume_element"

[ve]
cache = "../packings"
spheres = {spheres}
seed = {seed}
confining_stress = {stress!r}
inertial_number = {inertial_number!r}
max_unbalanced_force = 1.0
{law}

[solver]
tolerance = 2e-4

{path}"""


def case_file(c, law, seed, path, spheres):
    file = c.runs / "cases" / f"{law}_{seed}_{path.name}.toml"
    file.parent.mkdir(exist_ok=True)
    text = CASE.format(spheres=spheres, seed=seed, stress=CONFINING_STRESS, inertial_number=INERTIAL_NUMBER, law=LAWS[law],
                       path=path.segments())
    file.write_text(text)
    return file


@functools.cache
def packing(program, case):
    """State file of a volume element and its manifest, prepared where the cache does not have it."""
    text = subprocess.run([program, "ve", "prepare", case], check=True, capture_output=True, text=True).stdout
    state = Path(re.search(r"(\S+\.state)", text)[1])
    return state, json.loads(state.with_suffix(".json").read_text())


def compute(c, law, seed, path, spheres):
    """Columns of one packing on one path: of the element, and of YADE alone at each rate."""
    case = case_file(c, law, seed, path, spheres)
    element = c.path(case, f"element/{case.stem}")
    if element.status != 0:
        raise campaign.CampaignError(f"{element.folder}: {element.last_words()}")
    state, manifest = packing(c.program, case_file(c, law, seed, PATHS["biaxial"], spheres))
    found = {"element": element.history()}
    for name, factor in RATES.items():
        rate = INERTIAL_NUMBER / manifest["time_scale"] / path.rate() * factor
        table = c.runs / name / case.stem / "curve.csv"
        command = ["/usr/bin/python3", HERE / "yade_alone.py", state, path.name, str(rate), table]
        alone = c.once(f"{name}/{case.stem}", {"state": state.name, "path": path.name, "rate": rate},
                       lambda said: subprocess.run(command, stdout=said, stderr=said, env=campaign.ENVIRONMENT).returncode)
        if alone.status != 0:
            raise campaign.CampaignError(f"{alone.folder}: {alone.last_words()}")
        found[name] = read_columns(table)
    return found


def curve(columns, name, path):
    """Stresses over sigma_0 (points, 4), compression positive but shear as it is, and volumetric strain, at the element's
    increments of the way that the driven strain has gone."""
    c, shear = columns, "F_12" if name == "element" else "shear"
    driven = c[shear] if path.name == "simple_shear" else c["strain_yy"]
    way = np.concatenate([[0], np.abs(np.diff(driven)).cumsum()])
    stress = np.stack([c[s] for s in STRESSES], axis=1) / CONFINING_STRESS * np.array([-1, -1, -1, 1])
    volume = c["strain_xx"] + c["strain_yy"] + c["strain_zz"]
    length = np.abs(np.diff((0,) + path.targets)).sum()
    grid = np.linspace(0, length, max(2, round(length / INCREMENT)) + 1)
    at = lambda values: np.interp(grid, way, values)
    turned = np.concatenate([[0], np.abs(np.diff((0,) + path.targets)).cumsum()])
    return np.interp(grid, turned, (0,) + path.targets), np.stack([at(s) for s in stress.T], axis=1), at(volume)


def distance(one, other):
    """Root mean square over the path of the difference of stress over that of the stress, and of the volumetric strain."""
    rms = lambda x: float(np.sqrt(np.mean(np.sum(np.atleast_2d(x.T).T ** 2, axis=-1))))
    return rms(one[1] - other[1]) / rms(other[1]), rms((one[2] - other[2])[:, None])


def distances(curves):
    """(pairs, 2) distances of one packing on one path, of stress and of volumetric strain: of the element from YADE at each
    rate, and of YADE from itself at each two rates, those of the full and of half the rate last."""
    element = np.array([distance(curves["element"], curves[name]) for name in RATES])
    fast, middle, slow = (curves[name] for name in RATES)
    return element, np.array([distance(fast, middle), distance(middle, slow), distance(fast, slow)])


def scatter(curves_of_seeds):
    """Distance of YADE's curves of the seeds from their mean, averaged."""
    yade = [curves["yade"] for curves in curves_of_seeds]
    mean = (yade[0][0], np.mean([c[1] for c in yade], axis=0), np.mean([c[2] for c in yade], axis=0))
    return np.mean([distance(c, mean) for c in yade], axis=0)


HEADER = ("law", "path", "seed") + tuple(
    f"{pair}{what}" for pair in ("element_yade", "element_0.7", "element_half", "yade_0.7", "0.7_half", "yade_half")
    for what in ("", "_volume"))


def write_tables(c, results):
    """table.csv: every packing; the table: means over the seeds, in per cent."""
    with open(c.product("table.csv"), "w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(HEADER)
        for (law, name), curves_of_seeds in results.items():
            for seed, curves in curves_of_seeds.items():
                writer.writerow([law, name, seed] + [f"{x:.3e}" for x in np.concatenate(distances(curves)).ravel()])
    lines = ["| law | path | element - YADE at the element's rate [%] | YADE, this rate - half of it [%] | ratio | element - YADE, all rates [%] "
             "| YADE - YADE, all pairs of rates [%] | ratio | seeds [%] |", "|---|---|---|---|---|---|---|---|---|"]
    for (law, name), curves_of_seeds in results.items():
        both = [distances(curves) for curves in curves_of_seeds.values()]
        element, yade = (100 * np.mean([pair[k] for pair in both], axis=0) for k in (0, 1))
        pairs = (element[0], yade[-1]), (element.mean(axis=0), yade.mean(axis=0))
        with_volume = lambda d: f"{d[0]:.2f} ({d[1]:.3f})" if PATHS[name].held else f"{d[0]:.2f}"
        text = [word for e, y in pairs for word in (with_volume(e), with_volume(y), f"{e[0] / y[0]:.2f}")]
        text.append(with_volume(100 * scatter(list(curves_of_seeds.values()))))
        lines.append(f"| {law} | {name.replace('_', ' ')} | " + " | ".join(text) + " |")
    c.table(lines)
    return lines


def draw(file, results):
    names = list(dict.fromkeys(name for _, name in results))
    laws = list(dict.fromkeys(law for law, _ in results))
    figure, axes = plt.subplots(len(laws), len(names), figsize=(2.6 * len(names), 2.6 * len(laws)), squeeze=False)
    for (law, name), curves_of_seeds in results.items():
        one = axes[laws.index(law)][names.index(name)]
        component = 3 if name == "simple_shear" else 1
        for k, curves in enumerate(curves_of_seeds.values()):
            for series, style in (("yade", "-"), ("yade_half_rate", ":"), ("element", ".")):
                x, stress, _ = curves[series]
                one.plot(100 * np.abs(x), stress[:, component], style, color=f"C{k}", markersize=2.5, linewidth=0.8)
        one.set_title(f"{law}, {name.replace('_', ' ')}", fontsize=7)
        one.tick_params(labelsize=6)
        one.grid(alpha=0.3)
    for one in axes[-1]:
        one.set_xlabel("|driven strain| [%]", fontsize=7)
    for row in axes:
        row[0].set_ylabel(r"$\sigma_{yy}/\sigma_0$ (shear: $\sigma_{xy}/\sigma_0$)", fontsize=7)
    figure.suptitle("points: element; lines: YADE alone (dotted: half the rate); colours: seeds", fontsize=8)
    figure.tight_layout()
    figure.savefig(file, dpi=90)
    plt.close(figure)


def rows_in_order(laws, paths):
    """(law, path) pairs: what the paper does first, so that a campaign that is cut short still says something."""
    first = [p for p in ("biaxial", "triaxial_compression") if p in paths]
    rest = [p for p in paths if p not in first]
    return [(law, path) for group in (first, rest) for law in laws for path in group]


def follow(c, a):
    results, lines = {}, []
    for law, name in rows_in_order(a.laws, a.paths):
        for seed in a.seeds:
            columns = compute(c, law, seed, PATHS[name], a.spheres)
            curves = {series: curve(columns[series], series, PATHS[name]) for series in ("element", *RATES)}
            results.setdefault((law, name), {})[seed] = curves
            print(law, seed, name, " ".join(f"{x:.2e}" for x in np.concatenate(distances(curves))[:, 0]), flush=True)
        lines = write_tables(c, results)
        draw(c.product("cross_yade.png"), results)
    print("\n".join(lines))
    return int(any(distances(one)[0][:, 0].max() > a.limit for seeds in results.values() for one in seeds.values()))


def main():
    parser = campaign.parser(HERE, __doc__)
    parser.add_argument("--spheres", type=int, default=1000)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS))
    parser.add_argument("--paths", nargs="+", choices=PATHS, default=list(PATHS))
    parser.add_argument("--limit", type=float, default=float("inf"), help="of the distance of stresses, relative")
    a = parser.parse_args()
    rows = {f"{law}_{path}": f"{len(a.seeds)} packings" for law, path in rows_in_order(a.laws, a.paths)}
    return campaign.main(HERE, a, rows, lambda c: follow(c, a))


if __name__ == "__main__":
    sys.exit(main())
