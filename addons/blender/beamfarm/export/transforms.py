"""Matrices as steps of the scene file."""

import numpy as np
from mathutils import Matrix

# A scale of 0 becomes so much of the largest one: the scene file's transforms can be inverted.
THIN = 1e-4


def solid(matrix):
    """`matrix`, where it makes all flat with a little thickness; None where it makes a line or a point of all."""
    left, sizes, right = np.linalg.svd(np.array(matrix.to_3x3(), dtype=np.float64))
    if not np.isfinite(sizes).all() or sizes[1] <= THIN * 0.1 * sizes[0]:
        return None
    if sizes[2] > THIN * 0.1 * sizes[0]:
        return matrix
    sizes[2] = THIN * sizes[0]
    thick = np.array(matrix, dtype=np.float64)
    thick[:3, :3] = left @ np.diag(sizes) @ right
    return Matrix(thick.tolist())


def matrix_step(matrix):
    """`{ matrix = ... }` of a 4 x 4 matrix; its last row is exact, whatever rounding left in it."""
    rows = [[float(number) for number in row] for row in matrix]
    rows[3] = [0.0, 0.0, 0.0, 1.0]
    return {"matrix": rows}


def is_identity(matrix):
    return all(matrix[i][j] == (1.0 if i == j else 0.0) for i in range(4) for j in range(4))


def steps(matrix):
    """List of steps; empty where there is nothing to do."""
    return [] if is_identity(matrix) else [matrix_step(matrix)]
