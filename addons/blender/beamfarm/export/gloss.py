"""The translation of shader nodes' roughness and index, for all nodes that have them."""

import numpy as np

from .arithmetic import calculate
from .values import is_white


def is_smooth(rough):
    return rough.is_constant and rough.number() ** 2 < 0.001


def microfacets(reader, place, rough):
    """`alpha` and `distribution` for a node's roughness."""
    kind = getattr(place.node, "distribution", "GGX")
    if kind in ("ASHIKHMIN_SHIRLEY",):
        reader.context.report.note(f"{reader.owner}: the distribution of '{place.node.name}' is taken as GGX")
    fields = {"alpha": calculate(lambda rough: np.clip(rough * rough, 0.001, 1.0), rough)}
    return fields | ({"distribution": "beckmann"} if kind == "BECKMANN" else {})


def keeps_energy(node):
    """Whether light that bounces more than once between microfacets is kept or lost."""
    return getattr(node, "distribution", "MULTI_GGX") == "MULTI_GGX"


def dielectric(reader, place, rough, ior, reflected, transmitted):
    """Fields of glass; with equal indices only transmission remains."""
    index = constant_of(reader, place, ior, "IOR", 1.45)
    fields = {"ior": min(max(index, 1e-5), 1e5)}
    if not is_white(reflected):
        fields["specular_reflectance"] = reflected
    if not is_white(transmitted):
        fields["specular_transmittance"] = transmitted
    if is_smooth(rough):
        return {"type": "dielectric"} | fields
    if not keeps_energy(place.node):
        fields["multiple_scattering"] = False
    return {"type": "rough_dielectric"} | fields | microfacets(reader, place, rough)


def constant_of(reader, place, value, what, otherwise):
    """The number for a field that takes no texture."""
    if value.is_constant:
        return value.number()
    if value.special is None:
        mean = float(value.data.mean())
        reader.context.report.note(f"{reader.owner}: {what} of '{place.node.name}' from a texture: its mean is used")
        return mean
    reader.lack(place.node, f"{what} by texture")
    return otherwise
