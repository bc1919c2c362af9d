"""Soft falloff of points and spots with a radius: Cycles' discs that always face what they light.

At a distance d from a lamp of radius r they give 1 / (d^2 + r^2) of its intensity, instead of 1 / d^2. Far away this
equals the light of a ball, which costs less to render.
"""

import math

from mathutils import Vector

RAYS = 256
# A lamp is exported as a ball if everything around it keeps at least this share of its light.
ALMOST_ALL = 0.99


def add_falloff(placed, light, table, context, half_angle=math.pi):
    """Adds the falloff to the table of a light with a radius."""
    radius = light.shadow_soft_size
    if radius <= 0.0:
        return
    if placed.key not in context.nearest:
        context.nearest[placed.key] = _nearest(placed, context, half_angle)
    nearest = context.nearest[placed.key]
    if not light.use_soft_falloff:
        if nearest <= radius:
            context.report.leave_out(
                f"the light of '{light.name}' on what is within its radius of {radius:.3g}")
    elif 1.0 / (1.0 + (radius / nearest) ** 2) < ALMOST_ALL:
        table["soft_falloff"] = True
    else:
        context.soft.append(table)


def soften_in_media(context):
    """A lamp in a medium lights everything around it, so its falloff shows."""
    for table in context.soft:
        table["soft_falloff"] = True


def _nearest(placed, context, half_angle):
    """Distance of the nearest object over even directions within an angle of a light's axis."""
    scene, depsgraph = context.depsgraph.scene, context.depsgraph
    origin, turn = placed.matrix.translation, placed.matrix.to_3x3().normalized()
    lowest, nearest = math.cos(half_angle), math.inf
    for i in range(RAYS):
        z = 1.0 - (1.0 - lowest) * (i + 0.5) / RAYS
        level, around = math.sqrt(max(1.0 - z * z, 0.0)), i * math.pi * (3.0 - math.sqrt(5.0))
        direction = turn @ Vector((level * math.cos(around), level * math.sin(around), -z))
        is_hit, place, *_ = scene.ray_cast(depsgraph, origin, direction)
        if is_hit:
            nearest = min(nearest, max((place - origin).length, 1e-6))
    return nearest
