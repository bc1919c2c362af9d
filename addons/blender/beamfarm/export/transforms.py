"""Matrices as steps of the scene file."""

import numpy as np
from mathutils import Matrix

# A scale of 0 becomes this fraction of the largest one: the scene file's transforms must be invertible.
THIN = 1e-4


def solid(matrix):
    """`matrix`, with a little thickness if it is flat; None if it maps everything to a line or a point."""
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
    """`{ matrix = ... }` for a 4 x 4 matrix; its last row is exact, without rounding."""
    rows = [[float(number) for number in row] for row in matrix]
    rows[3] = [0.0, 0.0, 0.0, 1.0]
    return {"matrix": rows}


def is_identity(matrix):
    return all(matrix[i][j] == (1.0 if i == j else 0.0) for i in range(4) for j in range(4))


def steps(matrix):
    """List of steps; empty for the identity."""
    return [] if is_identity(matrix) else [matrix_step(matrix)]
