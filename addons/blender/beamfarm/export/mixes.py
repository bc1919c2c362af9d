"""Surfaces, and mixes and sums of two."""

from dataclasses import dataclass, replace

import numpy as np

from . import subsurface
from .arithmetic import calculate, scaled
from .sheen import diffuse as diffuse_sheen
from .values import NotShown, Value, combine, constant


@dataclass
class Surface:
    """How a surface treats light."""

    bsdf: dict | None = None
    """Fields of a material, with `Value`s; None absorbs all light."""
    opacity: Value = None
    """Share of the light that hits it at all."""
    emission: Value | None = None
    """Radiance."""
    turned: dict | None = None
    """`bump` or `normal_map`."""
    wants: tuple = ()
    """Outputs of nodes to bake."""
    displacement: dict | None = None
    """`height`, a `Value`, `midlevel`, `scale`, and whether these are lengths in world space."""


def opaque(bsdf, emission=None, turned=None):
    return Surface(bsdf, constant(1.0), emission, turned)


BLACK = {"type": "diffuse", "reflectance": constant(0.0, 0.0, 0.0), "two_sided": True}


def _sum(a, b):
    if a is None or b is None:
        return a if b is None else b
    return calculate(lambda a, b: a + b, a, b)


def _inverse(value):
    return calculate(lambda value: 1.0 - value, value)


def _times(a, b):
    if a.is_constant and a.number() == 1.0:
        return b
    if b.is_constant and b.number() == 1.0:
        return a
    return calculate(lambda a, b: a * b, a, b)


def mixed(reader, factor, a, b):
    """`b` with weight `factor`, `a` with the rest."""
    rest = _inverse(factor)
    opacity = _opacity(factor, rest, a.opacity, b.opacity)
    emission = _sum(scaled(a.emission, rest), scaled(b.emission, factor))
    turned = _one_turned(reader, a, b)
    for one, other in ((a, b), (b, a)):
        if other.opacity.is_constant and other.opacity.number() == 0.0:
            return Surface(one.bsdf, opacity, emission, turned)
    if a.bsdf is None and b.bsdf is None:
        return Surface(None, opacity, emission, turned)
    weight = factor
    if not (_is_one(a.opacity) and _is_one(b.opacity)):
        weight = calculate(
            lambda f, a, b: f * b / np.maximum(f * b + (1.0 - f) * a, 1e-12), factor, a.opacity, b.opacity
        )
    second = b.bsdf
    if subsurface.is_in(a.bsdf) and subsurface.is_in(second):
        reader.context.report.leave_out(f"subsurface scattering of the second shader in a mix of {reader.owner}")
        second = subsurface.without(second)
    blend = {"type": "blend", "weight": weight, "materials": [a.bsdf or BLACK, second or BLACK]}
    return Surface(_simple(blend), opacity, emission, turned)


def _simple(blend):
    """Merges two diffuse materials of constant colours."""
    a, b = blend["materials"]
    weight = blend["weight"]
    is_smooth = not ("roughness" in a or "roughness" in b)
    if a["type"] == b["type"] == "diffuse" and is_smooth and not (a["reflectance"].special or b["reflectance"].special):
        try:
            mix = combine(lambda a, b, f: a * (1.0 - f) + b * f, a["reflectance"], b["reflectance"], weight)
        except NotShown:
            return blend
        return {"type": "diffuse", "reflectance": mix, "two_sided": True}
    return blend


def _is_one(value):
    return value.is_constant and value.number() == 1.0


def _opacity(factor, rest, a, b):
    if _is_one(a) and _is_one(b):
        return a
    if a.is_constant and a.number() == 0.0:
        return _times(factor, b)
    if b.is_constant and b.number() == 0.0:
        return _times(rest, a)
    return calculate(lambda f, a, b: (1.0 - f) * a + f * b, factor, a, b)


def _one_turned(reader, a, b):
    if a.turned and b.turned and _shown(a.turned) != _shown(b.turned):
        reader.context.report.note(f"{reader.owner}: of two bumps or normal maps in a mix the first is used")
    return a.turned or b.turned


def _shown(turned):
    """Identifies a bump or normal map."""
    return [(name, _shown(value) if isinstance(value, dict) else
             (value.name, value.lookup) if isinstance(value, Value) else value) for name, value in turned.items()]


def added(reader, place, a, b):
    """The sum of `a` and `b` by the node of `place`."""
    try:
        emission = _sum(a.emission, b.emission)
    except NotShown as problem:
        reader.lack(place.node, str(problem))
        emission = a.emission or b.emission
    if a.bsdf is None and _is_one(a.opacity):
        return replace(b, emission=emission)
    if b.bsdf is None and _is_one(b.opacity):
        return replace(a, emission=emission)
    both = _leaf(reader, a, b) or _leaf(reader, b, a) or _beneath(reader, place, a, b) or _beneath(reader, place, b, a)
    if both is not None:
        return Surface(both, constant(1.0), emission, _one_turned(reader, a, b))
    try:
        if _is_one(a.opacity) and _is_one(b.opacity):
            bsdf = _both(reader, place, a.bsdf, b.bsdf)
            if bsdf is not None:
                return Surface(bsdf, a.opacity, emission, _one_turned(reader, a, b))
    except NotShown:
        pass
    for one, other in ((a, b), (b, a)):
        if one.bsdf is None and one.opacity.is_constant and _is_one(other.opacity):
            through = _before_nothing(reader, place, other)
            if through is not None:
                return replace(through, emission=emission)
    reader.lack(place.node, "a sum of two shaders that both scatter light; the first is used")
    return replace(a, emission=emission)


