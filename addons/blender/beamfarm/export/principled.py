"""Principled BSDF."""

import numpy as np

from . import tangents
from .arithmetic import calculate, scaled
from .gloss import constant_of, dielectric, is_smooth, keeps_energy
from .graph import follow
from .subsurface import beneath
from .values import NotShown, constant, is_white


def principled(reader, place):
    """(fields of a material, alpha, radiance or None) of a Principled BSDF."""
    def get(name):
        return reader.get(place, name)

    base, metallic, rough = get("Base Color"), get("Metallic"), get("Roughness")
    transmission = get("Transmission Weight")
    ior = get("IOR")
    level = constant_of(reader, place, get("Specular IOR Level"), "the specular level", 0.5)
    tint = get("Specular Tint")
    try:
        emission = scaled(get("Emission Color"), get("Emission Strength"))
    except NotShown as problem:
        reader.lack(place.node, f"emission: {problem}")
        emission = None
    alpha = get("Alpha")
    is_metal = metallic.is_constant and metallic.number() >= 1.0
    is_dielectric = metallic.is_constant and metallic.number() <= 0.0
    coat, sheen, film = get("Coat Weight"), get("Sheen Weight"), get("Thin Film Thickness")
    diffuse_rough = {} if is_metal or _is_zero(get("Diffuse Roughness")) else {"roughness": get("Diffuse Roughness")}
    rough_base = {f"diffuse_{name}": value for name, value in diffuse_rough.items()}
    is_plain = _is_zero(coat) and _is_zero(sheen) and _is_zero(film)
    if transmission.is_constant and transmission.number() >= 1.0 and is_dielectric and is_plain:
        color = base if is_white(base) else calculate(lambda c: np.sqrt(np.clip(c, 0.0, 1.0)), base)
        return dielectric(reader, place, rough, ior, tint, color), alpha, emission
    index = constant_of(reader, place, ior, "IOR", 1.5)
    normal = ((index - 1.0) / (index + 1.0)) ** 2 * 2.0 * max(level, 0.0)
    beneath_it = _subsurface(reader, place, (transmission, is_metal, normal, rough))
    if beneath_it is not None:
        color, fields = beneath_it
        bsdf = {"type": "principled", "base_color": color(base), "metallic": metallic, "roughness": rough}
        bsdf |= _reflection(normal) | fields | tangents.of_principled(reader, place)
        return bsdf | rough_base | _over(reader, place) | _sheen(reader, place), alpha, emission
    if is_dielectric and normal == 0.0 and is_plain and _is_zero(transmission):
        return {"type": "diffuse", "reflectance": base, "two_sided": True} | diffuse_rough, alpha, emission
    is_plain = is_plain and not rough_base
    if is_smooth(rough) and is_white(tint) and is_dielectric and is_plain and _is_zero(transmission):
        return _plastic(base, normal), alpha, emission
    bsdf = {
        "type": "principled",
        "base_color": base,
        "metallic": metallic,
        "roughness": rough if not rough.is_constant else constant(max(rough.number(), 0.0)),
        "two_sided": True,
    } | _reflection(normal) | rough_base
    if is_metal and not keeps_energy(place.node):
        bsdf["multiple_scattering"] = False
    is_glass = is_dielectric and transmission.is_constant and transmission.number() >= 1.0
    if not is_glass:
        # Cycles' transmitted lobe is isotropic.
        bsdf |= _stretched(reader, place, not _is_zero(transmission) and not is_metal)
    if not _is_zero(transmission) and not is_metal:
        bsdf |= {"spec_trans": transmission, "two_sided": False}
        # Glass uses the index itself, not the reflectance derived from the level.
        bsdf.pop("specular", None)
        bsdf["ior"] = max(index, 1.0001)
        if is_glass and not keeps_energy(place.node):
            bsdf["multiple_scattering"] = False
        for name, is_there in (("coat", not _is_zero(coat)), ("specular tint", not is_white(tint))):
            if is_there:
                reader.context.report.leave_out(f"{name} of node '{place.node.name}' of {reader.owner}, "
                                                "which also transmits light")
        bsdf |= film_over(reader, place) | _sheen(reader, place)
    else:
        bsdf |= _over(reader, place) | _sheen(reader, place)
    if not is_metal and not is_dielectric and not keeps_energy(place.node):
        bsdf = _half_metal(bsdf, metallic)
    return bsdf, alpha, emission


# Fields that metals lack.
IN_DIELECTRICS = ("spec_trans", "ior", "specular", "diffuse_roughness")


