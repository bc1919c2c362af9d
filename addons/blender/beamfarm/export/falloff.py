"""Soft falloff of points and spots with a radius: Cycles' discs that always face what they light.

At a distance d of a lamp of radius r there is 1 / (d^2 + r^2) of its intensity, in the place of 1 / d^2. No lamp that
shines alike on everything does so; what it gives in all to what is around it can be the same.
"""

import math

from mathutils import Vector

RAYS = 256
# Above it nothing is changed; below, so much is off near and far that the list says so. What lets light through, as
# bulbs and shades do, is looked through.
ALMOST_ALL, MOST = 0.99, 0.8


def share(placed, light, context, half_angle=math.pi):
    """Share of a light's power that comes to what it shines on within an angle of its axis; told, where it is not all.
    """
    if placed.key not in context.dimmed:
        context.dimmed[placed.key] = _share(placed, light, context, half_angle)
    return context.dimmed[placed.key]


def _share(placed, light, context, half_angle):
    radius = light.shadow_soft_size
    if radius <= 0.0:
        return 1.0
    reached = list(_distances(placed, context, half_angle))
    nearest = min((first for first, _ in reached), default=math.inf)
    if nearest <= radius:
        context.report.leave_out(f"the light of '{light.name}' on what is nearer to it than its radius of {radius:.3g}")
    if not light.use_soft_falloff:
        return 1.0
    kind = light.type.lower()
    context.report.note(f"{kind} lights with a radius shine as balls, as they do in Blender without soft falloff")
    found = [_softened(radius, distance) for _, distance in reached if distance is not None]
    mean = sum(found) / len(found) if found else 1.0
    close = _softened(radius, nearest)
    if mean < MOST:
        context.report.leave_out(f"the soft falloff of light '{light.name}': dimmed to {100.0 * mean:.0f} %, it is "
                                 "still too bright near the light, and too dark far from it")
    elif close < MOST * mean and nearest > radius:
        context.report.leave_out(f"the soft falloff of light '{light.name}': what is {nearest:.3g} from it gets "
                                 f"{mean / close:.2g} times its light")
    elif mean <= ALMOST_ALL:
        near, far = 100.0 * min(found), 100.0 * max(found)
        context.report.note(f"light '{light.name}': soft falloff dims it to {100.0 * mean:.0f} % everywhere, not to "
                            f"{near:.0f} % of it near the light and {far:.0f} % far from it")
    return 1.0 if mean > ALMOST_ALL else mean


def _softened(radius, distance):
    return 1.0 / (1.0 + (radius / distance) ** 2)


def _distances(placed, context, half_angle):
    """In directions that are spread evenly, how far the first thing is, and the first one behind which there is no
    light: None where there is none."""
    origin, turn = placed.matrix.translation, placed.matrix.to_3x3().normalized()
    radius = placed.object.data.shadow_soft_size
    lowest = math.cos(half_angle)
    for i in range(RAYS):
        z = 1.0 - (1.0 - lowest) * (i + 0.5) / RAYS
        level, around = math.sqrt(max(1.0 - z * z, 0.0)), i * math.pi * (3.0 - math.sqrt(5.0))
        direction = turn @ Vector((level * math.cos(around), level * math.sin(around), -z))
        met = list(_met(origin, direction, radius, context))
        if met:
            yield met[0][0], next((distance for distance, ends in met if ends), None)


def _met(origin, direction, radius, context):
    """(distance, whether it ends there) of what light meets. It goes through what is clear, and past what is nearer
    than its radius: the disc is wider."""
    scene, depsgraph = context.depsgraph.scene, context.depsgraph
    start = origin
    for _ in range(SURFACES):
        is_hit, place, _, index, object, _ = scene.ray_cast(depsgraph, start, direction)
        if not is_hit:
            return
        distance = max((place - origin).length, 1e-6)
        ends = distance > radius and not _lets_through(object.evaluated_get(depsgraph), index)
        yield distance, ends
        if ends:
            return
        start = place + direction * max(1e-5, 1e-5 * distance)


# So many surfaces are looked through.
SURFACES = 16
CLEAR = {"BSDF_GLASS", "BSDF_REFRACTION", "BSDF_TRANSPARENT", "BSDF_TRANSLUCENT"}


def _lets_through(object, index):
    """Whether light may go on behind the polygon of an object, by what nodes its material has."""
    polygons = getattr(object.data, "polygons", ())
    slot = polygons[index].material_index if 0 <= index < len(polygons) else 0
    if slot >= len(object.material_slots):
        return False
    material = object.material_slots[slot].material
    if material is None or not material.use_nodes or material.node_tree is None:
        return False
    return any(_is_clear(node) for node in material.node_tree.nodes)


def _is_clear(node):
    if node.type == "GROUP":
        return node.node_tree is not None and any(_is_clear(inner) for inner in node.node_tree.nodes)
    if node.type != "BSDF_PRINCIPLED":
        return node.type in CLEAR
    clear = node.inputs.get("Transmission Weight") or node.inputs.get("Transmission")
    alpha = node.inputs["Alpha"]
    return clear.is_linked or clear.default_value > 0.0 or alpha.is_linked or alpha.default_value < 1.0
