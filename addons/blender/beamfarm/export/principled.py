"""Principled BSDF."""

import numpy as np

from .values import NotShown, combine, constant

# What `principled` of the scene file has no word for, and the value at which it does nothing.
MISSING = {
    "Subsurface Weight": ("subsurface scattering", 0.0),
    "Anisotropic": ("anisotropy", 0.0),
    "Coat Weight": ("the coat", 0.0),
    "Sheen Weight": ("sheen", 0.0),
    "Thin Film Thickness": ("the thin film", 0.0),
    "Diffuse Roughness": ("diffuse roughness", 0.0),
}


def principled(reader, place):
    """(fields of a material, alpha, radiance or None) of a Principled BSDF."""
    from .surfaces import constant_of, dielectric, is_white, scaled

    def get(name):
        return reader.get(place, name)

    for name, (what, nothing) in MISSING.items():
        value = get(name)
        if value is not None and not (value.is_constant and value.number() == nothing):
            reader.context.report.leave_out(f"{what} of node '{place.node.name}' of {reader.owner}")
    base, metallic, rough = get("Base Color"), get("Metallic"), get("Roughness")
    transmission = constant_of(reader, place, get("Transmission Weight"), "transmission", 0.0)
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
    if transmission >= 1.0 and is_dielectric:
        color = base if is_white(base) else combine(np.sqrt, combine(lambda c: np.clip(c, 0.0, 1.0), base))
        return dielectric(reader, place, rough, ior, tint, color), alpha, emission
    if transmission > 0.0 and not is_metal:
        reader.context.report.leave_out(f"transmission of node '{place.node.name}' of {reader.owner}")
    index = constant_of(reader, place, ior, "IOR", 1.5)
    normal = ((index - 1.0) / (index + 1.0)) ** 2 * 2.0 * max(level, 0.0)
    if is_dielectric and normal == 0.0:
        return {"type": "diffuse", "reflectance": base, "two_sided": True}, alpha, emission
    if not is_white(tint):
        reader.context.report.leave_out(f"specular tint of node '{place.node.name}' of {reader.owner}")
    if normal > 0.08:
        reader.context.report.note(f"{reader.owner}: reflects 8 % at normal incidence at most, not {100 * normal:.1f} %")
    bsdf = {
        "type": "principled",
        "base_color": base,
        "metallic": metallic,
        "roughness": rough if not rough.is_constant else constant(max(rough.number(), 0.0)),
        "specular": constant(min(normal / 0.08, 1.0)),
        "two_sided": True,
    }
    return bsdf, alpha, emission
