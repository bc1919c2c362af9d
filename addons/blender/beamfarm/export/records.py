"""Values as fields of the scene file."""

import math
from dataclasses import replace

import numpy as np

from .arithmetic import is_graph
from .values import NotShown, Value


def color(value, context, owner, most=1.0):
    """A colour or a texture, cut off above `most`, which is reported. None for no limit."""
    if value.is_constant:
        numbers = value.color()
        limited = [max(number if most is None else min(number, most), 0.0) for number in numbers]
        if limited != numbers:
            context.report.note(f"a colour of {owner} is below 0 or above {most or 'all bounds'}: cut off there")
        return limited[0] if limited[0] == limited[1] == limited[2] else limited
    return texture(value, context, owner, most)


def number(value, context, owner, low=0.0, high=1.0):
    """A number or a texture of one channel."""
    if value.is_constant:
        return min(max(value.number(), low), high)
    return number_texture(value, context, owner, high)


def number_texture(value, context, owner, most=1.0):
    """A texture where one number is wanted: colours are reduced to their luminance."""
    table = texture(value, context, owner, most)
    if table.get("channel") == "luminance":
        del table["channel"]
    return table


def texture(value, context, owner, most=1.0):
    if is_graph(value):
        return Graphs(context, owner).of_value(value)
    if value.special is not None:
        table = dict(value.special)
        if "checkerboard" in table:
            table["checkerboard"] = [list(entry) for entry in table["checkerboard"]]
        return table | (value.lookup.record() if value.lookup else {})
    source = value.source
    if source is not None and not source.image.is_float:
        written = context.pictures.file(source.image, source.path, context.report)
        if written is None:
            raise NotShown(f"image '{source.image.name}' has no pixels")
        path, raw = written
        # Only PNG files keep their opacity when copied.
        if source.channel != "a" or path.endswith(".png"):
            table = {"image": path} | ({"raw": True} if raw else {})
            return table | ({"channel": source.channel} if source.channel else {}) | value.lookup.record()
    data = value.data
    if most is not None and float(data.max()) > most:
        context.report.note(f"texture '{value.name}' of {owner} has numbers above {most}: cut off there")
        data = np.minimum(data, most)
    if data.shape[-1] == 1:
        data = data[..., 0]
    return {"image": context.pictures.baked(value.name, data)} | value.lookup.record()


class Graphs:
    """Writes texture graphs: Blender's nodes as named textures, the rest where it is used."""

    def __init__(self, context, owner, volume=None):
        """`volume`: the `spaces.Volume` that they are for, None for surfaces."""
        self.context = context
        self.owner = owner
        self.volume = volume

    def named(self, value, *parts):
        """A graph as `{ texture = NAME }`; `parts`: its name, if it is not one of Blender's nodes."""
        table = self.of_value(value)
        if "node" not in table:
            return table
        return {"texture": self._put((self.owner, "named", self.volume and self.volume.key, parts), parts, table)}

    def of_value(self, value):
        """A value as an input of a node."""
        if value.is_constant:
            numbers = [float(number) for number in np.nan_to_num(value.data)]
            return numbers[0] if len(set(numbers)) == 1 else numbers
        if not is_graph(value):
            return self._picture(value)
        node, output = value.special["texture"], value.special["output"]
        table = self._of_node(node) | ({} if output is None else {"output": output})
        return _times(table, value.special.get("scale", 1.0))

    def _picture(self, value, vector=None):
        """An image, checkers or vertex colours. `vector`: where an image is looked up, in place of UV."""
        write = number_texture if value.width == 1 else texture
        if value.lookup is not None and len(value.lookup.uv) == 3:
            vector = _around(value.lookup.uv)
            value = replace(value, lookup=replace(value.lookup, uv=()))
        where = {} if vector is None else {"vector": vector}
        low = self._lowest(value)
        if low < 0.0:
            # Image files have no numbers below 0.
            raised = replace(value, load=lambda: value.data - low, source=None)
            kind = "math" if value.width == 1 else "vector_math"
            table = write(raised, self.context, self.owner, None) | where
            return {"node": kind, "operation": "add", "a": table, "b": low}
        table = write(value, self.context, self.owner, None)
        is_file = value.source is not None and not value.source.image.is_float
        gain = value.source.gain if is_file else table.pop("scale", 1.0)
        return _times(table | where, gain)

    def _lowest(self, value):
        """The minimum of baked values."""
        is_file = value.source is not None and not value.source.image.is_float
        return 0.0 if value.special is not None or is_file else float(np.nan_to_num(value.data).min())

    def _of_node(self, node):
        if node.kind == "coordinates" and self.volume is not None:
            return self.volume.coordinates(node.fields["of"])
        key, parts = node.key, node.parts
        if parts and self.volume is not None:
            key, parts = (key, "volume", self.volume.key), (parts[0], self.volume.name, *parts[1:])
        if parts:
            name = self.context.written.get((node, key))
            if name in self.context.textures:
                return {"texture": name}
        if node.kind == "image":
            table = self._picture(node.fields["image"], self._field(node.fields["vector"]))
        else:
            table = {"node": node.kind} | {name: self._field(value) for name, value in node.fields.items()}
        if not parts:
            return table
        name = self.context.written[node, key] = self._put(key, parts, table)
        return {"texture": name}

    def _field(self, value):
        if isinstance(value, dict):
            return {name: self._field(entry) for name, entry in value.items()}
        return self.of_value(value) if isinstance(value, Value) else value

    def _put(self, key, parts, table):
        name = self.context.texture_names.get(key, *parts)
        self.context.textures[name] = table
        return name


def _times(table, factor):
    if factor == 1.0:
        return table
    return {"node": "vector_math", "operation": "scale", "a": table, "scale": float(factor)}


def _around(turn):
    """The lookup of an image that surrounds the world, with its directions rotated."""
    direction = {"node": "coordinates", "of": "generated"}
    matrix = [[*row, 0.0] for row in turn]
    if matrix != np.eye(3, 4).tolist():
        direction = {"node": "transform", "vector": direction, "matrix": matrix}
    return equirectangular(direction)


def equirectangular(direction):
    """Image coordinates in a panorama for a unit direction, as in Cycles: +x in the middle."""
    def number(axis):
        return {"node": "separate", "mode": "xyz", "value": direction, "output": axis}

    turn = {"node": "math", "operation": "arctan2", "a": number("y"), "b": number("x")}
    height = {"node": "math", "operation": "arcsine", "a": number("z")}
    x = {"node": "math", "operation": "multiply_add", "a": turn, "b": -0.5 / math.pi, "c": 0.5}
    y = {"node": "math", "operation": "multiply_add", "a": height, "b": 1.0 / math.pi, "c": 0.5}
    return {"node": "combine", "mode": "xyz", "x": x, "y": y}


def inputs_of(value):
    """The values that a graph reads, and the nodes, each once."""
    waiting, seen = [value], set()
    while waiting:
        entry = waiting.pop()
        if not is_graph(entry):
            yield None, entry
            continue
        node = entry.special["texture"]
        if node in seen:
            continue
        seen.add(node)
        yield node, None
        has_vector = node.kind == "image"
        waiting.extend(field for name, field in node.fields.items()
                       if isinstance(field, Value) and not (has_vector and name == "image"))
