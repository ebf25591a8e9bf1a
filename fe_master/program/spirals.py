#!/usr/bin/python3
"""Shear bands that start at the wall of a hollow cylinder: how many, how far they reach, how thick they are.

    femxdem spirals DIR [--from STEP] [--to STEP] [--angle 90]

Bands of a cylinder under pressure are logarithmic spirals: they cut every radius at the same angle, so that in the plane of
ln r and polar angle, a conformal map of the body, they are straight lines. On circles the ridges of the second invariant of
the logarithmic strain are linked from one circle to the next; a straight line through each chain gives the angle to the
radius. Thickness: full width along the normal of the spiral at half of the height over the higher one of the two valleys
beside it (a pressure strains the whole wall), averaged along it, all in the current configuration. A sector is continued by reflection at its two ends, which are planes of symmetry.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.signal import find_peaks

from band import axes_of, interpolator
from results import ResultsError, deformed_points, end_with, read_mesh, read_step, strain_invariant_between


@dataclass
class Spiral:
    start: float  #: polar angle at the wall [degrees]
    inclination: float  #: to the radius [degrees], positive where the polar angle grows outwards
    reach: float  #: radius where its ridge ends, or falls below a tenth of its peak / radius of the wall
    thickness: float  #: mean over the stations, in the unit of the positions; nan where no profile has two sides
    thickness_scatter: float  #: standard deviation over the stations
    stations: int  #: profiles that were measured
    peak: float  #: largest value along the ridge


def log_polar(positions, values, angle):
    """The field over (ln r, polar angle) of a sector of `angle` degrees, continued by reflection at both ends."""
    radius, theta = np.linalg.norm(positions, axis=1), np.arctan2(positions[:, 1], positions[:, 0])
    end = np.radians(angle)
    thetas = np.concatenate([theta, -theta, 2 * end - theta])
    near = (thetas > -0.75 * end) & (thetas < 1.75 * end)
    x = np.column_stack([np.tile(np.log(radius), 3), thetas])[near]
    return interpolator(x, np.tile(values, 3)[near])


def ridges_of(field, xi, angle, prominence):
    """Polar angles [rad] of the ridges on the circle ln r = xi: peaks that stand out by `prominence` of their height."""
    theta = np.radians(np.arange(-0.7 * angle, 1.7 * angle, 0.5))
    values = field(np.column_stack([np.full_like(theta, xi), theta]))
    values = np.where(np.isfinite(values), values, 0.0)
    peaks, found = find_peaks(values, prominence=1e-12)
    strong = found["prominences"] > prominence * values[peaks]
    return theta[peaks[strong]], values[peaks[strong]]


def link(field, circles, angle, prominence):
    """Chains of ridges outwards from the first circles: lists of (ln r, theta, value)."""
    h, chains = circles[1] - circles[0], []
    for circle in circles:
        thetas, values = ridges_of(field, circle, angle, prominence)
        free = np.ones(len(thetas), dtype=bool)
        for chain in sorted(chains, key=len, reverse=True):
            if circle - chain[-1][0] > 2.5 * h:
                continue
            dx = circle - chain[-1][0]
            tail = np.array(chain[-6:])
            slope = np.polyfit(tail[:, 0], tail[:, 1], 1)[0] if len(tail) >= 4 else 0.0
            window = 0.6 * dx + 0.02 if len(tail) >= 4 else 1.6 * dx + 0.02
            miss = np.where(free, np.abs(thetas - chain[-1][1] - slope * dx), np.inf)
            if len(miss) and miss.min() < window:
                best = int(np.argmin(miss))
                free[best] = False
                chain.append((circle, thetas[best], values[best]))
        chains += [[(circle, t, v)] for t, v in zip(thetas[free], values[free])]
    return [np.array(chain) for chain in chains]


def width_over_valleys(s, profile):
    """Full width of the peak nearest to s = 0 at half of its height over the higher one of the valleys beside it; None where
    the body ends before there is a valley and the profile has not fallen to half."""
    peak = int(np.argmin(np.abs(s)))
    while True:
        around = slice(max(peak - 1, 0), peak + 2)
        if not np.isfinite(profile[around]).all():
            return None
        higher = around.start + int(np.argmax(profile[around]))
        if profile[higher] <= profile[peak]:
            break
        peak = higher
    sides, valleys = {}, []
    for direction in (-1, 1):
        side = profile[peak::direction]
        side = side[: np.argmax(~np.isfinite(side))] if not np.isfinite(side).all() else side
        rises = side > np.minimum.accumulate(side) + 0.01 * profile[peak]
        if not rises.any() and side.min() > profile[peak] / 2:
            return None
        sides[direction] = side[: np.argmax(rises)] if rises.any() else side
        valleys.append(sides[direction].min())
    level = 0.5 * (profile[peak] + max(valleys))
    ends = []
    for direction, side in sides.items():
        k = int(np.argmax(side <= level))
        if k == 0:
            return None
        share = (side[k - 1] - level) / (side[k - 1] - side[k])
        ends.append(np.interp(k - 1 + share, np.arange(len(side)), np.abs(s[peak::direction][: len(side)] - s[peak])))
    return sum(ends)


def widths_along(field, chain, inclination, spacing):
    """Full widths along the normals of a spiral, one for each ridge point where the peak has two sides."""
    _, across = axes_of(inclination)
    t = np.arange(-0.6, 0.6, spacing / 4)
    t = t - t[np.argmin(np.abs(t))]
    widths = []
    for xi, theta, _ in chain:
        x = np.array([xi, theta]) + t[:, None] * across
        scale = np.exp(x[:, 0])
        arc = np.concatenate([[0.0], np.cumsum(0.5 * (scale[1:] + scale[:-1]) * np.diff(t))])
        width = width_over_valleys(arc - np.interp(0.0, t, arc), field(x))
        if width:
            widths.append(width)
    return np.array(widths)


def measure_spirals(positions, values, angle=90.0, wall=None, shortest=0.2, prominence=0.15):
    """Spirals of a scalar field, values (n,) at positions (n, 2) of a sector from the x axis about the origin, those longer
    than `shortest` in ln r that start at the wall, strongest first. A band and its reflection count once. `wall`: its
    radius, by default the least one. Throws ResultsError where there is none."""
    positions, values = np.reshape(positions, (-1, 2)), np.ravel(values)
    radius = np.linalg.norm(positions, axis=1)
    wall = wall or radius.min()
    field = log_polar(positions, values, angle)
    spacing = np.sqrt(np.radians(angle) * np.log(radius.max() / radius.min()) / len(positions))
    circles = np.arange(np.log(radius.min()) + 0.6 * spacing, np.log(radius.max()) - spacing, spacing)
    spirals = []
    for chain in link(field, circles, angle, prominence):
        faint = chain[:, 2] < 0.1 * chain[:, 2].max()
        chain = chain[:np.argmax(faint)] if faint.any() else chain
        if not len(chain):
            continue
        starts_at_wall = chain[0, 0] < np.log(wall) + 4 * spacing
        inside = -1e-9 <= chain[0, 1] <= np.radians(angle) + 1e-9
        if chain[-1, 0] - chain[0, 0] < shortest or not starts_at_wall or not inside:
            continue
        slope, theta = np.polyfit(chain[:, 0] - np.log(wall), chain[:, 1], 1)
        inclination = np.degrees(np.arctan(slope))
        # Near a plane of symmetry a band merges with its reflection, and past it goes on as that.
        planes = np.minimum(np.abs(chain[:, 1]), np.abs(np.radians(angle) - chain[:, 1]))
        beside = np.logical_or.accumulate(np.exp(chain[:, 0]) * planes < 0.25 * wall)
        widths = widths_along(field, chain[~beside], inclination, spacing)
        thickness = (widths.mean(), widths.std()) if len(widths) else (np.nan, np.nan)
        spirals.append(Spiral(float(np.degrees(theta)), float(inclination), float(np.exp(chain[-1, 0]) / wall), *map(float, thickness),
                              len(widths), float(chain[:, 2].max())))
    if not spirals:
        raise ResultsError("no band starts at the wall and goes on outwards; measure a later step (--to), or the strain since one (--from)")
    return sorted(spirals, key=lambda spiral: -spiral.peak)


def spirals_of_run(folder, first=None, last=None, angle=90.0):
    """Spirals of the strain up to an output step (default: the last), or since the output step `first`."""
    mesh, step = read_mesh(folder), read_step(folder, last)
    values = step.fields["strain_invariant"] if first is None else strain_invariant_between(read_step(folder, first), step)
    wall = np.linalg.norm(mesh.nodes + step.displacement, axis=1).min()
    return measure_spirals(deformed_points(mesh, step), values, angle, wall)


def main():
    parser = argparse.ArgumentParser(prog="femxdem spirals", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", help="folder that `femxdem run` wrote")
    parser.add_argument("--from", dest="first", type=int, metavar="STEP", help="output step where the strain starts")
    parser.add_argument("--to", dest="last", type=int, metavar="STEP", help="output step where it ends (default: the last)")
    parser.add_argument("--angle", type=float, default=90.0, help="of the sector [degrees]")
    arguments = parser.parse_args()
    try:
        spirals = spirals_of_run(arguments.folder, arguments.first, arguments.last, arguments.angle)
    except ResultsError as error:
        end_with("spirals", error)
    for one in spirals:
        print(f"from {one.start:.0f} degrees, {one.inclination:+.1f} degrees to the radius, reaches {one.reach:.2f} wall radii, "
              f"thickness {one.thickness:.3g} m (scatter {one.thickness_scatter:.2g} over {one.stations} profiles), peak {one.peak:.3g}")


if __name__ == "__main__":
    main()
