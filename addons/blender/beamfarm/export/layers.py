"""How bright the base of a Principled BSDF is below its specular layer.

Cycles dims a Lambertian base by what the layer reflects towards the viewer; the scene file's base is Burley's, which is
not dimmed, but sends more or less back by its roughness. What follows makes the two alike on average over all
directions, so that what light does after many bounces is right.
"""

from functools import lru_cache

import numpy as np

STEPS = 24


@lru_cache(maxsize=256)
def dimming(roughness, normal):
    """Factor for the base colour. `normal`: what the specular layer reflects head-on."""
    return (1.0 - _reflected(max(roughness * roughness, 1e-3), normal)) / _burley(roughness)


def _middles(count=STEPS):
    return (np.arange(count) + 0.5) / count


def _burley(roughness):
    """Share of even light from all sides that Burley's diffuse lobe of reflectance 1 sends back.

    B. Burley, Extending the Disney BRDF to a BSDF with integrated subsurface scattering, SIGGRAPH 2015 course notes.
    """
    # Even in cos^2: both directions as light from all sides counts.
    cos_i, cos_o = np.sqrt(_middles())[:, None, None], np.sqrt(_middles())[None, :, None]
    turn = np.cos(np.pi * _middles())[None, None, :]
    sines = np.sqrt((1.0 - cos_i**2) * (1.0 - cos_o**2))
    # cos^2 of half the angle between the two.
    half = 0.5 * (1.0 + cos_i * cos_o + sines * turn)
    from_i, from_o, back = (1.0 - cos_i) ** 5, (1.0 - cos_o) ** 5, 2.0 * roughness * half
    lobe = (1.0 - 0.5 * from_i) * (1.0 - 0.5 * from_o)
    return float((lobe + back * (from_i + from_o + from_i * from_o * (back - 1.0))).mean())


def _reflected(alpha, normal):
    """Share of even light that GGX microfacets of a dielectric reflect: the mean of F G2 / G1 of visible normals.

    E. Heitz, Sampling the GGX distribution of visible normals, JCGT 7(4), 2018.
    """
    view, facet = facets_towards(alpha)
    cos = view[2]
    between = view[0] * facet[0] + view[2] * facet[2]
    light_z = 2.0 * between * facet[2] - view[2]

    def hidden(z):
        z = np.clip(z, 1e-6, 1.0)
        return 0.5 * (np.sqrt(1.0 + alpha**2 * (1.0 - z**2) / z**2) - 1.0)

    seen = (1.0 + hidden(cos)) / (1.0 + hidden(cos) + hidden(light_z))
    reflected = np.where(light_z > 0.0, _fresnel(between, normal) * seen, 0.0)
    return float(reflected.mean())


def facets_towards(alpha):
    """(directions, visible normals of GGX microfacets seen from there), components along the first axis; directions as
    light from all sides comes."""
    cos = np.sqrt(_middles())[:, None, None]
    u, v = _middles()[None, :, None], _middles()[None, None, :]
    view = [np.sqrt(1.0 - cos**2), np.zeros_like(cos), cos]
    stretched = [alpha * view[0], view[1], view[2]]
    length = np.sqrt(stretched[0] ** 2 + stretched[2] ** 2)
    x, z = stretched[0] / length, stretched[2] / length
    radius, angle = np.sqrt(u), 2.0 * np.pi * v
    first, second = radius * np.cos(angle), radius * np.sin(angle)
    share = 0.5 * (1.0 + z)
    second = (1.0 - share) * np.sqrt(np.maximum(1.0 - first**2, 0.0)) + share * second
    third = np.sqrt(np.maximum(1.0 - first**2 - second**2, 0.0))
    # The axes across (x, 0, z) are (0, 1, 0) and (-z, 0, x).
    facet = [alpha * (x * third - z * second), alpha * first, np.maximum(z * third + x * second, 0.0)]
    norm = np.sqrt(sum(part**2 for part in facet))
    return view, [part / norm for part in facet]


def _fresnel(cos, normal):
    root = min(max(normal, 0.0), 0.9) ** 0.5
    index = (1.0 + root) / (1.0 - root)
    cos = np.clip(cos, 0.0, 1.0)
    inside = np.sqrt(np.maximum(index * index - 1.0 + cos * cos, 0.0))
    across, along = (cos - inside) / (cos + inside), (inside - index**2 * cos) / (inside + index**2 * cos)
    return 0.5 * (across**2 + along**2)
