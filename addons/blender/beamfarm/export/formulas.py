"""The arithmetic of Blender's nodes on arrays whose last axis has length one or three.

Each function takes its node first. Sources: Blender's manual, "Shader Nodes", chapters Converter and Color.
"""

import math as plain

import numpy as np

from .values import LUMINANCE, NotShown


def luminance(color):
    return (color @ LUMINANCE)[..., None]


def _divide(a, b):
    return np.divide(a, b, out=np.zeros(np.broadcast(a, b).shape, dtype=np.float32), where=b != 0.0)


def _wrap(a, high, low):
    span = high - low
    return np.where(span != 0.0, a - span * np.floor(_divide(a - low, span)), low)


def _smooth_min(a, b, distance):
    h = np.maximum(_divide(distance - np.abs(a - b), distance), 0.0)
    return np.minimum(a, b) - h * h * h * distance / 6.0


def _ping_pong(a, scale):
    fraction = _divide(a - scale, scale * 2.0)
    return np.abs((fraction - np.floor(fraction)) * scale * 2.0 - scale)


def _power(a, b):
    return np.where((a < 0.0) & (b != np.floor(b)), 0.0, np.power(a, b))


MATH = {
    "ADD": lambda a, b: a + b,
    "SUBTRACT": lambda a, b: a - b,
    "MULTIPLY": lambda a, b: a * b,
    "DIVIDE": _divide,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
    "POWER": _power,
    "LOGARITHM": lambda a, b: _divide(np.log(np.maximum(a, 1e-30)), np.log(np.maximum(b, 1e-30))),
    "SQRT": lambda a: np.sqrt(np.maximum(a, 0.0)),
    "INVERSE_SQRT": lambda a: np.where(a > 0.0, 1.0 / np.sqrt(np.maximum(a, 1e-30)), 0.0),
    "ABSOLUTE": np.abs,
    "EXPONENT": np.exp,
    "MINIMUM": np.minimum,
    "MAXIMUM": np.maximum,
    "LESS_THAN": lambda a, b: np.where(a < b, 1.0, 0.0),
    "GREATER_THAN": lambda a, b: np.where(a > b, 1.0, 0.0),
    "SIGN": np.sign,
    "COMPARE": lambda a, b, c: np.where(np.abs(a - b) <= np.maximum(c, 1e-5), 1.0, 0.0),
    "SMOOTH_MIN": _smooth_min,
    "SMOOTH_MAX": lambda a, b, c: -_smooth_min(-a, -b, c),
    "ROUND": lambda a: np.floor(a + 0.5),
    "FLOOR": np.floor,
    "CEIL": np.ceil,
    "TRUNC": np.trunc,
    "FRACT": lambda a: a - np.floor(a),
    "MODULO": lambda a, b: np.where(b != 0.0, np.fmod(a, np.where(b != 0.0, b, 1.0)), 0.0),
    "FLOORED_MODULO": lambda a, b: np.where(b != 0.0, np.mod(a, np.where(b != 0.0, b, 1.0)), 0.0),
    "WRAP": _wrap,
    "SNAP": lambda a, b: np.floor(_divide(a, b)) * b,
    "PINGPONG": lambda a, b: np.where(b != 0.0, _ping_pong(a, np.where(b != 0.0, b, 1.0)), 0.0),
    "SINE": np.sin,
    "COSINE": np.cos,
    "TANGENT": np.tan,
    "ARCSINE": lambda a: np.arcsin(np.clip(a, -1.0, 1.0)),
    "ARCCOSINE": lambda a: np.arccos(np.clip(a, -1.0, 1.0)),
    "ARCTANGENT": np.arctan,
    "ARCTAN2": np.arctan2,
    "SINH": np.sinh,
    "COSH": np.cosh,
    "TANH": np.tanh,
    "RADIANS": lambda a: a * (plain.pi / 180.0),
    "DEGREES": lambda a: a * (180.0 / plain.pi),
}


def math(node, *inputs):
    function = _known(MATH, node.operation)
    value = function(*inputs)
    return np.clip(value, 0.0, 1.0) if node.use_clamp else value


def _known(table, name):
    if name not in table:
        raise NotShown(f"operation {name.lower().replace('_', ' ')}")
    return table[name]


