"""Values as fields of the scene file."""

import numpy as np

from .values import NotShown


def color(value, context, owner, most=1.0):
    """A colour or a texture; above `most` it is cut off, which is said. None for no limit."""
    if value.is_constant:
        numbers = value.color()
        limited = [max(number if most is None else min(number, most), 0.0) for number in numbers]
        if limited != numbers:
            context.report.note(f"a colour of {owner} lies below 0 or above {most or 'all bounds'}: cut off there")
        return limited[0] if limited[0] == limited[1] == limited[2] else limited
    return texture(value, context, owner, most)


def number(value, context, owner, low=0.0, high=1.0):
    """A number or a texture of one channel."""
    if value.is_constant:
        return min(max(value.number(), low), high)
    return number_texture(value, context, owner, high)


def number_texture(value, context, owner, most=1.0):
    """A texture where one number is wanted: of colours their luminance."""
    table = texture(value, context, owner, most)
    if table.get("channel") == "luminance":
        del table["channel"]
    return table


def texture(value, context, owner, most=1.0):
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
        # Only a PNG keeps its opacity on the way.
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
