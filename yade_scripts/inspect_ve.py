#!/usr/bin/python3
"""Draws a prepared volume element, packing.png, force_chains.png, fabric_rose.png, and finds its elastic stiffness,
affine (Eq. (2)) and relaxed: stiffness.json.

    inspect_ve.py STATE [--out FOLDER]

STATE is a file of the cache of `femxdem ve prepare`.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import contact_loop
from volume_element import Engine


class Packing:
    """What is drawn: positions x (n, 3) wrapped into the cell and radii (n,) [m], cell (3, 3) [m], contacts c, normal
    forces (m,) [N], compression positive."""

    def __init__(self, state):
        engine = Engine([])
        self.engine, self.ve = engine, engine.add(state)
        O = engine.O
        self.cell = np.array(O.cell.hSize).reshape(3, 3)
        x = np.array([O.cell.wrap(b.state.pos) for b in O.bodies])
        self.x, self.radius = x, np.array([getattr(b.shape, "radius", 0.0) for b in O.bodies])
        self.c = contact_loop.contacts(O)
        normal_forces = np.array([p.normalForce for p in self.c.phys]).reshape(-1, 3)
        self.force = np.einsum("ci,ci->c", normal_forces, self.c.normal)


def draw_packing(packing, file):
    """Spheres of the cell, from the front (z towards the reader), the nearest over the others."""
    figure, axes = plt.subplots(figsize=(5, 5))
    depth = packing.x[:, 2]
    near = (depth - depth.min()) / max(np.ptp(depth), 1e-300)
    for i in np.argsort(depth):
        shade = plt.cm.Blues(0.25 + 0.6 * near[i])
        axes.add_patch(plt.Circle(packing.x[i, :2], packing.radius[i], facecolor=shade, edgecolor="0.3", linewidth=0.3))
    _frame(axes, packing)
    axes.set_title(f"{len(packing.radius)} spheres")
    _save(figure, file)


def draw_force_chains(packing, file):
    """Contacts as bars from centre to centre, as thick as their normal force over the mean; tension in red."""
    figure, axes = plt.subplots(figsize=(5, 5))
    mean = np.abs(packing.force).mean()
    start = packing.x[packing.c.ids[:, 0]]
    end = start + packing.c.normal * packing.c.length[:, None]
    for a, b, f in zip(start, end, packing.force):
        colour = "tab:red" if f < 0 else "0.15"
        axes.plot([a[0], b[0]], [a[1], b[1]], color=colour, linewidth=0.8 * abs(f) / mean, solid_capstyle="round")
    _frame(axes, packing)
    axes.set_title(f"{len(packing.force)} contacts; width: |normal force|, mean {mean:.3g} N; red: tension")
    _save(figure, file)


def draw_fabric_rose(packing, file):
    """Contacts and mean normal force by the direction of the normal's projection, in the three planes."""
    figure, row = plt.subplots(1, 3, figsize=(10, 3.6), subplot_kw={"projection": "polar"})
    edges = np.linspace(0, np.pi, 13)
    for axes, (i, j), name in zip(row, ((0, 1), (1, 2), (2, 0)), ("x-y", "y-z", "z-x")):
        angle = np.mod(np.arctan2(packing.c.normal[:, j], packing.c.normal[:, i]), np.pi)
        weight = np.hypot(packing.c.normal[:, i], packing.c.normal[:, j])
        count, _ = np.histogram(angle, edges, weights=weight)
        force, _ = np.histogram(angle, edges, weights=weight * packing.force)
        centre = 0.5 * (edges[1:] + edges[:-1])
        both = np.concatenate([centre, centre + np.pi])
        axes.bar(both, np.tile(count / count.mean(), 2), width=edges[1], color="tab:blue", alpha=0.5, label="contacts")
        ratio = np.tile(force / np.maximum(count, 1e-300) / packing.force.mean(), 2)
        axes.plot(np.append(both, both[0]), np.append(ratio, ratio[0]), color="tab:red", label="mean normal force")
        axes.set_title(name)
        axes.tick_params(labelsize=6)
    row[0].legend(loc="lower left", bbox_to_anchor=(-0.35, -0.2), fontsize=7)
    _save(figure, file)


def write_stiffness(packing, file):
    """Both stiffnesses, 6 x 6 [Pa] in the order xx, yy, zz, xy, yz, zx, with the moduli of their isotropic parts."""
    found = {}
    for name in ("affine", "relaxed"):
        out = np.empty(81)
        start = time.perf_counter()
        try:
            packing.engine.stiffness(packing.ve, out, name)
        except RuntimeError as reason:  # clumps, or contacts without stiffnesses
            print(f"{name} stiffness: {reason}")
            continue
        seconds = time.perf_counter() - start
        C = out.reshape(3, 3, 3, 3)
        K = np.einsum("iikk", C) / 9
        G = (np.einsum("ijij", C) - 3 * K) / 10
        matrix = C[contact_loop.I[:, None], contact_loop.J[:, None], contact_loop.I, contact_loop.J].tolist()
        found[name] = {"bulk_modulus": K, "shear_modulus": G, "seconds": seconds, "stiffness": matrix}
        print(f"{name} stiffness: bulk modulus {K:.4g} Pa, shear modulus {G:.4g} Pa, found in {seconds:.3f} s")
    if len(found) == 2:
        ratios = [found["relaxed"][m] / found["affine"][m] for m in ("bulk_modulus", "shear_modulus")]
        print("relaxed over affine: bulk modulus {:.3f}, shear modulus {:.3f}".format(*ratios))
    file.write_text(json.dumps(found, indent=1) + "\n")
    print(file)


def _frame(axes, packing):
    corners = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 0)]) @ packing.cell.T
    axes.plot(corners[:, 0], corners[:, 1], color="tab:orange", linewidth=1)
    axes.set_aspect("equal")
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m]")


def _save(figure, file):
    figure.savefig(file, dpi=120, bbox_inches="tight")
    plt.close(figure)
    print(file)


def _refuse(sentence):
    """Bad input: status 2, as the program's own."""
    print(sentence, file=sys.stderr)
    sys.exit(2)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("state", metavar="STATE", type=Path)
    parser.add_argument("--out", metavar="FOLDER", type=Path, default=Path("."))
    arguments = parser.parse_args()
    if not arguments.state.is_file():
        _refuse(f"{arguments.state}: no such file; give a state of the cache of `femxdem ve prepare`")
    try:
        packing = Packing(arguments.state.read_bytes())
    except (RuntimeError, MemoryError, ValueError) as error:
        _refuse(
            f"{arguments.state}: is not a whole volume element of this version of YADE ({error}); make it anew with "
            "`femxdem ve prepare`"
        )
    arguments.out.mkdir(parents=True, exist_ok=True)
    draw_packing(packing, arguments.out / "packing.png")
    draw_force_chains(packing, arguments.out / "force_chains.png")
    draw_fabric_rose(packing, arguments.out / "fabric_rose.png")
    write_stiffness(packing, arguments.out / "stiffness.json")


if __name__ == "__main__":
    main()
