"""Evaluated meshes as binary PLY files."""

import hashlib
import tempfile
from dataclasses import dataclass

import numpy as np


class MeshArrays:
    """A mesh's triangles with the data of their corners, by `foreach_get`."""

    def __init__(self, mesh):
        mesh.calc_loop_triangles()
        self.mesh = mesh
        triangles = mesh.loop_triangles
        self.positions = positions_of(mesh)
        self.corners = _read(triangles, "loops", np.int32, 3)
        self.slots = _read(triangles, "material_index", np.int32)
        self.vertex_of = _read(mesh.loops, "vertex_index", np.int32)
        self._normals = None

    def topology(self):
        """The same for meshes that have the same polygons in the same order, and both or neither have normals."""
        digest = hashlib.blake2b(self.vertex_of.tobytes(), digest_size=16)
        digest.update(_read(self.mesh.polygons, "loop_start", np.int32).tobytes())
        return digest.digest(), len(self.positions), self.mesh.normals_domain == "FACE"

    def triangulate_as(self, corners, slots):
        """Adopts the triangles of a mesh with the same topology: how Blender triangulates a polygon depends on its
        shape."""
        self.corners, self.slots = corners, slots

    def normals(self):
        """Shading normals of corners, or None if every face is flat."""
        if self.mesh.normals_domain == "FACE":
            return None
        if self._normals is None:
            self._normals = _read(self.mesh.corner_normals, "vector", np.float32, 3)
        return self._normals

    def uv(self, name):
        """UV of corners by the map `name`, by default the one active for renders; None if there is none, or only one
        without data, as modifiers may leave it."""
        layers = self.mesh.uv_layers
        layer = layers.get(name) if name else next((layer for layer in layers if layer.active_render), None)
        if layer is None or len(layer.uv) != len(self.vertex_of):
            return None
        return _read(layer.uv, "vector", np.float32, 2)

    def colors(self, name, loops, triangles):
        """The attribute `name` as linear colours of `loops`, three for each of `triangles`; black without such an
        attribute, as in Cycles. "" is the colour attribute for renders."""
        black = np.zeros((len(loops), 3), dtype=np.float32)
        if not isinstance(name, str):
            # UV of a bake.
            black[:, :2] = name.values[loops, :2]
            return black
        if not name:
            known = self.mesh.color_attributes
            at = known.render_color_index
            if not 0 <= at < len(known):
                return black
            name = known[at].name
        found = self.mesh.attributes.get(name)
        if found is None or found.data_type not in NUMBERS or found.domain not in DOMAINS:
            return black
        field, kind, width = NUMBERS[found.data_type]
        values = _read(found.data, field, kind, width).reshape(-1, width).astype(np.float32)
        if found.domain == "FACE":
            values = np.repeat(values[_read(self.mesh.loop_triangles, "polygon_index", np.int32)[triangles]], 3, axis=0)
        else:
            values = values[loops if found.domain == "CORNER" else self.vertex_of[loops]]
        if width == 1:
            return np.repeat(values, 3, axis=1)
        black[:, : min(width, 3)] = values[:, :3]
        return black


def positions_of(mesh):
    """Positions of its vertices."""
    return _read(mesh.vertices, "co", np.float32, 3)


# Field of an attribute's data, its type and its number of components.
NUMBERS = {
    "FLOAT_COLOR": ("color", np.float32, 4),
    "BYTE_COLOR": ("color", np.float32, 4),
    "FLOAT_VECTOR": ("vector", np.float32, 3),
    "FLOAT2": ("vector", np.float32, 2),
    "FLOAT": ("value", np.float32, 1),
    "INT": ("value", np.int32, 1),
    "BOOLEAN": ("value", bool, 1),
}
DOMAINS = {"POINT", "CORNER", "FACE"}


def _read(collection, name, kind, width=1):
    values = np.empty(len(collection) * width, dtype=kind)
    collection.foreach_get(name, values)
    return values if width == 1 else values.reshape(-1, width)


def ply(arrays, slot, uv_name=None, attribute=None):
    """Bytes of the PLY file of a slot's triangles (of all for None), or None if it has none.

    Vertices are split where corners differ. `attribute`: what becomes vertex colours, None for no colours.
    """
    corners = corners_of(arrays, slot, uv_name, attribute)
    return None if corners is None else ply_of(corners)