VECTOR_MATH = {
    name: MATH[name]
    for name in ("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "POWER", "ABSOLUTE", "MINIMUM", "MAXIMUM",
                 "FLOOR", "CEIL", "MODULO", "WRAP", "SNAP", "SINE", "COSINE", "TANGENT", "SIGN")
} | {
    "FRACTION": MATH["FRACT"],
    "SCALE": lambda a, b: a * b,
    "DOT_PRODUCT": lambda a, b: (a * b).sum(-1, keepdims=True),
    "CROSS_PRODUCT": np.cross,
    "LENGTH": lambda a: np.linalg.norm(a, axis=-1, keepdims=True),
    "DISTANCE": lambda a, b: np.linalg.norm(a - b, axis=-1, keepdims=True),
    "NORMALIZE": lambda a: _divide(a, np.linalg.norm(a, axis=-1, keepdims=True)),
}


def vector_math(node, *inputs):
    return _known(VECTOR_MATH, node.operation)(*inputs)


def _blend(kind, factor, a, b):
    """Blender's blend modes for colours; `factor` is the weight of the second."""
    rest = 1.0 - factor
    plain_modes = {
        "MIX": lambda: a * rest + b * factor,
        "ADD": lambda: a + factor * b,
        "MULTIPLY": lambda: a * (rest + factor * b),
        "SUBTRACT": lambda: a - factor * b,
        "SCREEN": lambda: 1.0 - (rest + factor * (1.0 - b)) * (1.0 - a),
        "DIVIDE": lambda: np.where(b != 0.0, rest * a + factor * _divide(a, b), a),
        "DIFFERENCE": lambda: rest * a + factor * np.abs(a - b),
        "EXCLUSION": lambda: np.maximum(rest * a + factor * (a + b - 2.0 * a * b), 0.0),
        "DARKEN": lambda: rest * a + factor * np.minimum(a, b),
        "LIGHTEN": lambda: np.maximum(a, factor * b),
        "LINEAR_LIGHT": lambda: a + factor * (2.0 * b - 1.0),
        "SOFT_LIGHT": lambda: rest * a
        + factor * ((1.0 - a) * b * a + a * (1.0 - (1.0 - b) * (1.0 - a))),
        "OVERLAY": lambda: np.where(
            a < 0.5, a * (rest + 2.0 * factor * b), 1.0 - (rest + 2.0 * factor * (1.0 - b)) * (1.0 - a)
        ),
        "DODGE": lambda: np.where(
            a != 0.0, np.where(1.0 - factor * b > 0.0, np.minimum(_divide(a, 1.0 - factor * b), 1.0), 1.0), 0.0
        ),
        "BURN": lambda: np.where(
            rest + factor * b > 0.0, np.clip(1.0 - _divide(1.0 - a, rest + factor * b), 0.0, 1.0), 0.0
        ),
    }
    return _known(plain_modes, kind)()


def mix(node, factor, a, b):
    if node.clamp_factor:
        factor = np.clip(factor, 0.0, 1.0)
    if node.data_type == "RGBA":
        value = _blend(node.blend_type, factor, a, b)
        return np.clip(value, 0.0, 1.0) if node.clamp_result else value
    return a * (1.0 - factor) + b * factor


def mix_rgb(node, factor, a, b):
    value = _blend(node.blend_type, np.clip(factor, 0.0, 1.0), a, b)
    return np.clip(value, 0.0, 1.0) if node.use_clamp else value


def invert(node, factor, color):
    return color * (1.0 - factor) + factor * (1.0 - color)


def gamma(node, color, exponent):
    return np.where(color > 0.0, np.power(np.maximum(color, 1e-30), exponent), color)


def bright_contrast(node, color, bright, contrast):
    a = 1.0 + contrast
    return np.maximum(a * color + bright - contrast * 0.5, 0.0)


def hue_saturation(node, *inputs):
    hue, saturation, value, factor, color = inputs
    hsv = from_rgb(color, "HSV")
    h = np.mod(hsv[..., :1] + hue + 0.5, 1.0)
    s = np.clip(hsv[..., 1:2] * saturation, 0.0, 1.0)
    v = hsv[..., 2:] * value
    out = to_rgb(np.concatenate(np.broadcast_arrays(h, s, v), axis=-1), "HSV")
    return np.maximum(color * (1.0 - factor) + out * factor, 0.0)


def clamp(node, value, low, high):
    if node.clamp_type == "RANGE":
        low, high = np.minimum(low, high), np.maximum(low, high)
    return np.minimum(np.maximum(value, low), high)


