"""Geometry of objects, written once and kept until it changes."""

from .deforming import Deforming
from .heights import growth
from .meshes import MeshArrays, ply
from .names import file_name
from .topology import is_closed, open_slots


class Geometry:
    """Files of one evaluated mesh, by slot and by whatever else goes into them."""

    def __init__(self, name):
        self.name = name
        self.mesh = None
        """The evaluated mesh, while the export holds it."""
        self._arrays = None
        self._files = {}
        self._slots = None
        self._closed = None
        self._open_slots = None
        self._growths = {}
        self._points = None
        self._triangles = None
        self.box = None
        """Blender's texture space: its lowest and highest coordinates."""
        self.deforming = None
        """`Deforming`, once the mesh is watched for motion."""

    def hold(self, mesh):
        self.mesh = mesh
        self._arrays = None
        middle, half = mesh.texspace_location, mesh.texspace_size
        self.box = [[float(a - b) for a, b in zip(middle, half)], [float(a + b) for a, b in zip(middle, half)]]

    def release(self):
        self.mesh = self._arrays = None

    def _read(self):
        if self._arrays is None:
            self._arrays = MeshArrays(self.mesh)
        return self._arrays

    def slots(self):
        """Indices of the material slots that have triangles."""
        if self._slots is None:
            import numpy as np

            arrays = self._read()
            # A mesh without area, for example of edges that were extruded but not moved, counts as none.
            corners = arrays.positions[arrays.vertex_of[arrays.corners]]
            cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            self._slots = [int(slot) for slot in np.unique(arrays.slots[np.any(cross != 0.0, axis=1)])]
        return self._slots

    def is_closed(self):
        if self._closed is None:
            self._closed = is_closed(self._read())
        return self._closed

    def is_open(self, slot):
        """Whether the parts with triangles of this slot have a boundary edge."""
        if self._open_slots is None:
            self._open_slots = open_slots(self._read())
        return slot in self._open_slots

    def growth(self, slot, placed, is_first):
        """The factor by which heights above this slot's triangles grow at a place; at other times as at the first."""
        if is_first or slot not in self._growths:
            self._growths[slot] = growth(self._read(), slot, placed.matrix)
        return self._growths[slot]

    def triangles(self):
        """(points, triangles' corners), for tests of what lies inside."""
        if self._points is None:
            arrays = self._read()
            self._points = arrays.positions
            self._triangles = arrays.vertex_of[arrays.corners]
        return self._points, self._triangles

    def file(self, files, slot, uv_map, attribute):
        """Path of the PLY of a slot's triangles, or of all for None."""
        key = slot, uv_map, attribute
        if key not in self._files:
            content = ply(self._read(), slot, uv_map, attribute)
            self._files[key] = files.put("meshes", file_name(self.name), ".ply", content)
        files.use(self._files[key])
        return self._files[key]

    def vertex_of(self):
        """The vertex of each of its corners, while its mesh is available."""
        return self._read().vertex_of

    def variants(self):
        """What goes into each of its files: slot, UV map, attribute."""
        return list(self._files)

    def may_move(self):
        """Keeps the present state of the mesh, to see whether it moves."""
        self.deforming = Deforming(self._read(), self.name)
