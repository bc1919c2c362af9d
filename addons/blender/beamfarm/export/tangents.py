"""Anisotropic microfacets: how much, and along which tangent."""

from dataclasses import dataclass

import numpy as np

from .arithmetic import calculate
from .gloss import microfacets
from .graph import follow
from .values import constant


@dataclass(frozen=True)
class AlongUv:
    """A tangent along the u of a UV map, "" being the active one, which is the scene file's default."""

    uv_map: str


def is_even(value):
    """Whether an input of anisotropy has no effect."""
    return value is None or (value.is_constant and value.number() == 0.0)


def of_principled(reader, place):
    """Fields of `principled`: as in Cycles, rougher along the tangent."""
    amount = reader.get(place, "Anisotropic")
    if is_even(amount):
        return {}
    return {"anisotropic": amount} | _turned(reader, place, "Anisotropic Rotation") | _tangent(reader, place)


def of_glossy(reader, place, rough):
    """Roughness of a Glossy BSDF: smoother along the tangent if its anisotropy is above 0."""
    fields = microfacets(reader, place, rough)
    amount = reader.get(place, "Anisotropy")
    if is_even(amount):
        return fields

    def along(rough, amount):
        amount = np.clip(amount, -MOST, MOST)
        return np.clip(rough * rough * (1.0 - np.maximum(amount, 0.0)) / (1.0 + np.minimum(amount, 0.0)), *ALPHA)

    del fields["alpha"]
    fields["alpha_u"] = calculate(along, rough, amount)
    fields["alpha_v"] = calculate(lambda rough, amount: along(rough, -amount), rough, amount)
    return fields | _turned(reader, place, "Rotation") | _tangent(reader, place)


# Cycles' limit.
MOST = 0.99
# The scene file's limits.
ALPHA = (0.001, 100.0)


def _turned(reader, place, name):
    rotation = reader.get(place, name)
    if rotation is not None and rotation.is_constant:
        rotation = constant(rotation.number() % 1.0)
    return {} if is_even(rotation) else {"anisotropic_rotation": rotation}


def _tangent(reader, place):
    """What a Tangent input is linked to; Cycles' own tangents go around the z axis."""
    socket = place.input("Tangent")
    found = None if socket is None else follow(socket)
    if found is None or not found.socket.is_output or found.node.mute:
        return {"tangent": "around_z"}
    node = found.node
    if node.type == "TANGENT":
        if node.direction_type == "UV_MAP":
            return {"tangent": AlongUv(node.uv_map)}
        return {"tangent": f"around_{node.axis.lower()}"}
    if (node.type, found.socket.name) != ("NEW_GEOMETRY", "Tangent"):
        reader.lack(node, "as a tangent; one around the z axis is used")
    return {"tangent": "around_z"}
