"""Principled Hair as the scene file's hair, which is the same model."""

import math

from .gloss import constant_of

# Absorption of the pigments in Cycles, relative to the radius.
EUMELANIN = (0.506, 0.841, 1.653)
PHEOMELANIN = (0.343, 0.733, 1.924)


def hair(reader, place):
    """Fields of hair."""
    node = place.node
    note = reader.context.report.note
    if getattr(node, "model", "CHIANG") != "CHIANG":
        note(f"{reader.owner}: the hair of '{node.name}' is that of Chiang, not of Huang")
    for name in ("Random Color", "Random Roughness"):
        value = reader.get(place, name)
        if value is not None and not (value.is_constant and value.number() == 0.0):
            note(f"{reader.owner}: '{name}' of '{node.name}' is ignored: all strands are alike")
    rough, radial = (_number(reader, place, name, 0.3) for name in ("Roughness", "Radial Roughness"))
    fields = {
        "type": "hair",
        "beta_m": min(max(rough, 0.0), 1.0),
        "beta_n": min(max(radial, 0.0), 1.0),
        # The opposite sense along the fibre.
        "tilt": -float(f"{math.degrees(_number(reader, place, 'Offset', math.radians(2.0))):.6g}"),
        "ior": min(max(_number(reader, place, "IOR", 1.55), 1.001), 1e3),
    }
    coat = min(max(_number(reader, place, "Coat", 0.0), 0.0), 1.0)
    if coat > 0.0:
        fields["coat"] = coat
    if node.parametrization == "COLOR":
        return fields | {"color": reader.get(place, "Color")}
    if node.parametrization == "ABSORPTION":
        return fields | {"absorption": _color(reader, place, "Absorption Coefficient")}
    melanin, redness = (_number(reader, place, name, 0.5) for name in ("Melanin", "Melanin Redness"))
    amount = -math.log(max(1.0 - melanin, 1e-4))
    tint = [_absorption(channel, fields["beta_n"]) for channel in _color(reader, place, "Tint")]
    absorption = [
        amount * ((1.0 - redness) * brown + redness * red) + dyed
        for brown, red, dyed in zip(EUMELANIN, PHEOMELANIN, tint)
    ]
    return fields | {"absorption": absorption}


def _absorption(color, radial):
    """Absorption of hair that has this colour in bulk (Chiang et al. 2016, section 4.2)."""
    factor = 5.969 - 0.215 * radial + 2.532 * radial**2 - 10.73 * radial**3 + 5.574 * radial**4 + 0.245 * radial**5
    return (math.log(min(max(color, 1e-5), 1.0)) / factor) ** 2


def _number(reader, place, name, otherwise):
    value = reader.get(place, name)
    return otherwise if value is None else constant_of(reader, place, value, name, otherwise)


def _color(reader, place, name):
    value = reader.get(place, name)
    if not value.is_constant:
        reader.lack(place.node, f"{name} by texture")
        return [0.5, 0.5, 0.5]
    return [max(float(channel), 0.0) for channel in value.color()]
