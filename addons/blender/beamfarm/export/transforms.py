"""Matrices as steps of the scene file."""


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
