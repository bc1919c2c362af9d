"""Writes cloud.vdb with OpenVDB's Python module: `apt-get install python3-openvdb`, then `/usr/bin/python3
make_cloud.py`.

A cumulus: balls on a flat base, with edges eroded by fractal noise. A fog volume named "density", values from 0 to 1,
saved as halves, voxels of 0.08 units, y up, the middle of the base at the origin.
"""
import os

import numpy as np
import pyopenvdb as vdb

VOXEL = 0.08
SIZE = (104, 52, 76)

rng = np.random.default_rng(7)


def value_noise(shape, cells):
    """Smooth noise in [-1, 1]: random values on a coarse lattice, interpolated."""
    lattice = rng.uniform(-1, 1, [n + 2 for n in cells])
    result = lattice
    for axis, (n, count) in enumerate(zip(cells, shape)):
        at = np.linspace(0, n, count, endpoint=False)
        cell = at.astype(int)
        f = at - cell
        f = f * f * (3 - 2 * f)
        f = f.reshape([-1 if i == axis else 1 for i in range(3)])
        result = np.take(result, cell, axis) * (1 - f) + np.take(result, cell + 1, axis) * f
    return result


def fractal(shape, first, octaves):
    total = np.zeros(shape)
    for i in range(octaves):
        total += value_noise(shape, [max(1, round(n * 2**i)) for n in first]) * 0.55**i
    return total


x, y, z = np.meshgrid(*[(np.arange(n) + 0.5) * VOXEL for n in SIZE], indexing="ij")
x -= SIZE[0] * VOXEL / 2
z -= SIZE[2] * VOXEL / 2
# Depth inside the nearest ball, in its radii.
inside = np.full(SIZE, -9.0)
for cx, cy, cz, radius in [
    (-2.5, 0.7, 0.2, 1.05), (-1.3, 1.2, -0.3, 1.35), (0.1, 1.7, 0.2, 1.65), (1.4, 1.1, 0.3, 1.35),
    (2.6, 0.7, -0.2, 0.95), (0.5, 0.8, 1.3, 1.1), (-0.8, 0.8, -1.3, 1.1), (0.4, 2.6, -0.1, 1.0), (-1.2, 0.6, 1.1, 0.9),
]:
    d = np.sqrt((x - cx) ** 2 + (y - cy) ** 2 + (z - cz) ** 2) / radius
    inside = np.maximum(inside, 1 - d)
density = np.clip((inside + 0.30 * fractal(SIZE, (7, 4, 5), 4)) / 0.28, 0, 1)
density *= np.clip((y - 0.25 - 0.12 * fractal(SIZE, (6, 2, 5), 3)) / 0.25, 0, 1)
density[density < 0.02] = 0

grid = vdb.FloatGrid(0.0)
grid.name = "density"
grid.gridClass = vdb.GridClass.FOG_VOLUME
grid.saveFloatAsHalf = True
grid.copyFromArray(np.ascontiguousarray(density, dtype=np.float32))
grid.prune()
# The sample (0, 0, 0) is at the centre of the first voxel.
origin = (-SIZE[0] / 2 + 0.5, 0.5, -SIZE[2] / 2 + 0.5)
grid.transform = vdb.createLinearTransform(voxelSize=VOXEL)
grid.transform.translate([o * VOXEL for o in origin])
vdb.write(os.path.join(os.path.dirname(os.path.abspath(__file__)), "cloud.vdb"), grids=[grid])
