"""Sheen BSDF: Ashikhmin's as velvet, microfibers as sheen. Sheen below another shader's gloss becomes a diffuse lobe
whose reflectance depends on the viewing angle, as bright as Cycles' in even light."""

from functools import lru_cache

import numpy as np

from .arithmetic import Node, calculate
from .gloss import constant_of

STOPS = 17
# Share of even light that Cycles' microfibers reflect: rows by roughness, columns by the cosine to the viewer, both
# from 0 in steps of 0.1.
MICROFIBER = np.array([
    [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
    [0.561, 0.043, 0.002, 0, 0, 0, 0, 0, 0, 0, 0],
    [0.689, 0.298, 0.088, 0.021, 0.005, 0.002, 0.001, 0, 0, 0, 0],
    [0.699, 0.435, 0.238, 0.113, 0.049, 0.022, 0.01, 0.005, 0.002, 0.001, 0.001],
    [0.696, 0.507, 0.348, 0.222, 0.134, 0.078, 0.044, 0.025, 0.014, 0.008, 0.005],
    [0.694, 0.552, 0.426, 0.314, 0.223, 0.154, 0.104, 0.069, 0.045, 0.03, 0.019],
    [0.696, 0.585, 0.484, 0.389, 0.304, 0.234, 0.178, 0.133, 0.098, 0.071, 0.05],
    [0.702, 0.614, 0.532, 0.452, 0.377, 0.31, 0.254, 0.206, 0.166, 0.132, 0.104],
    [0.714, 0.642, 0.574, 0.506, 0.441, 0.381, 0.328, 0.282, 0.241, 0.206, 0.176],
    [0.731, 0.67, 0.612, 0.553, 0.496, 0.444, 0.397, 0.355, 0.319, 0.287, 0.258],
    [0.75, 0.698, 0.646, 0.594, 0.544, 0.499, 0.459, 0.423, 0.393, 0.366, 0.342]])


def sheen(reader, place):
    """Fields of a material."""
    color, rough = reader.get(place, "Color"), reader.get(place, "Roughness")
    is_velvet = getattr(place.node, "distribution", "ASHIKHMIN") == "ASHIKHMIN"
    return {"type": "velvet" if is_velvet else "sheen", "reflectance": color, "roughness": rough, "two_sided": True}


def diffuse(reader, place, kind, color, rough):
    """Fields of a diffuse material in place of a kind of sheen."""
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
                               "even sky; it reflects a single lamp's light equally to all sides")
    return {"type": "diffuse", "reflectance": value, "two_sided": True}


@lru_cache(maxsize=32)
def reflected(kind, rough):
    """Share of even light that is reflected, by 1 - cos to the viewer, from 0 to 1."""
    cos = np.maximum(1.0 - np.arange(STOPS) / (STOPS - 1), 0.02)
    if kind == "MICROFIBER":
        row = min(int(rough * 10.0), 9)
        low, high = (np.interp(cos, np.arange(11) / 10.0, MICROFIBER[row + i]) for i in (0, 1))
        return tuple(low + (high - low) * (rough * 10.0 - row))
    return tuple(np.clip([_velvet(float(c), max(rough, 0.01)) for c in cos], 0.0, 1.0))


def _velvet(cos_o, rough, steps=96):
    """M. Ashikhmin, S. Premoze, Distribution-based BRDFs, 2007, as in Cycles: the integral over all light."""
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
