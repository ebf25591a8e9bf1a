#!/usr/bin/python3
"""Thickness and inclination of a shear band, from results.h5.

    femxdem band DIR [--from STEP] [--to STEP]

Thickness: full width at half height of the second invariant of the logarithmic strain along the normal of the band,
averaged along the band. Inclination: angle between the band and the lateral axis x, in degrees. Both in the current
configuration, of the strain since STEP of --from (default: of the whole strain). Values between Gauss points are
interpolated linearly, so any mesh will do.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from results import ResultsError, deformed_points, end_with, read_mesh, read_step, strain_invariant_between


@dataclass
class Band:
    thickness: float  #: mean over the stations, in the unit of the positions
    thickness_scatter: float  #: standard deviation over the stations
    inclination: float  #: from the lateral axis, -90 to 90 degrees
    centre: np.ndarray  #: (2,) a point on the band
    stations: int  #: profiles that were measured
    peak: float  #: mean height of the profiles


def interpolator(positions, values):
    """Linear interpolation over the triangles between positions; NaN outside and in triangles that bridge a hole."""
    triangles = Delaunay(positions)
    corners = positions[triangles.simplices]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    bridges = longest > 4 * np.median(longest)
    linear = LinearNDInterpolator(triangles, values)

    def field(x):
        values = linear(x)
        inside = np.isfinite(values)
        values[inside] = np.where(bridges[triangles.find_simplex(x[inside])], np.nan, values[inside])
        return values

    return field


def axes_of(inclination):
    """Unit vectors along and across a band at an inclination in degrees."""
    angle = np.radians(inclination)
    return np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])


def strongest_line(positions, field, spacing):
    """Inclination and centre of the straight strip across the body with the largest mean of the field, of which the highest fifth
    counts alike: a hot corner is no band."""
    lower, upper = positions.min(axis=0), positions.max(axis=0)
    x = np.stack(np.meshgrid(*(np.arange(a, b, spacing) for a, b in zip(lower, upper))), axis=-1).reshape(-1, 2)
    values = field(x)
    x, values = x[np.isfinite(values)], values[np.isfinite(values)]
    values = np.minimum(values, np.quantile(values, 0.8))
    strip = 2 * spacing
    best = (-np.inf, 0.0, x.mean(axis=0))
    for inclination in np.arange(-90, 90, 3.0):
        _, across = axes_of(inclination)
        strip_of = ((x @ across - (x @ across).min()) / strip).astype(int)
        count = np.bincount(strip_of)
        # Strips that cut off a corner are no bands.
        long_enough = count * spacing**2 / strip > 0.6 * min(upper - lower)
        means = np.where(long_enough, np.bincount(strip_of, values) / np.maximum(count, 1), -np.inf)
        strongest = int(np.argmax(means))
        if means[strongest] > best[0]:
            best = (means[strongest], inclination, x[strip_of == strongest].mean(axis=0))
    return best[1], best[2]


def width_at_half_height(s, profile):
    """Position of the peak nearest to s = 0, height and full width at half of it; None where a side is cut off."""
    peak = int(np.argmin(np.abs(s)))
    while True:
        around = slice(max(peak - 1, 0), peak + 2)
        higher = around.start + int(np.nanargmax(profile[around]))
        if higher == peak or not profile[higher] > profile[peak]:
            break
        peak = higher
    half = profile[peak] / 2
    ends = []
    for direction in (-1, 1):
        k = peak
        while 0 <= k + direction < len(s) and profile[k + direction] > half:
            k += direction
        outside = k + direction
        if not (0 <= outside < len(s)) or not np.isfinite(profile[outside]):
            return None
        share = (profile[k] - half) / (profile[k] - profile[outside])
        ends.append(s[k] + share * (s[outside] - s[k]))
    return s[peak], profile[peak], ends[1] - ends[0], (ends[0] + ends[1]) / 2


def profiles(field, inclination, centre, reach, spacing):
    """Ridge positions, heights and widths of the profiles across a line, one for each station along it."""
    along, across = axes_of(inclination)
    s = np.arange(-reach, reach, spacing / 4)
    s = s - s[np.argmin(np.abs(s))]
    starts = centre + np.arange(-reach, reach, spacing)[:, None] * along
    starts = starts[np.isfinite(field(starts))]
    found = []
    for start, profile in zip(starts, field(starts[:, None] + s[:, None] * across)):
        measured = width_at_half_height(s, profile)
        if measured:
            _, height, width, middle = measured
            found.append((*(start + middle * across), height, width))
    return np.array(found).reshape(-1, 4)


def line_through(points, weights):
    """Inclination [degrees] and centre of the weighted principal axis of points (n, 2)."""
    centre = np.average(points, axis=0, weights=weights)
    _, axes = np.linalg.eigh(np.cov(points.T, aweights=weights))
    inclination = np.degrees(np.arctan2(axes[1, -1], axes[0, -1]))
    return (inclination + 90) % 180 - 90, centre


def measure_band(positions, values):
    """Band of a scalar field: values (n,) at positions (n, 2). The line with the largest mean starts the search; the
    weighted principal axis of the ridge, found profile by profile, refines it. Throws ResultsError where there is none.
    """
    positions, values = np.reshape(positions, (-1, 2)), np.ravel(values)
    field = interpolator(positions, values)
    lower, upper = positions.min(axis=0), positions.max(axis=0)
    spacing = np.sqrt(np.prod(upper - lower) / len(positions)) / 2
    inclination, centre = strongest_line(positions, field, spacing)
    for _ in range(8):
        found = profiles(field, inclination, centre, np.linalg.norm(upper - lower), spacing)
        if len(found) < 3:
            raise ResultsError("no band: nowhere along its strongest line does the strain fall below half of its peak on both sides; "
                               "measure the strain since a later step (--from)")
        # Stations that slid onto another band lie far from the line of the others.
        _, across = axes_of(inclination)
        offset = (found[:, :2] - np.median(found[:, :2], axis=0)) @ across
        near = np.abs(offset - np.median(offset)) <= 0.75 * np.median(found[:, 3])
        if near.sum() < 3:
            raise ResultsError("no band: the ridge of the strain is not a line")
        found = found[near]
        last = inclination
        inclination, centre = line_through(found[:, :2], found[:, 2])
        if abs((inclination - last + 90) % 180 - 90) < 0.01:
            break
    return Band(found[:, 3].mean(), found[:, 3].std(), inclination, centre, len(found), found[:, 2].mean())


def mean_profile(positions, values, band, reach):
    """The field across a band, averaged along it: distance from the band (n,) and mean value (n,), from -reach to reach. Each
    profile is laid with its middle at half height at 0."""
    positions, values = np.reshape(positions, (-1, 2)), np.ravel(values)
    field = interpolator(positions, values)
    along, across = axes_of(band.inclination)
    span = np.linalg.norm(np.ptp(positions, axis=0))
    spacing = np.sqrt(np.prod(np.ptp(positions, axis=0)) / len(positions)) / 2
    s = np.arange(-reach, reach + spacing / 8, spacing / 4)
    profiles_found = []
    for start in band.centre + np.arange(-span, span, spacing)[:, None] * along:
        wide = np.arange(-span, span, spacing / 4)
        profile = field(start + wide[:, None] * across)
        if not np.isfinite(profile[np.argmin(np.abs(wide))]):
            continue
        measured = width_at_half_height(wide, profile)
        if measured and abs(measured[3]) < band.thickness:
            profiles_found.append(np.interp(s + measured[3], wide, profile))
    if not profiles_found:
        raise ResultsError("no profile across the band falls to half of its peak on both sides")
    sums = np.array(profiles_found)
    counts = np.isfinite(sums).sum(axis=0)
    return s, np.where(counts > 0, np.nansum(sums, axis=0) / np.maximum(counts, 1), np.nan)


def band_of_run(folder, first=None, last=None):
    """Band of the strain up to an output step (default: the last), or since the output step `first`."""
    mesh, step = read_mesh(folder), read_step(folder, last)
    values = step.fields["strain_invariant"]
    if first is not None:
        values = strain_invariant_between(read_step(folder, first), step)
    return measure_band(deformed_points(mesh, step), values)


def main():
    parser = argparse.ArgumentParser(prog="femxdem band", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", metavar="DIR", help="folder that `femxdem run` wrote")
    parser.add_argument("--from", dest="first", type=int, metavar="STEP", help="output step where the strain starts")
    parser.add_argument("--to", dest="last", type=int, metavar="STEP", help="output step where it ends (default: the last)")
    arguments = parser.parse_args()
    try:
        band = band_of_run(arguments.folder, arguments.first, arguments.last)
    except ResultsError as error:
        end_with("band", error)
    print(f"thickness {band.thickness:.4g} m (scatter {band.thickness_scatter:.2g} over {band.stations} profiles), "
          f"inclination {band.inclination:.1f} degrees from the lateral axis, peak {band.peak:.3g}")


if __name__ == "__main__":
    main()