def map_range(node, value, from_min, from_max, to_min, to_max, steps=None):
    t = _divide(value - from_min, from_max - from_min)
    if node.interpolation_type == "STEPPED" and steps is not None:
        t = np.where(steps > 0.0, np.floor(t * (steps + 1.0)) / np.where(steps > 0.0, steps, 1.0), 0.0)
    elif node.interpolation_type == "SMOOTHSTEP":
        t = np.clip(t, 0.0, 1.0)
        t = t * t * (3.0 - 2.0 * t)
    elif node.interpolation_type == "SMOOTHERSTEP":
        t = np.clip(t, 0.0, 1.0)
        t = t * t * t * (t * (t * 6.0 - 15.0) + 10.0)
    result = to_min + t * (to_max - to_min)
    return np.clip(result, np.minimum(to_min, to_max), np.maximum(to_min, to_max)) if node.clamp else result


def look_up(table, factor):
    """Looks up an even `table` over 0 to 1 by rows, with linear interpolation."""
    last = len(table) - 1
    x = np.clip(factor[..., 0], 0.0, 1.0) * last
    low = np.minimum(x.astype(np.int64), last - 1)
    part = (x - low)[..., None]
    return table[low] * (1.0 - part) + table[low + 1] * part


def curves(tables, factor, color):
    """RGB curves: the combined one first, then one for each channel."""
    out = [look_up(tables[i][:, None], look_up(tables[3][:, None], color[..., i : i + 1])) for i in range(3)]
    return color * (1.0 - factor) + np.concatenate(out, axis=-1) * factor


def from_rgb(color, mode):
    """Converts colours to HSV or HSL."""
    high, low = color.max(-1), color.min(-1)
    span = high - low
    safe = np.where(span > 0.0, span, 1.0)
    r, g, b = color[..., 0], color[..., 1], color[..., 2]
    h = np.where(high == r, (g - b) / safe, np.where(high == g, 2.0 + (b - r) / safe, 4.0 + (r - g) / safe))
    h = np.where(span > 0.0, np.mod(h / 6.0, 1.0), 0.0)
    if mode == "HSV":
        return np.stack([h, np.where(high > 0.0, span / np.where(high > 0.0, high, 1.0), 0.0), high], axis=-1)
    light = (high + low) / 2.0
    below = np.where(light > 0.5, 2.0 - high - low, high + low)
    s = np.where(span > 0.0, span / np.where(below != 0.0, below, 1.0), 0.0)
    return np.stack([h, s, light], axis=-1)


def to_rgb(color, mode):
    """Converts HSV or HSL to colours."""
    h, s, v = color[..., :1], color[..., 1:2], color[..., 2:]
    hue = np.clip(np.abs(np.mod(h * 6.0 + np.array([0.0, 4.0, 2.0], dtype=np.float32), 6.0) - 3.0) - 1.0, 0.0, 1.0)
    if mode == "HSV":
        return v * (1.0 - s + s * hue)
    return v + s * (hue - 0.5) * (1.0 - np.abs(2.0 * v - 1.0))


def _lobe(wavelength, height, centre, below, above):
    width = np.where(wavelength < centre, below, above)
    return height * np.exp(-0.5 * ((wavelength - centre) / width) ** 2)


def _observer():
    """(wavelengths in nm, the CIE 1931 X, Y and Z there).

    Uses the fit of Wyman, Sloan and Shirley, JCGT 2(2), 2013.
    """
    at = np.arange(360.0, 831.0, 2.0)
    x = _lobe(at, 1.056, 599.8, 37.9, 31.0) + _lobe(at, 0.362, 442.0, 16.0, 26.7)
    y = _lobe(at, 0.821, 568.8, 46.9, 40.5) + _lobe(at, 0.286, 530.9, 16.3, 31.1)
    z = _lobe(at, 1.217, 437.0, 11.8, 36.0) + _lobe(at, 0.681, 459.0, 26.0, 13.8)
    return at, np.stack([x + _lobe(at, -0.065, 501.1, 20.4, 26.2), y, z], axis=-1)


# From XYZ to Rec. 709.
RGB_OF_XYZ = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
SECOND_RADIATION_CONSTANT = 1.4387769e7
"""Planck's h c / k, nm K."""


def blackbody(temperature):
    """Colour of a black body of this many kelvin, with luminance 1. Blender supports 800 to 12000 K and clamps to
    that."""
    kelvin = np.clip(temperature, 800.0, 12000.0).astype(np.float64)
    wavelength, observer = _observer()
    # Scaled to avoid overflow.
    power = (560.0 / wavelength) ** 5 / np.expm1(SECOND_RADIATION_CONSTANT / (wavelength * kelvin))
    color = (power @ observer) @ RGB_OF_XYZ.T
    return np.maximum(color / (power @ observer[:, 1:2]), 0.0)
