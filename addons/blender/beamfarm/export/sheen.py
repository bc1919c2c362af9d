"""Sheen BSDF: Ashikhmin's by velvet; microfibers, and what lies below the gloss of another shader, by a diffuse lobe
whose reflectance goes by the angle at which it is seen, as bright as Cycles' in light that is the same from all sides."""

from functools import lru_cache

import numpy as np

from .arithmetic import Node, calculate
from .gloss import constant_of
from .values import constant

STOPS = 17
# Share of even light that Cycles' microfibers send back: rows by the roughness from 0 in steps of 0.2, columns by the
# cosine to who looks at them from 0.1 in steps of 0.1. Polynomials through pixels of a ball in Blender 4.5; the first
# row is taken to be 0.
MICROFIBER = np.array([
    [0.0] * 10,
    [0.338, 0.119, 0.03, 0.004, 0.001, 0.001, 0.001, 0.0, 0.0, 0.0],
    [0.46, 0.347, 0.231, 0.139, 0.077, 0.043, 0.026, 0.015, 0.008, 0.007],
    [0.483, 0.469, 0.395, 0.309, 0.234, 0.177, 0.134, 0.099, 0.07, 0.054],
    [0.515, 0.551, 0.511, 0.445, 0.38, 0.327, 0.283, 0.243, 0.205, 0.179],
    [0.557, 0.619, 0.598, 0.548, 0.498, 0.457, 0.424, 0.394, 0.365, 0.345]])


def sheen(reader, place):
    """Fields of a material."""
    color, rough = reader.get(place, "Color"), reader.get(place, "Roughness")
    if getattr(place.node, "distribution", "ASHIKHMIN") == "ASHIKHMIN":
        return {"type": "velvet", "reflectance": color, "roughness": rough, "two_sided": True}
    return diffuse(reader, place, "MICROFIBER", color, rough)


def diffuse(reader, place, kind, color, rough):
    """Fields of a diffuse material in the place of a sheen of a kind."""
    rough = constant_of(reader, place, rough, "roughness", 0.5)
    shares = reflected(kind, round(min(max(rough, 0.0), 1.0), 3))
    stops = [[i / (STOPS - 1), *[float(f"{share:.4f}")] * 3] for i, share in enumerate(shares)]
    facing = Node("layer_weight", {}).output("facing")
    ramp = Node("ramp", {"factor": facing, "stops": stops}, (reader.scope, place.node.name, "sheen"),
                (reader.owner, *(group.name for group in place.groups), place.node.name, "sheen"))
    value = ramp.output(width=3)
    if not (color.is_constant and color.color() == [1.0, 1.0, 1.0]):
        value = calculate(lambda share, color: share * color, value, color)
    reader.context.report.note(f"{reader.owner}: the sheen of '{place.node.name}' is as bright as in Cycles under an "
                               "even sky; of one lamp's light it sends back as much to all sides")
    return {"type": "diffuse", "reflectance": value, "two_sided": True}


@lru_cache(maxsize=32)
def reflected(kind, rough):
    """Share of even light that is sent back, by 1 - cos to who looks, from 0 to 1."""
    cos = np.maximum(1.0 - np.arange(STOPS) / (STOPS - 1), 0.02)
    if kind == "MICROFIBER":
        row = min(int(rough * 5.0), 4)
        low, high = (np.interp(cos, np.arange(1, 11) / 10.0, MICROFIBER[row + i]) for i in (0, 1))
        return tuple(low + (high - low) * (rough * 5.0 - row))
    return tuple(np.clip([_velvet(float(c), max(rough, 0.01)) for c in cos], 0.0, 1.0))


def _velvet(cos_o, rough, steps=96):
    """M. Ashikhmin, S. Premoze, Distribution-based BRDFs, 2007, as Cycles has it: the integral over all light."""
    cos_i = ((np.arange(steps) + 0.5) / steps)[:, None]
    turn = np.pi * ((np.arange(steps) + 0.5) / steps)[None, :]
    sin_i, sin_o = np.sqrt(1.0 - cos_i**2), np.sqrt(1.0 - cos_o**2)
    between = cos_i * cos_o + sin_i * sin_o * np.cos(turn)
    half = np.sqrt(np.maximum(0.5 * (1.0 + between), 1e-8))
    cos_h = np.minimum((cos_i + cos_o) / (2.0 * half), 1.0)
    sin2 = np.maximum(1.0 - cos_h**2, 1e-8)
    density = np.exp(-(cos_h**2) / sin2 / rough**2) / (np.pi * rough**2 * sin2**2)
    hidden = np.minimum(1.0, 2.0 * cos_h / half * np.minimum(cos_i, cos_o))
    return float((0.25 * density * hidden / cos_o).mean() * 2.0 * np.pi)
