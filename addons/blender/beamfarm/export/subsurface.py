"""Subsurface scattering: turns Cycles' random walks into the medium below a surface of the scene file.

Cycles lets light leave diffusely but enter by refraction, so less comes back than the colour says; the scene file's
surface is diffuse both ways and reflects exactly its colour. The functions here give it Cycles' resulting colour,
averaged over all directions, and its mean free path.
"""

import math
from functools import lru_cache

import numpy as np

from .arithmetic import calculate
from .gloss import constant_of
from .facets import facets_towards
from .values import NotShown, constant

# Mean free path as a fraction of a node's radius, for the methods that keep older looks.
RADIUS = 0.25 / np.pi
# Light enters skin like this half of the time, and diffusely otherwise.
SKIN_ROUGHNESS = 1.0
# Number of scatterings after which Cycles ends a walk.
BOUNCES = 256
LEAST = 1e-6


def beneath(reader, place, method, interface):
    """(function of the colour, fields) for a node's subsurface scattering; None if light does not move at all.

    `interface`: index of refraction and roughness of the surface that light enters through.
    """
    scale = _number(reader, place, _name(place, "Scale"), 1.0)
    radii = reader.get(place, _name(place, "Radius"))
    try:
        radii = np.array(radii.color()) if radii.is_constant else None
    except NotShown:
        radii = None
    if radii is None:
        reader.lack(place.node, "subsurface radii from a texture: the default ones are used")
        radii = np.array([1.0, 0.2, 0.1])
    g = _number(reader, place, _name(place, "Anisotropy"), 0.0)
    g = float(np.clip(g, 0.0, 0.99))
    if method == "BURLEY":
        reader.context.report.note(f"{reader.owner}: subsurface scattering with Christensen and Burley's profile is a "
                                   "random walk in a medium")
    index, roughness = interface
    is_skin = method == "RANDOM_WALK_SKIN"
    if is_skin:
        name = "IOR" if place.node.type == "SUBSURFACE_SCATTERING" else "Subsurface IOR"
        index = _number(reader, place, name, 1.4)
        roughness = SKIN_ROUGHNESS
    index = round(float(np.clip(index, 1.01, 3.8)), 4)
    radii = np.maximum(radii * scale, 0.0)
    if float(radii.max(initial=0.0)) <= LEAST:
        return None
    # How light enters, then what comes back for each colour.
    way = (round(g, 4), round(roughness, 3), index, method == "BURLEY", is_skin)
    first, second, third, fourth = _fit(*way)

    def color(value):
        if value.is_constant:
            return constant(*(_sent_back(min(max(c, 1e-3), 1.0), *way) for c in value.color()))
        return calculate(lambda c: np.clip(c * (c * (c * (c * fourth + third) + second) + first), 0.0, 1.0), value)

    free = [float(max(radius, LEAST)) for radius in radii * (1.0 if is_skin else RADIUS)]
    if is_skin:
        free = [radius * factor for radius, factor in zip(free, _skin(reader, place, index))]
    fields = {"subsurface_radius": free[0] if len(set(free)) == 1 else free}
    if g != 0.0:
        fields["subsurface_anisotropy"] = g
    return color, fields


def _number(reader, place, name, usual):
    """The number of an input, or the default if the method has no such input."""
    value = reader.get(place, name)
    return usual if value is None else constant_of(reader, place, value, name, usual)


def _name(place, name):
    return name if place.node.type == "SUBSURFACE_SCATTERING" else f"Subsurface {name}"


def _skin(reader, place, index):
    """Factors on the radii, by colour: from the dipole's exponent to the mean free path.

    Jensen et al., A practical model for subsurface light transport, SIGGRAPH 2001, with Egan and Hilgeman's ratio for
    internal reflection.
    """
    name = "Color" if place.node.type == "SUBSURFACE_SCATTERING" else "Base Color"
    value = reader.get(place, name).as_color()
    color = [0.5] * 3
    if value.special is None:
        color = value.data.reshape(-1, 3).mean(axis=0)
    inside = (0.710 - 1.440 / index) / index + 0.668 + 0.0636 * index
    exponent = (4.0 / 3.0) * (1.0 + inside) / (1.0 - inside)
    albedo = np.linspace(0.0, 1.0, 2049)
    s = np.sqrt(3.0 * (1.0 - albedo))
    sent_back = 0.5 * albedo * (1.0 + np.exp(-exponent * s)) * np.exp(-s)
    found = np.interp(np.clip(color, 1e-4, 0.995), sent_back, albedo)
    return [float(factor) for factor in np.sqrt(3.0 * (1.0 - np.minimum(found, 0.999999)))]


@lru_cache(maxsize=256)
def _fit(g, roughness, index, is_diffuse, is_skin):
    """Coefficients of c, c^2, c^3 and c^4 of what comes back for the colour c."""
    colors = np.linspace(0.02, 0.98, 25)
    back = np.array([_sent_back(color, g, roughness, index, is_diffuse, is_skin) for color in colors])
    rows = np.stack([colors**power for power in range(4)], axis=1)
    return tuple(float(number) for number in np.linalg.lstsq(rows, back / colors, rcond=None)[0])


