"""Whether meshes are closed. Coincident vertices count as one."""

import numpy as np


def is_closed(arrays):
    """Whether each edge lies between two triangles with the same winding; coincident vertices count as one."""
    if len(arrays.corners) == 0:
        return False
    edges = _edges(_welded(arrays))
    count = len(arrays.positions)
    there = np.sort(edges[:, 0] * count + edges[:, 1])
    back = np.sort(edges[:, 1] * count + edges[:, 0])
    return bool(np.array_equal(there, back) and np.all(there[1:] != there[:-1]))


def open_slots(arrays):
    """The set of slots whose triangles are connected to an edge that only one triangle has."""
    triangles = _welded(arrays)
    # Triangles that are only a line have no side.
    keeps = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    triangles, slots = triangles[keeps], arrays.slots[keeps]
    edges = np.sort(_edges(triangles), axis=1)
    _, which, times = np.unique(edges[:, 0] * len(arrays.positions) + edges[:, 1], return_inverse=True,
                                return_counts=True)
    ends = edges[times[which.ravel()] == 1].ravel()
    if len(ends) == 0:
        return set()
    if slots.min() == slots.max():
        return {int(slots[0])}
    part_of = _parts(edges, len(arrays.positions))
    is_open = np.isin(part_of[triangles[:, 0]], part_of[ends])
    return {int(slot) for slot in np.unique(slots[is_open])}


def _welded(arrays):
    """Triangles' vertices, numbered by position."""
    # Zeros of either sign are the same position.
    places = np.ascontiguousarray(arrays.positions + np.float32(0.0))
    _, welded = np.unique(places.view("V12").ravel(), return_inverse=True)
    return welded.ravel()[arrays.vertex_of[arrays.corners]].astype(np.int64)


def _edges(triangles):
    return np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])


def _parts(edges, count):
    """For each vertex, the lowest number of those that it is connected to."""
    part_of = np.arange(count)
    while True:
        low = part_of[edges].min(axis=1)
        before = part_of.copy()
        np.minimum.at(part_of, part_of[edges[:, 0]], low)
        np.minimum.at(part_of, part_of[edges[:, 1]], low)
        # Follow the whole chain, so that few rounds are enough.
        while not np.array_equal(part_of, part_of[part_of]):
            part_of = part_of[part_of]
        if np.array_equal(part_of, before):
            return part_of
