"""Meshes, grids and images from numpy arrays instead of files."""

from __future__ import annotations

import hashlib
import struct
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from . import _native
from .errors import ArgumentError

__all__ = ["Grid", "Mesh", "Texture"]


def _described(array: npt.NDArray[Any]) -> str:
    return f"found {array.shape} of {array.dtype}"


def _numbers(name: str, value: npt.ArrayLike, columns: int | None) -> npt.NDArray[np.floating[Any]]:
    """Rows of finite real numbers; float32 and float64 stay as they are."""
    array = np.asarray(value)
    rows = "(N,)" if columns is None else f"(N, {columns})"
    has_shape = columns is None or (array.ndim == 2 and array.shape[1] == columns)
    if array.dtype.kind not in "fiu" or not has_shape:
        raise ArgumentError(f"{name}: expected an array of shape {rows} of real numbers, {_described(array)}")
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        array = array.astype(np.float64 if array.dtype.itemsize > 4 else np.float32)
    if not np.isfinite(array).all():
        raise ArgumentError(f"{name}: expected finite numbers, found NaN or infinity")
    return array


class _Made(Protocol):
    """A file that exists only in memory."""

    def encoded(self) -> tuple[str, bytes]:
        """Its name in a scene, which depends only on its contents, and its bytes."""
        ...


def _named(ending: str, content: bytes) -> tuple[str, bytes]:
    return f"arrays/{hashlib.blake2b(content, digest_size=10).hexdigest()}.{ending}", content


class Mesh:
    """A mesh in place of a file in a scene: ``{"type": "mesh", "file": Mesh(vertices, faces), ...}``.

    Parameters
    ----------
    vertices : (N, 3) real
        Positions, scene units.
    faces : (M, 3) or (M, 4) integer
        Vertices of each triangle or quadrilateral, from 0, counter-clockwise as seen from outside.
    normals : (N, 3) real, optional
        Shading normals of vertices.
    uvs : (N, 2) real, optional
        Texture coordinates of vertices.
    colors : (N, 3) real, optional
        Linear colours of vertices, for materials with ``{attribute = "color"}``.

    Raises
    ------
    ArgumentError
        An array has the wrong shape or type, a number is not finite, or a face has a vertex that does not exist.

    The arrays are copied: later changes to them do not change the mesh.
    """

    def __init__(
        self,
        vertices: npt.ArrayLike,
        faces: npt.ArrayLike,
        *,
        normals: npt.ArrayLike | None = None,
        uvs: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
    ) -> None:
        places = _numbers("vertices", vertices, 3)
        corners = np.asarray(faces)
        if corners.dtype.kind not in "iu" or corners.ndim != 2 or corners.shape[1] not in (3, 4):
            raise ArgumentError(f"faces: expected an array of shape (M, 3) or (M, 4) of integers, {_described(corners)}")
        if corners.size and (corners.min() < 0 or corners.max() >= len(places)):
            lowest, highest = corners.min(), corners.max()
            raise ArgumentError(f"faces: expected vertices 0 to {len(places) - 1}, found {lowest} to {highest}")
        real = "<f8" if places.dtype.itemsize == 8 else "<f4"
        kind = "double" if places.dtype.itemsize == 8 else "float"
        parts: list[tuple[str, tuple[str, ...], npt.NDArray[Any]]] = [("vertices", ("x", "y", "z"), places)]
        for name, properties, value in (
            ("normals", ("nx", "ny", "nz"), normals),
            ("uvs", ("u", "v"), uvs),
            ("colors", ("r", "g", "b"), colors),
        ):
            if value is None:
                continue
            array = _numbers(name, value, len(properties))
            if len(array) != len(places):
                raise ArgumentError(f"{name}: expected a row for each of {len(places)} vertices, found {len(array)}")
            parts.append((name, properties, array))
        lines = ["ply", "format binary_little_endian 1.0", f"element vertex {len(places)}"]
        lines += [f"property {kind} {name}" for _, properties, _ in parts for name in properties]
        lines += [f"element face {len(corners)}", "property list uchar uint vertex_indices", "end_header", ""]
        rows = np.concatenate([array.astype(real, copy=False) for _, _, array in parts], axis=1)
        listed = np.empty(len(corners), dtype=[("count", "u1"), ("corners", "<u4", corners.shape[1])])
        listed["count"] = corners.shape[1]
        listed["corners"] = corners
        content = b"".join(["\n".join(lines).encode(), rows.tobytes(), listed.tobytes()])
        self._named = _named("ply", content)
        self._counts = len(places), len(corners)

    def encoded(self) -> tuple[str, bytes]:
        """The mesh's name in a scene, and a PLY file of it."""
        return self._named

    def __repr__(self) -> str:
        vertices, faces = self._counts
        return f"<Mesh of {vertices} vertices, {faces} faces>"


class Grid:
    """A grid of densities in place of a file in a scene: ``density = {"file": Grid(array)}``.

    Parameters
    ----------
    values : (depth, height, width) or (depth, height, width, 3) real
        Samples, ``values[z, y, x]``, which fill the unit cube from (0, 0, 0) to (1, 1, 1); the medium's ``transform``
        places it in the world. Negative values count as 0. Three channels are for ``sigma_t`` and ``albedo``.

    Raises
    ------
    ArgumentError
        An array has the wrong shape or type, or a number is not finite.
    """

    def __init__(self, values: npt.ArrayLike) -> None:
        array = np.asarray(values)
        has_shape = array.ndim == 3 or (array.ndim == 4 and array.shape[3] == 3)
        if not has_shape or array.dtype.kind not in "fiu" or not array.size:
            expected = "(depth, height, width) or (depth, height, width, 3)"
            raise ArgumentError(f"values: expected an array of shape {expected} of real numbers, {_described(array)}")
        array = _numbers("values", array, None)
        depth, height, width = array.shape[:3]
        channels = 1 if array.ndim == 3 else 3
        header = b"VOL\x03" + struct.pack("<5i6f", 1, width, height, depth, channels, 0, 0, 0, 1, 1, 1)
        self._named = _named("vol", header + array.astype("<f4", copy=False).tobytes())
        self._shape = array.shape

    def encoded(self) -> tuple[str, bytes]:
        """The grid's name in a scene, and a .vol file of it."""
        return self._named

    def __repr__(self) -> str:
        return f"<Grid of {' x '.join(map(str, self._shape))}>"


class Texture:
    """An image in place of a file in a scene: ``reflectance = {"image": Texture(array)}``.

    Parameters
    ----------
    pixels : (height, width, 3) or (height, width) real
        Linear values, the first row on top.

    Raises
    ------
    ArgumentError
        An array has the wrong shape or type, or a number is not finite.
    """

    def __init__(self, pixels: npt.ArrayLike) -> None:
        array = np.asarray(pixels)
        if array.ndim == 2:
            array = np.repeat(array[:, :, None], 3, axis=2)
        if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu" or not array.size:
            expected = "(height, width, 3) or (height, width)"
            raise ArgumentError(f"pixels: expected an array of shape {expected} of real numbers, {_described(array)}")
        array = _numbers("pixels", array, None)
        self._named = _named("exr", _native.encode_exr(np.ascontiguousarray(array, dtype=np.float32)))
        self._shape = array.shape

    def encoded(self) -> tuple[str, bytes]:
        """The image's name in a scene, and an OpenEXR file of it."""
        return self._named

    def __repr__(self) -> str:
        return f"<Texture of {self._shape[1]} x {self._shape[0]} pixels>"
