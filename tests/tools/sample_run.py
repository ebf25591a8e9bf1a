"""Writes the files of a run with a known deformation, in the format of fe_master/results.hpp."""

import h5py
import numpy as np

CASE = """
[mesh]
type = "rectangle"
[ve]
confining_stress = 1e5
[[load]]
edge = "right"
kind = "pressure"
value = 2e5
[[monitor]]
name = "force"
quantity = "reaction_y"
edge = "top"
[[monitor]]
name = "top"
quantity = "displacement_y"
edge = "top"
"""
HEADER = "step,time,load_factor,iterations,evaluations,dem_steps,residual,force,top,dem_seconds,wall_s\n"


def rectangle(nx, ny, width, height):
    """Nodes and 8-node elements of a rectangle, structured."""
    number = {}
    nodes, elements = [], []
    for j in range(2 * ny + 1):
        for i in range(2 * nx + 1):
            if i % 2 == 0 or j % 2 == 0:
                number[i, j] = len(nodes)
                nodes.append((width * i / (2 * nx), height * j / (2 * ny)))
    around = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    for j in range(0, 2 * ny, 2):
        for i in range(0, 2 * nx, 2):
            elements.append([number[i + a, j + b] for a, b in around])
    return np.array(nodes), np.array(elements)


def gauss_points(nodes, elements):
    """2 x 2 points (elements, 4, 2) of rectangular elements."""
    corners = nodes[elements[:, :4]]
    middle, half = corners.mean(axis=1), np.ptp(corners, axis=1) / 2 / np.sqrt(3)
    signs = np.array([(-1, -1), (1, -1), (-1, 1), (1, 1)])
    return middle[:, None] + half[:, None] * signs


def write_run(folder, displacement, gradient, steps, nx=16, ny=32):
    """A 1 x 2 specimen: displacement(x, step) (n, 2) and gradient(x, step) (n, 2, 2) at the given output steps."""
    nodes, elements = rectangle(nx, ny, 1.0, 2.0)
    points = gauss_points(nodes, elements)
    flat = points.reshape(-1, 2)
    (folder / "case.toml").write_text(CASE)
    rows = [f"{k},{k},0,1,{k},10,1e-3,{-2e5 * k},{-0.02 * k},0.1,0.2\n" for k in steps]
    (folder / "history.csv").write_text(HEADER + "".join(rows))
    with h5py.File(folder / "results.h5", "w") as h5:
        h5["mesh/nodes"], h5["mesh/elements"], h5["mesh/points"] = nodes, elements, points
        for step in steps:
            F = np.tile(np.eye(3), (len(flat), 1, 1))
            F[:, :2, :2] += gradient(flat, step)
            group = h5.create_group(f"steps/{step:06d}")
            group.attrs.update(step=step, time=0.1 * step, load_factor=0.01 * step)
            group["nodes/displacement"] = np.pad(displacement(nodes, step), ((0, 0), (0, 1)))
            group["points/deformation_gradient"] = F.reshape(len(elements), 4, 9)
            squares = np.linalg.eigvalsh(np.swapaxes(F, 1, 2) @ F)
            logarithms = 0.5 * np.log(squares)
            invariant = np.linalg.norm(logarithms - logarithms.mean(axis=1, keepdims=True), axis=1)
            group["points/strain_invariant"] = invariant.reshape(len(elements), 4, 1)
            group["points/porosity"] = (0.4 + flat[:, 1]).reshape(len(elements), 4, 1)
