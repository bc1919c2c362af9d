"""Values as fields of the scene file."""

import numpy as np

from .values import NotShown


def color(value, context, owner, most=1.0):
    """A colour or a texture; above `most` it is cut off, which is said. None for no limit."""
    if value.is_constant:
        numbers = value.color()
        limited = [min(max(number, 0.0), most if most is not None else number) for number in numbers]
        if limited != numbers:
            context.report.note(f"a colour of {owner} lies outside of 0 to {most or 'infinity'}: cut off there")
        return limited[0] if limited[0] == limited[1] == limited[2] else limited
    return texture(value, context, owner, most)


def number(value, context, owner, low=0.0, high=1.0):
    """A number or a texture of one channel."""
    if value.is_constant:
        return min(max(value.number(), low), high)
    return texture(value, context, owner, high)


def texture(value, context, owner, most=1.0):
    if value.special is not None:
        table = dict(value.special)
        if "checkerboard" in table:
            table["checkerboard"] = [list(entry) for entry in table["checkerboard"]]
        return table | (value.lookup.record() if value.lookup else {})
    source = value.source
    if source is not None and source.channel is None and not source.image.is_float:
        written = context.pictures.file(source.image, source.path, context.report)
        if written is None:
            raise NotShown(f"image '{source.image.name}' has no pixels")
        path, raw = written
        return {"image": path} | ({"raw": True} if raw else {}) | value.lookup.record()
    data = value.data
    if most is not None and float(data.max()) > most:
        context.report.note(f"texture '{value.name}' of {owner} has numbers above {most}: cut off there")
        data = np.minimum(data, most)
    if data.shape[-1] == 1:
        data = data[..., 0]
    return {"image": context.pictures.baked(value.name, data)} | value.lookup.record()
