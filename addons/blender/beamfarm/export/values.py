"""Values of a node tree's sockets: numbers and colours, constant or from the pixels of one image."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

# Rec. 709, as in Blender's conversion from colours to numbers.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)


class NotShown(Exception):
    """A value that the scene file cannot express; the message says what is in the way."""


@dataclass(frozen=True)
class Lookup:
    """How an image is looked up."""

    uv: tuple = ()
    """2 x 3 numbers that transform (u, v, 1), or None."""
    uv_map: str = ""
    filter: str = "bilinear"
    wrap: str = "repeat"

    def record(self):
        table = {}
        if self.uv:
            table["uv"] = [{"matrix": [list(self.uv[0]), list(self.uv[1]), [0.0, 0.0, 1.0]]}]
        if self.filter != "bilinear":
            table["filter"] = self.filter
        if self.wrap != "repeat":
            table["wrap"] = self.wrap
        return table


@dataclass(frozen=True)
class Source:
    """An image of Blender, or one channel of it: "r", "g", "b", "a", or "luminance"."""

    image: object
    path: str
    channel: str | None = None
    gain: float = 1.0
    """The factor on the image's colours."""


@dataclass
class Value:
    """A constant, the pixels of an image, or another texture that the scene file has."""

    load: object
    """Function that gives the array: one number or three along its last axis, preceded by an image's height and
    width."""
    width: int
    """1 or 3."""
    lookup: Lookup | None = None
    source: Source | None = None
    special: dict | None = None
    """A texture of the scene file that is no image: checkers, vertex colours from the attribute `name`, or an output of
    an `arithmetic.Node`."""
    name: str = "baked"
    is_vector: bool = False
    """Converted to a number by its mean, not its luminance."""

    @cached_property
    def data(self):
        return self.load()

    @property
    def is_constant(self):
        return self.special is None and self.lookup is None

    def number(self):
        """The single number of a constant."""
        return float(self.as_float().data[0])

    def color(self):
        """The three numbers of a constant."""
        return [float(number) for number in self.as_color().data]

    def as_color(self):
        if self.width == 3:
            return self
        if self.special is not None:
            return replace(self, width=3)
        return replace(self, load=lambda: np.repeat(self.data, 3, axis=-1), width=3)

    def as_float(self):
        if self.width == 1:
            return self
        if self.special is not None:
            return replace(self, width=1)
        if self.is_vector:
            return replace(self, load=lambda: self.data.mean(axis=-1, keepdims=True), width=1, source=None)
        source = None if self.source is None else replace(self.source, channel="luminance")
        return replace(self, load=lambda: (self.data @ LUMINANCE)[..., None], width=1, source=source)


def constant(*numbers, is_vector=False):
    data = np.array(numbers, dtype=np.float32)
    return Value(lambda: data, len(numbers), is_vector=is_vector)


def combine(function, *values):
    """`function` of the values' arrays, pixel by pixel; values from images must have the same lookup."""
    lookups = []
    for value in values:
        if value.special is not None:
            raise NotShown("a formula of checkers or attributes")
        if value.lookup is not None and value.lookup not in lookups:
            lookups.append(value.lookup)
    if len(lookups) > 1:
        raise NotShown("a formula of textures with different mappings")
    arrays = [value.data for value in values]
    if lookups:
        sizes = {array.shape[:2] for array in arrays if array.ndim == 3}
        size = max(sizes, key=lambda size: size[0] * size[1])
        arrays = [_resized(array, size) if array.ndim == 3 else array.reshape(1, 1, -1) for array in arrays]
    with np.errstate(all="ignore"):
        data = np.asarray(function(*arrays), dtype=np.float32)
    if lookups:
        data = np.broadcast_to(data, (*size, data.shape[-1]))
    data = np.nan_to_num(data)
    name = next((value.name for value in values if value.lookup is not None), "baked")
    return Value(lambda: data, data.shape[-1], lookups[0] if lookups else None, name=name)


def _resized(array, size):
    """The pixels at another size, by nearest neighbour."""
    rows = (np.arange(size[0]) * array.shape[0]) // size[0]
    columns = (np.arange(size[1]) * array.shape[1]) // size[1]
    return array if array.shape[:2] == size else array[rows][:, columns]


def is_white(value):
    return value.is_constant and value.color() == [1.0, 1.0, 1.0]


def is_black(value):
    return value.is_constant and value.color() == [0.0, 0.0, 0.0]