def _leaf(reader, a, b):
    """A diffuse and a translucent shader as one; None for others."""
    if not (_is_one(a.opacity) and _is_one(b.opacity)) or a.bsdf is None or b.bsdf is None:
        return None
    if a.bsdf["type"] != "diffuse" or b.bsdf["type"] != "translucent":
        return None
    if "roughness" in a.bsdf:
        reader.context.report.note(f"{reader.owner}: diffuse shaders added to translucent ones are Lambertian")
    return b.bsdf | {"reflectance": a.bsdf["reflectance"]}


def _beneath(reader, place, a, b):
    """A diffuse shader or sheen added to a Principled one with a diffuse base; None for others."""
    if not (_is_one(a.opacity) and _is_one(b.opacity)) or a.bsdf is None or b.bsdf is None:
        return None
    if b.bsdf["type"] not in ("diffuse", *FLEECY) or "subsurface" in a.bsdf or "spec_trans" in a.bsdf:
        return None
    field = {"principled": "base_color", "plastic": "reflectance", "rough_plastic": "reflectance"}.get(a.bsdf["type"])
    metallic = a.bsdf.get("metallic")
    if field is None or metallic is not None and not (metallic.is_constant and metallic.number() == 0.0):
        return None
    reader.context.report.note(f"{reader.owner}: what is added to its base lies below its gloss")
    below = b.bsdf
    if below["type"] in FLEECY:
        below = diffuse_sheen(reader, place, FLEECY[below["type"]], below["reflectance"], below["roughness"])
    elif "roughness" in below:
        reader.context.report.note(f"{reader.owner}: what is added to its base is as rough as the base")
    color = calculate(lambda a, b: np.clip(a + b, 0.0, 1.0), a.bsdf[field].as_color(), below["reflectance"].as_color())
    return a.bsdf | {field: color}


def _before_nothing(reader, place, shown):
    """A reflective shader plus one that lets all light through: it covers as much as it reflects. None for others."""
    if shown.bsdf is None or shown.bsdf["type"] not in TINTED:
        return None
    color = shown.bsdf["reflectance"]
    most = _most(color)
    if most <= 0.0 or most >= 1.0:
        return None
    what = f"a sum that reflects up to {1.0 + most:.2f} of the light is dimmed to what arrives"
    if most > SLIGHT:
        reader.lack(place.node, what)
    else:
        reader.context.report.note(f"{reader.owner}: {what}")
    bsdf = shown.bsdf | {"reflectance": calculate(lambda color: color / most, color)}
    return replace(shown, bsdf=bsdf, opacity=constant(most))


# Reflection beyond one by up to this much may be cut off without reporting anything missing.
SLIGHT = 0.05

# Materials whose whole response is multiplied by one colour.
TINTED = {"diffuse", "mirror", "rough_conductor", "velvet", "sheen"}
# Of these, those that reflect as much as their colour only in few directions, and Blender's names of them.
FLEECY = {"velvet": "ASHIKHMIN", "sheen": "MICROFIBER"}


def _both(reader, place, a, b):
    """Both materials as a mix of brighter ones, to make up for the mix's weights; None for others."""
    if a["type"] not in TINTED or b["type"] not in TINTED:
        return None
    shares = [_most(part["reflectance"]) for part in (a, b)]
    total = sum(shares)
    if min(shares) <= 0.0:
        return a if shares[1] <= 0.0 else b
    is_known = a["reflectance"].special is None and b["reflectance"].special is None
    kept = list(shares)
    fleecy = [i for i, part in enumerate((a, b)) if part["type"] in FLEECY]
    if total > 1.0 and len(fleecy) == 1 and shares[1 - fleecy[0]] < 1.0:
        # What lies below is unchanged.
        (i,) = fleecy
        kept[i] = 1.0 - shares[1 - i]
        reader.lack(place.node, f"{(a, b)[i]['type']} of {shares[i]:.2f} over what is as bright is dimmed to "
                                f"{kept[i]:.2f}")
    elif total > 1.0 and (is_known or a["type"] != b["type"]):
        reader.lack(place.node, f"a sum that reflects up to {total:.2f} of the light is dimmed to what arrives")
    are_rough = ["roughness" in part for part in (a, b) if part["type"] == "diffuse"]
    if any(are_rough):
        reader.context.report.note(f"{reader.owner}: rough diffuse shaders of a sum are somewhat brighter")
    if len(are_rough) == 2 and not any(are_rough):
        # As for sheen at grazing angles, which is then cut off.
        both = calculate(lambda a, b: np.clip(a + b, 0.0, 1.0), a["reflectance"], b["reflectance"])
        return a | {"reflectance": both}
    weight = kept[1] / sum(kept)
    gains = [of_kept / share / max(sum(kept), 1.0) / of_mix
             for of_kept, share, of_mix in zip(kept, shares, (1.0 - weight, weight))]
    parts = [part | {"reflectance": calculate(lambda color, gain=gain: color * gain, part["reflectance"])}
             for part, gain in zip((a, b), gains)]
    return _simple({"type": "blend", "weight": constant(weight), "materials": parts})


def _most(value):
    """The largest value of a colour anywhere; 1 if unknown."""
    return 1.0 if value.special is not None else float(np.clip(value.data, 0.0, 1.0).max())
