"""Sums, products and other functions of values: per pixel for images, otherwise as nodes of texture graphs."""

from dataclasses import dataclass, field, replace

import numpy as np

from .values import NotShown, Value, combine, is_black, is_white


@dataclass(eq=False)
class Node:
    """A node of a texture graph of the scene file."""

    kind: str
    fields: dict
    """Inputs, which may be `Value`, and options."""
    parts: tuple = ()
    """Owner, groups and node in Blender, for a named texture; empty for a node written where it is used."""
    key: tuple = ()
    """What the name is for; unique to this node."""
    uv_map: str | None = field(default=None)
    """The attribute that it reads, if any."""

    def output(self, name=None, width=1, is_vector=False):
        """One of its outputs as a `Value`; None for the first."""
        special = {"texture": self, "output": name, "width": width}
        return Value(None, width, special=special, name="/".join(self.parts) or self.kind, is_vector=is_vector)


def is_graph(value):
    return value.special is not None and "texture" in value.special


def calculate(function, *values):
    """`combine`, or, unless the values are pixels of one image, a graph of what `function` does to its arguments."""
    try:
        return combine(function, *values)
    except NotShown as problem:
        try:
            traced = function(*(Traced(value) for value in values))
        except TypeError:
            raise problem from None
        return traced.value


class Traced:
    """Stands for a value while an array function runs, and records the operations on it."""

    def __init__(self, value):
        self.value = value

    def __array_ufunc__(self, function, method, *inputs, **options):
        operation = OPERATIONS.get(function)
        if method != "__call__" or options or operation is None:
            return NotImplemented
        return _operated(operation, *inputs)

    def __add__(self, other):
        return _operated("add", self, other)

    def __radd__(self, other):
        return _operated("add", other, self)

    def __sub__(self, other):
        return _operated("subtract", self, other)

    def __rsub__(self, other):
        return _operated("subtract", other, self)

    def __mul__(self, other):
        return _operated("multiply", self, other)

    def __rmul__(self, other):
        return _operated("multiply", other, self)

    def __truediv__(self, other):
        return _operated("divide", self, other)

    def __rtruediv__(self, other):
        return _operated("divide", other, self)

    def clip(self, low, high, out=None):
        return _operated("minimum", _operated("maximum", self, low), high)


OPERATIONS = {np.add: "add", np.subtract: "subtract", np.multiply: "multiply", np.divide: "divide",
              np.maximum: "maximum", np.minimum: "minimum", np.sqrt: "sqrt"}


def _operated(operation, *inputs):
    inputs = [entry.value if isinstance(entry, Traced) else entry for entry in inputs]
    if operation == "sqrt":
        operation, inputs = "power", [*inputs, 0.5]
    width = max((entry.width for entry in inputs if isinstance(entry, Value)), default=1)
    if width == 3:
        inputs = [_as_number(entry) for entry in inputs]
    fields = {"operation": operation} | dict(zip("abc", inputs))
    node = Node("vector_math" if width == 3 else "math", fields)
    return Traced(node.output(width=width))


def _as_number(entry):
    """A number stays a number among vectors, although graphs turn it into a colour."""
    if isinstance(entry, Value) and entry.width == 1 and is_graph(entry) and entry.special["width"] == 3:
        return Node("math", {"operation": "add", "a": entry, "b": 0.0}).output()
    return entry


def scaled(value, factor):
    """Radiance times a number; None for zero. Images stay files if the number is a constant."""
    if value is None or is_black(value) or is_black(factor):
        return None
    if factor.is_constant and factor.number() == 1.0:
        return value
    if factor.is_constant and factor.number() > 0.0 and value.special is not None:
        return replace(value, special=value.special | {"scale": factor.number() * value.special.get("scale", 1.0)})
    if factor.is_constant and factor.number() > 0.0 and value.source is not None and value.source.channel is None:
        by = factor.number()
        return replace(value, load=lambda: value.data * by, source=replace(value.source, gain=value.source.gain * by))
    if is_graph(factor) and is_white(value):
        return factor.as_color()
    return calculate(lambda value, factor: value * factor, value.as_color(), factor)