def _sent_back(color, g, roughness, index, is_diffuse, is_skin):
    if is_diffuse:
        return color
    albedo = _albedo(color, g)
    # By similarity, an isotropic medium.
    albedo = albedo * (1.0 - g) / (1.0 - g * albedo)
    cosines, values = _entering(albedo)
    lost = _lost(albedo)
    diffuse = 1.0 - lost * 2.0 * float(np.sum(_weights() * cosines * values))
    inside = _refracted(max(roughness, 1e-3) if is_skin else max(roughness * roughness, 1e-3), index)
    refracted = 1.0 - lost * float(np.interp(inside, cosines, values).mean())
    return 0.5 * (diffuse + refracted) if is_skin else refracted


def _lost(albedo):
    """What does not come back, over H: what is absorbed, and what would return after more scatterings than Cycles
    follows.

    Without absorption the share H / sqrt(4 pi n^3) comes back after n scatterings, for large n.
    """
    x = BOUNCES * (1.0 - albedo)
    return math.sqrt(1.0 - albedo) * math.erf(math.sqrt(x)) + math.exp(-x) / math.sqrt(math.pi * BOUNCES)


def _albedo(color, g):
    """Cycles' single-scattering albedo for a colour: the fit of Wrenninge, Villemin and Hery 2017 (Path Traced
    Subsurface Scattering using Anisotropic Phase Functions and Non-Exponential Free Flights)."""
    a = _power_series(g, 1.8260523782, -1.28451056436, -1.79904629312, 9.19393289202, -22.8215585862, 32.0234874259,
                      -23.6264803333, 7.21067002658)
    b = 4.98511194385 + 0.127355959438 * np.exp(_power_series(
        g, 0.0, 31.1491581433, -201.847017512, 841.576016723, -2018.09288505, 2731.71560286, -1935.41424244,
        559.009054474))
    c = _power_series(g, 1.09686102424, -0.394704063468, 1.05258115941, -8.83963712726, 28.8643230661, -46.8802913581,
                      38.5402837518, -12.7181042538)
    d = _power_series(g, 0.496310210422, 0.360146581622, -2.15139309747, 17.8896899217, -55.2984010333, 82.065982243,
                      -58.5106008578, 15.8478295021)
    e = 4.23190299701 + 0.00310603949088 * np.exp(_power_series(
        g, 0.0, 76.7316253952, -594.356773233, 2448.8834203, -5576.68528998, 7116.60171912, -4763.54467887,
        1303.5318055))
    f = _power_series(g, 2.40602999408, -2.51814844609, 9.18494908356, -79.2191708682, 259.082868209, -403.613804597,
                      302.85712436, -87.4370473567)
    share = color**0.25
    albedo = (1.0 - share) * a * np.arctan(b * color) ** c + share * d * np.arctan(e * color) ** f
    return float(np.clip(albedo, 0.0, 0.999999))


def _power_series(x, *coefficients):
    return sum(coefficient * x**power for power, coefficient in enumerate(coefficients))


def _nodes():
    return 0.5 * (np.polynomial.legendre.leggauss(32)[0] + 1.0)


def _weights():
    return 0.5 * np.polynomial.legendre.leggauss(32)[1]


def _entering(albedo):
    """(cosines, H): Chandrasekhar's function of a half-space, such that 1 - sqrt(1 - albedo) H(cos) of the light
    entering at an angle comes out again (Radiative Transfer, 1960, section 38)."""
    cosines, weights = _nodes(), _weights()
    values = np.ones_like(cosines)
    kernel = cosines[None, :] / (cosines[:, None] + cosines[None, :])
    for _ in range(200):
        values = 1.0 / (np.sqrt(1.0 - albedo) + 0.5 * albedo * (kernel * (weights * values)[None, :]).sum(axis=1))
    return cosines, values


@lru_cache(maxsize=64)
def _refracted(alpha, index):
    """Cosines of light from all directions after refraction by microfacets."""
    view, facet = facets_towards(alpha)
    between = sum(one * other for one, other in zip(view, facet))
    inside = np.sqrt(np.maximum(1.0 - (1.0 - between**2) / index**2, 0.0))
    cosines = view[2] / index + (inside - between / index) * facet[2]
    return np.clip(cosines, 0.0, 1.0)


def is_beneath(table, others):
    """Whether a material or one of its parts has a medium below it."""
    if table is None:
        return False
    return "subsurface" in table or any(is_beneath(others[name], others) for name in table.get("materials", ()))


def is_in(bsdf):
    """The same for the fields of a material as they are read."""
    return bsdf is not None and ("subsurface" in bsdf or any(is_in(part) for part in bsdf.get("materials", ())))


def without(bsdf):
    """The same material without a medium below."""
    kept = {name: value for name, value in bsdf.items() if not name.startswith("subsurface")}
    if "materials" in kept:
        kept["materials"] = [without(part) for part in kept["materials"]]
    elif kept != bsdf:
        kept["two_sided"] = True
    return kept


def node(reader, place):
    """Fields of a material for a Subsurface Scattering node."""
    color = reader.get(place, "Color")
    interface = _number(reader, place, "IOR", 1.4), _number(reader, place, "Roughness", 1.0)
    found = beneath(reader, place, place.node.falloff, interface)
    if found is None:
        return {"type": "diffuse", "reflectance": color, "two_sided": True}
    dimmed, fields = found
    plain = {"type": "principled", "base_color": dimmed(color), "roughness": constant(1.0), "specular": constant(0.0)}
    return plain | {"subsurface": constant(1.0)} | fields
