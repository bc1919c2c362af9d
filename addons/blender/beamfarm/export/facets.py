"""Microfacets seen from all directions: E. Heitz, Sampling the GGX distribution of visible normals, JCGT 7(4), 2018."""

import numpy as np

STEPS = 24


def _middles(count=STEPS):
    return (np.arange(count) + 0.5) / count


def facets_towards(alpha):
    """(directions, visible normals of GGX microfacets seen from there), components along the first axis; directions are
    distributed as for even light."""
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
