"""Images as arrays."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from . import _native
from .errors import ArgumentError

__all__ = ["Bias", "Block", "Comparison", "Image", "Layers", "Pass", "average", "compare", "read"]

Pixels = npt.NDArray[np.float32]


class Layers(Mapping[str, Pixels]):
    """Layers by name: (height, width) float32 for one channel, (height, width, 3) for three. Read-only."""

    def __init__(self, native: _native.Image | _native.Pass) -> None:
        self._native = native

    def __getitem__(self, name: str) -> Pixels:
        return self._native.layer(name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._native.layer_names)

    def __len__(self) -> int:
        return len(self._native.layer_names)

    def __repr__(self) -> str:
        return f"<Layers {', '.join(self)}>"


class Bias(NamedTuple):
    """The estimated relative bias of an image's mean."""

    relative: float
    """(image - truth) / truth, for the mean of all pixels."""
    stderr: float
    """Its standard error."""
    text: str
    """The same in words."""

    def __str__(self) -> str:
        return self.text


class Image:
    """An image of passes, or of samples of the reference.

    Its arrays share the memory of the image and are read-only; ``image.beauty.copy()`` is writable.
    """

    def __init__(self, native: _native.Image, *, notes: list[str], left_out: list[str], interrupted: bool) -> None:
        self._native = native
        self.notes = notes
        """Notes on what in the scene may not be as its author intends, and on what a pilot found."""
        self.left_out = left_out
        """What of a Mitsuba scene is not supported and left out."""
        self.interrupted = interrupted
        """Whether Ctrl-C ended it before its last pass."""

    @property
    def beauty(self) -> Pixels:
        """Mean radiance, W/(m² sr), linear sRGB: (height, width, 3) float32."""
        return self._native.beauty

    @property
    def stderr(self) -> Pixels:
        """Standard error of ``beauty``, of the same shape; infinite after one pass, when it is unknown."""
        return self._native.stderr

    @property
    def layers(self) -> Layers:
        """The requested layers, by name."""
        return Layers(self._native)

    @property
    def passes(self) -> int:
        """The number of averaged passes (0 to ``passes - 1``) or samples."""
        return self._native.passes

    @property
    def seconds(self) -> float:
        """Render time."""
        return self._native.seconds

    @property
    def error(self) -> float:
        """Relative standard error of the picture, as ``--target-error`` means it: 0.01 is 1 %. Infinite after one
        pass."""
        return self._native.error

    @property
    def bias(self) -> Bias | None:
        """Estimated bias of the mean; None where passes are too few or too noisy for an estimate."""
        found = self._native.bias
        return None if found is None else Bias(*found)

    @property
    def width(self) -> int:
        """Pixels per row."""
        return int(self.beauty.shape[1])

    @property
    def height(self) -> int:
        """Number of rows."""
        return int(self.beauty.shape[0])

    @property
    def hash(self) -> str:
        """Hash of the pixels of ``beauty``, as the command ``beamfarm`` prints it."""
        return self._native.pixel_hash

    @property
    def scene_hash(self) -> str:
        """Hash of the scene and the files that it names."""
        return self._native.scene_hash

    def save(
        self, path: str | os.PathLike[str], *, exposure: float | None = None, view: str | None = None
    ) -> Path:
        """Write ``.exr`` (linear float32, with layers) or ``.png`` (in the view that the scene sets).

        Parameters
        ----------
        exposure
            For the PNG, in stops: 1 doubles the brightness.
        view
            For the PNG: ``"standard"``, ``"filmic"`` or ``"agx"``.

        Raises
        ------
        ImageError
            It cannot be written; a file that was there before stays.
        """
        path = Path(path)
        self._native.save(path, exposure, view)
        return path

    def to_png(self, *, exposure: float | None = None, view: str | None = None) -> bytes:
        """The bytes of a PNG; arguments as for :meth:`save`."""
        return self._native.png(exposure, view)

    def _repr_png_(self) -> bytes:
        return self.to_png()

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        if dtype is not None and np.dtype(dtype) != np.float32:
            if copy is False:
                raise ValueError("pixels are float32, and another type takes a copy")
            return self.beauty.astype(dtype)
        return self.beauty.copy() if copy else self.beauty

    def __repr__(self) -> str:
        error = f", error {100 * self.error:.2f} %" if np.isfinite(self.error) else ""
        return f"<Image {self.width} x {self.height}, {self.passes} passes in {self.seconds:.1f} s{error}>"