@dataclass
class Corners:
    """The data of triangles' corners."""

    columns: list
    """Names of the components."""
    records: np.ndarray
    """One row for each corner, three for each triangle."""
    vertex_of: np.ndarray
    """The mesh vertex of each."""

    def put_aside(self):
        """Moves the records into a file that lives as long as they do."""
        with tempfile.TemporaryFile() as file:
            self.records.tofile(file)
            file.flush()
            self.records = np.memmap(file, dtype="<f4", mode="r", shape=self.records.shape)


def corners_of(arrays, slot, uv_name=None, attribute=None):
    """`Corners` of a slot's triangles (of all for None), or None if it has none."""
    chosen = np.arange(len(arrays.corners)) if slot is None else np.flatnonzero(arrays.slots == slot)
    corners = arrays.corners[chosen]
    if len(corners) == 0:
        return None
    loops = corners.ravel()
    columns = [("x", "y", "z")]
    values = [arrays.positions[arrays.vertex_of[loops]]]
    normals = arrays.normals()
    if normals is not None:
        columns.append(("nx", "ny", "nz"))
        values.append(normals[loops])
    uv = arrays.uv(uv_name)
    if uv is not None:
        columns.append(("u", "v"))
        values.append(uv[loops])
    if attribute is not None:
        columns.append(("red", "green", "blue"))
        values.append(arrays.colors(attribute, loops, chosen))
    records = np.ascontiguousarray(np.concatenate(values, axis=1), dtype="<f4")
    return Corners([name for group in columns for name in group], records, arrays.vertex_of[loops])


def ply_of(corners):
    """Bytes of a PLY file of `Corners`."""
    rows, indices = _weld(corners.records, corners.vertex_of)
    return _encode(corners.columns, corners.records[rows], indices.reshape(-1, 3))


def plys(series):
    """Bytes of PLY files of one mesh at several times, one after the other, with the same vertices.

    `series`: `Corners` of the same triangles. Corners that are equal at all times become one vertex.
    """
    rows, indices = None, series[0].vertex_of
    for k, corners in enumerate(series):
        rows, indices = _weld(np.asarray(corners.records), indices, are_apart=k > 0)
    for corners in series:
        yield _encode(corners.columns, np.ascontiguousarray(corners.records[rows]), indices.reshape(-1, 3))


def _weld(records, vertex_of, are_apart=False):
    """Indices of the distinct rows of `records`, and for each row which of these it equals.

    `vertex_of`: the mesh vertex of each row.

    Most corners of a vertex are equal: only those that differ from its first corner are sorted. `are_apart`: two
    vertices at one place stay two.
    """
    count = len(records)
    first = np.full(int(vertex_of.max()) + 1, -1, dtype=np.int64)
    first[vertex_of[::-1]] = np.arange(count - 1, -1, -1)
    bits = records.view(np.uint32)
    unlike = np.flatnonzero((bits != bits[first[vertex_of]]).any(axis=1))
    used = np.flatnonzero(first >= 0)
    rank = np.empty(len(first), dtype=np.int64)
    rank[used] = np.arange(len(used))
    indices = rank[vertex_of]
    rows = first[used]
    if len(unlike):
        words = bits[unlike]
        if are_apart:
            words = np.concatenate([words, vertex_of[unlike, None].astype(np.uint32)], axis=1)
        kept, which = _different(words)
        indices[unlike] = len(used) + which
        rows = np.concatenate([rows, unlike[kept]])
    return rows, indices.astype("<i4")


def _different(bits):
    """(one row of each kind, the kind of each row) for an array of 32-bit words."""
    mixed = np.zeros(len(bits), dtype=np.uint64)
    for column in range(bits.shape[1]):
        mixed = (mixed ^ bits[:, column]) * np.uint64(0x9E3779B97F4A7C15)
        mixed ^= mixed >> np.uint64(29)
    _, kept, which = np.unique(mixed, return_index=True, return_inverse=True)
    if np.array_equal(bits[kept][which], bits):
        return kept, which
    # Two different rows with one hash, almost impossible: then each stays separate.
    return np.arange(len(bits)), np.arange(len(bits))


def _encode(names, vertices, triangles):
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property float {name}" for name in names]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header", ""]
    faces = np.empty(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"] = 3
    faces["corners"] = triangles
    return "\n".join(header).encode("ascii") + vertices.tobytes() + faces.tobytes()
