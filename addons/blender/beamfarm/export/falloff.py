"""Soft falloff of points and spots with a radius: Cycles' discs that always face what they light.

At a distance d of a lamp of radius r there is 1 / (d^2 + r^2) of its intensity, in the place of 1 / d^2. No lamp that
shines alike on everything does so; what it gives in all to what is around it can be the same.
"""

import math

from mathutils import Vector

RAYS = 256
# Above it nothing is changed; below, so much is off near and far that the list says so.
ALMOST_ALL, MOST = 0.99, 0.8


def share(placed, light, context, half_angle=math.pi):
    """Share of a light's power that comes to what it shines on within an angle of its axis; told, where it is not all.
    """
    if placed.key not in context.dimmed:
        context.dimmed[placed.key] = _share(placed, light, context, half_angle)
    return context.dimmed[placed.key]


def _share(placed, light, context, half_angle):
    radius = light.shadow_soft_size
    if not light.use_soft_falloff or radius <= 0.0:
        return 1.0
    kind = light.type.lower()
    context.report.note(f"{kind} lights with a radius shine as balls, as they do in Blender without soft falloff")
    found = [1.0 / (1.0 + (radius / distance) ** 2) for distance in _distances(placed, context, half_angle)]
    mean = sum(found) / len(found) if found else 1.0
    if mean > ALMOST_ALL:
        return 1.0
    if mean < MOST:
        context.report.leave_out(f"the soft falloff of light '{light.name}': dimmed to {100.0 * mean:.0f} %, it is "
                                 "still too bright near the light, and too dark far from it")
    else:
        near, far = 100.0 * min(found), 100.0 * max(found)
        context.report.note(f"light '{light.name}': soft falloff dims it to {100.0 * mean:.0f} % everywhere, not to "
                            f"{near:.0f} % of it near the light and {far:.0f} % far from it")
    return mean


def _distances(placed, context, half_angle):
    """How far what it shines on is in directions that are spread evenly."""
    origin, turn = placed.matrix.translation, placed.matrix.to_3x3().normalized()
    scene, depsgraph = context.depsgraph.scene, context.depsgraph
    lowest = math.cos(half_angle)
    for i in range(RAYS):
        z = 1.0 - (1.0 - lowest) * (i + 0.5) / RAYS
        level, around = math.sqrt(max(1.0 - z * z, 0.0)), i * math.pi * (3.0 - math.sqrt(5.0))
        direction = turn @ Vector((level * math.cos(around), level * math.sin(around), -z))
        is_hit, place, *_ = scene.ray_cast(depsgraph, origin, direction)
        if is_hit:
            yield max((place - origin).length, 1e-6)