class Pass:
    """A single pass: an image that is noisy, and blurred by its radii."""

    def __init__(self, native: _native.Pass) -> None:
        self._native = native

    @property
    def index(self) -> int:
        """Its number, from 0."""
        return self._native.index

    @property
    def radius_scale(self) -> float:
        """The pass's radius factor."""
        return self._native.radius_scale

    @property
    def beauty(self) -> Pixels:
        """Radiance, W/(m² sr), linear sRGB: (height, width, 3) float32, read-only."""
        return self._native.beauty

    @property
    def layers(self) -> Layers:
        """The requested layers, by name."""
        return Layers(self._native)

    @property
    def seconds(self) -> float:
        """Render time of the pass."""
        return self._native.seconds

    @property
    def hash(self) -> str:
        """Hash of its pixels, as ``beamfarm replay`` prints it."""
        return self._native.pixel_hash

    def __repr__(self) -> str:
        height, width, _ = self.beauty.shape
        return f"<Pass {self.index}: {width} x {height}, radius scale {self.radius_scale:.4f}>"


def average(passes: Any) -> Image:
    """The image of passes 0 to N - 1, given in any order, each once. Its bits are those of :func:`beamfarm.render`.

    Raises
    ------
    ArgumentError
        A pass is missing, given twice, or from another scene.
    """
    given = list(passes)
    for one in given:
        if not isinstance(one, Pass):
            raise ArgumentError(f"passes: expected what beamfarm.passes gives, found {type(one).__name__}")
    native = _native.average([one._native for one in given])
    return Image(native, notes=[], left_out=[], interrupted=False)


def read(path: str | os.PathLike[str]) -> Pixels:
    """R, G and B of an OpenEXR file: (height, width, 3) float32, linear.

    Raises
    ------
    ImageError
        The file is not an OpenEXR file, or lacks these channels.
    """
    return _native.read_image(Path(path))


class Block(NamedTuple):
    """A block of 8 x 8 pixels whose mean differs."""

    x: int
    """Left column."""
    y: int
    """Top row."""
    absolute: float
    """Mean of the image minus mean of the reference."""
    relative: float
    """That, relative to the reference's mean."""


@dataclass(frozen=True)
class Comparison:
    """How far an image is from a reference, over linear RGB."""

    rmse: float
    """Root of the mean of (x - ref)²."""
    rel_mse: float
    """Mean of (x - ref)² / (ref² + 0.01)."""
    mean_ratio: float
    """Mean of the image over mean of the reference: reveals a missing factor."""
    channel_ratio: tuple[float, float, float]
    """The same for each channel."""
    largest_absolute: Block
    """The block with the largest difference: reveals bias that hides in noise."""
    largest_relative: Block
    """The block with the largest relative difference."""
    identical: bool
    """Whether all bits are the same."""
    text: str
    """The text that ``beamfarm compare`` prints."""

    def __str__(self) -> str:
        return self.text.rstrip("\n")


def _pixels(name: str, image: Any) -> Pixels:
    if isinstance(image, (Image, Pass)):
        return image.beauty
    if isinstance(image, (str, os.PathLike)):
        return read(image)
    array = np.asarray(image)
    if array.ndim != 3 or array.shape[2] != 3 or array.dtype.kind not in "fiu":
        raise ArgumentError(
            f"{name}: expected an Image, the path of an .exr or an array of shape (height, width, 3) of real numbers, "
            f"found {array.shape} of {array.dtype}"
        )
    return np.ascontiguousarray(array, dtype=np.float32)


def compare(image: Any, reference: Any) -> Comparison:
    """How far an image is from a reference: each an Image, the path of an .exr, or an array of (height, width, 3).

    Raises
    ------
    ArgumentError
        They have different sizes, or numbers that are not finite.
    """
    found = _native.compare(_pixels("image", image), _pixels("reference", reference))
    return Comparison(
        rmse=found["rmse"],
        rel_mse=found["rel_mse"],
        mean_ratio=found["mean_ratio"],
        channel_ratio=tuple(found["channel_ratio"]),
        largest_absolute=Block(**found["largest_absolute"]),
        largest_relative=Block(**found["largest_relative"]),
        identical=found["identical"],
        text=found["text"],
    )
