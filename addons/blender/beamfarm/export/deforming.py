"""Meshes whose vertices move while the shutter is open."""

import numpy as np

from .meshes import MeshArrays, corners_of, plys, positions_of
from .names import file_name


class Deforming:
    """Where the vertices of a mesh are at the frame's own time, and at the other times at which they are elsewhere."""

    def __init__(self, arrays, name):
        self.name = name
        self.moves = {}
        """By time a dict of `meshes.Corners` by what goes into a file: slot, UV map, attribute."""
        self.has_other_polygons = False
        self._positions = arrays.positions
        self._polygons = len(arrays.mesh.polygons)
        self._triangles = arrays.corners, arrays.slots
        self._topology = arrays.topology()
        self._contents = {}

    def meet(self, mesh, time, variants):
        """Looks at the mesh at another time than the frame's own."""
        if len(mesh.polygons) == self._polygons and np.array_equal(positions_of(mesh), self._positions):
            return
        arrays = MeshArrays(mesh)
        if arrays.topology() != self._topology:
            self.has_other_polygons = True
            return
        self.keep(arrays, time, variants)

    @property
    def moves_at_all(self):
        """Whether there is something to be blurred."""
        return bool(self.moves) and not self.has_other_polygons

    def keep(self, arrays, time, variants):
        """Keeps how the mesh is at a time."""
        arrays.triangulate_as(*self._triangles)
        self.moves[time] = {variant: corners_of(arrays, *variant) for variant in variants}

    def paths(self, files, variant, times, own):
        """Files of the mesh at these times; `own` is the frame's, at which it was kept as well."""
        if variant not in self._contents:
            kept = sorted(self.moves)
            contents = plys([self.moves[time][variant] for time in kept])
            self._contents[variant] = dict(zip(kept, contents))
        of_time = self._contents[variant]
        stem = file_name(self.name)
        return [files.put("meshes", stem, ".ply", of_time.get(time, of_time[own])) for time in times]
