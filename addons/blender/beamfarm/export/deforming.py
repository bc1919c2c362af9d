"""Meshes whose vertices move while the shutter is open."""

import numpy as np

from .meshes import MeshArrays, corners_of, ply_of, plys, positions_of
from .names import file_name


class Deforming:
    """A mesh's vertex positions at the frame's own time, and at the other times at which they differ."""

    def __init__(self, arrays, name):
        self.name = name
        self.moves = {}
        """By time, `meshes.Corners` by what goes into a file: slot, UV map, attribute."""
        self.has_other_polygons = False
        self._positions = arrays.positions
        self._polygons = len(arrays.mesh.polygons)
        self._triangles = arrays.corners, arrays.slots
        self._topology = arrays.topology()
        self._paths = {}

    def meet(self, mesh, time, variants, is_long):
        """Takes the mesh at another time. `is_long`: there are many times, and any polygons will do."""
        if len(mesh.polygons) == self._polygons and np.array_equal(positions_of(mesh), self._positions):
            return
        arrays = MeshArrays(mesh)
        if arrays.topology() == self._topology:
            self.keep(arrays, time, variants, is_long)
            return
        self.has_other_polygons = True
        if is_long:
            self._keep(arrays, time, variants, is_long)

    def keep(self, arrays, time, variants, is_long):
        """Keeps the mesh at a time at which it has the same polygons."""
        arrays.triangulate_as(*self._triangles)
        self._keep(arrays, time, variants, is_long)

    def _keep(self, arrays, time, variants, is_long):
        kept = {variant: corners_of(arrays, *variant) for variant in variants}
        if is_long:
            for corners in kept.values():
                if corners is not None:
                    corners.put_aside()
        self.moves[time] = kept

    def paths(self, files, variant, times, own):
        """Files of the mesh at these times; `own` is the span's own time, for which it is kept as well."""
        if variant not in self._paths:
            kept = {time: self.moves[time][variant] for time in sorted(self.moves)}
            there = {time: corners for time, corners in kept.items() if corners is not None}
            if self.has_other_polygons:
                contents = (ply_of(corners) for corners in there.values())
            else:
                contents = plys(list(there.values()))
            stem = file_name(self.name)
            self._paths[variant] = {
                time: files.put("meshes", stem, ".ply", content) for time, content in zip(there, contents)
            }
        of_time = self._paths[variant]
        return [of_time.get(time, of_time[own]) for time in times]

    def sequence(self, files, variant, times, own):
        """The name shared by the files of all these frames, with #### for the number."""
        if variant not in self._paths:
            kept = sorted(self.moves)
            contents = zip(kept, plys([self.moves[time][variant] for time in kept]))
            self._paths[variant] = files.put_frames("meshes", file_name(self.name), ".ply", contents, times, own)
        return self._paths[variant]