def _half_metal(bsdf, share):
    """A metal that loses the interreflection of its microfacets, mixed with a dielectric that loses nothing."""
    metal = {name: value for name, value in bsdf.items() if name not in IN_DIELECTRICS}
    metal |= {"metallic": constant(1.0), "multiple_scattering": False, "two_sided": True}
    return {"type": "blend", "weight": share, "materials": [bsdf | {"metallic": constant(0.0)}, metal]}


def _reflection(normal):
    """Reflectance at normal incidence."""
    if normal <= 0.08:
        return {"specular": constant(normal / 0.08)}
    root = min(normal, 0.9) ** 0.5
    return {"ior": (1.0 + root) / (1.0 - root)}


def _stretched(reader, place, lets_through):
    fields = tangents.of_principled(reader, place)
    if fields and lets_through:
        reader.context.report.note(f"{reader.owner}: transmitted light is anisotropic, too, like reflected light")
    return fields


def _subsurface(reader, place, surface):
    """(function of the base colour, fields) if there is subsurface scattering; otherwise None."""
    weight = reader.get(place, "Subsurface Weight")
    transmission, is_metal, normal, rough = surface
    if _is_zero(weight) or is_metal:
        return None
    if not _is_zero(transmission):
        reader.context.report.leave_out(f"subsurface scattering of node '{place.node.name}' of {reader.owner}, "
                                        "which also transmits light")
        return None
    root = min(max(normal, 0.0), 0.9) ** 0.5
    roughness = float(rough.number()) if rough.is_constant else 0.5
    found = beneath(reader, place, place.node.subsurface_method, ((1.0 + root) / (1.0 - root), roughness))
    if found is None:
        return None
    dimmed, fields = found

    def color(base):
        if weight.is_constant and weight.number() >= 1.0:
            return dimmed(base)
        return calculate(lambda c, sunk, share: c + (sunk - c) * share, base.as_color(), dimmed(base).as_color(), weight)

    return color, {"subsurface": weight} | fields


def _plastic(base, normal):
    """A diffuse base below a smooth coat of normal reflectance `normal`: like Cycles' within 6 %."""
    root = min(normal, 0.9) ** 0.5
    return {"type": "plastic", "reflectance": base, "ior": (1.0 + root) / (1.0 - root), "two_sided": True}


def _is_zero(value):
    return value is None or (value.is_constant and value.number() == 0.0)


def _over(reader, place):
    """A coat, a film, and the tint of the reflection."""
    def get(name):
        return reader.get(place, name)

    fields = {}
    weight, tint = get("Coat Weight"), get("Specular Tint")
    if not _is_zero(weight):
        fields |= {"coat_weight": weight, "coat_roughness": get("Coat Roughness"),
                   "coat_ior": max(constant_of(reader, place, get("Coat IOR"), "the coat's IOR", 1.5), 1.0)}
        if not is_white(get("Coat Tint")):
            reader.context.report.leave_out(f"the coat's tint of node '{place.node.name}' of {reader.owner}")
        if _source(place, "Normal") != _source(place, "Coat Normal"):
            # Without a normal of its own the coat has the shape's.
            fields["coat_turned"] = reader.turned(place, "Coat Normal") or {}
    fields |= film_over(reader, place)
    if tint is not None and not is_white(tint):
        fields["specular_color"] = tint
    return fields


def _source(place, name):
    """The output linked to a normal input, if any."""
    socket = place.input(name)
    found = None if socket is None else follow(socket)
    is_turned = found is not None and found.socket.is_output and found.node.type not in ("NEW_GEOMETRY", "TEX_COORD")
    return found.socket if is_turned else None


def film_over(reader, place):
    """Fields of a thin film, for every node that has one."""
    film = reader.get(place, "Thin Film Thickness")
    if _is_zero(film):
        return {}
    ior = constant_of(reader, place, reader.get(place, "Thin Film IOR"), "the film's IOR", 1.33)
    # Blender's values are in nanometres.
    return {"thin_film_thickness": calculate(lambda nanometres: 0.001 * nanometres, film),
            "thin_film_ior": min(max(ior, 1.0), 5.0)}


def _sheen(reader, place):
    weight, tint = reader.get(place, "Sheen Weight"), reader.get(place, "Sheen Tint")
    if _is_zero(weight):
        return {}
    fields = {"sheen_weight": weight, "sheen_roughness": reader.get(place, "Sheen Roughness")}
    return fields if is_white(tint) else fields | {"sheen_color": tint}
