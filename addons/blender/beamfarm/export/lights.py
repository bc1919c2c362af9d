"""Light objects as `[[lights]]`, or as shapes that emit.

Blender's watts are those of a source that shines to all sides: a point or spot of P watts has an intensity of
P / (4 pi) W/sr, whatever the spot's cone cuts off; an area light of P watts has P / (pi A) W/(m^2 sr); a sun's strength
is in W/m^2.
"""

import math

import numpy as np
from mathutils import Matrix, Vector

from .animated import is_animated
from .graph import Place, output_node
from .nodes import Reader
from .transforms import matrix_step
from .visibility import light_rays

# Lights of the scene file fall off linearly in angle: so many stand for the smooth edge of one of Blender's spots.
SPOT_STEPS = 10


def add_light(placed, context):
    """Adds what a light object at its place is in the scene file."""
    object = placed.object
    light = object.data
    if light.type == "AREA" and getattr(getattr(light, "cycles", None), "is_portal", False):
        # It tells Cycles where the world's light comes in, and gives none itself.
        return
    color = _color(light, context)
    if not any(color) and not (context.motion is not None and is_animated(light)):
        return
    name = context.names.get(("object", placed.key), object.name)
    context.show(placed, name)
    fields = {"name": name}
    visible = light_rays(object, context)
    if visible is not None:
        fields["visible"] = visible
    if not light.use_shadow:
        context.report.leave_out(f"'{light.name}' without shadows: it has them")
    for factor, what in (("diffuse_factor", "diffuse"), ("specular_factor", "specular"), ("volume_factor", "volume")):
        if getattr(light, factor, 1.0) != 1.0:
            context.report.note(f"light '{light.name}': its {what} factor does not count, as in Cycles")
    ADD[light.type](placed, light, color, fields, context)


def _color(light, context):
    """Strength of a light times its colour and what its nodes make of it."""
    color = [float(number) * light.energy for number in light.color]
    exposure = getattr(light, "exposure", 0.0)
    if exposure:
        color = [number * 2.0**exposure for number in color]
    if getattr(light, "use_temperature", False):
        color = [a * float(b) for a, b in zip(color, light.temperature_color)]
    if light.use_nodes and light.node_tree is not None:
        color = [a * b for a, b in zip(color, _from_nodes(light, context))]
    if min(color) < 0.0:
        context.report.leave_out(f"what light '{light.name}' takes away: its strength is below 0")
    return [max(number, 0.0) for number in color]


def _from_nodes(light, context):
    from .graph import follow

    owner = f"light '{light.name}'"
    output = output_node(light.node_tree, "ShaderNodeOutputLight")
    if output is None or not output.inputs["Surface"].is_linked:
        return [0.0, 0.0, 0.0]
    reader = Reader(context, owner)
    found = follow(Place(output.inputs["Surface"]))
    if found is None or found.node.type != "EMISSION" or found.node.mute:
        if found is not None:
            reader.lack(found.node)
        return [1.0, 1.0, 1.0]
    color, strength = reader.get(found, "Color"), reader.get(found, "Strength")
    for value, name in ((color, "color"), (strength, "strength")):
        if not value.is_constant:
            reader.lack(found.node, f"{name} by texture")
    shown = color.color() if color.is_constant else [1.0, 1.0, 1.0]
    factor = strength.number() if strength.is_constant else 1.0
    return [factor * number for number in shown]


def _is_normalized(light):
    return getattr(light, "normalize", True)


def _forward(matrix):
    """Unit vector along which a light with a direction shines."""
    return (matrix.to_3x3() @ Vector((0.0, 0.0, -1.0))).normalized()


def _list(vector):
    return [float(number) for number in vector]


# Lamps in Cycles let all light through: so do those of the scene file that have a surface.
LAMP = "lamp"


def _lamp(placed, fields, shape, color, context):
    """Adds a shape that emits and is nothing else; `color` is its power."""
    material = context.material_names.get(("lamp",), LAMP)
    context.materials[material] = {"type": "null"}
    shape = {"name": fields["name"]} | shape | {"material": material, "emission": {"power": color}}
    if "visible" in fields:
        shape["visible"] = fields["visible"]
    context.add_shape(placed, shape)


def _point(placed, light, color, fields, context):
    position, radius = placed.matrix.translation, light.shadow_soft_size
    if radius == 0.0:
        intensity = [number / (4.0 * math.pi) for number in color]
        context.add_light(placed, fields | {"type": "point", "position": _list(position), "intensity": intensity})
        return
    if not _is_normalized(light):
        color = [number * 4.0 * math.pi * radius * radius for number in color]
    if light.use_soft_falloff:
        context.report.note("point lights with a radius shine as balls, as they do in Blender without soft falloff")
    _lamp(placed, fields, {"type": "sphere", "center": _list(position), "radius": float(radius)}, color, context)


def _spot(placed, light, color, fields, context):
    position = placed.matrix.translation
    radius = light.shadow_soft_size
    if radius > 0.0:
        if not _is_normalized(light):
            color = [number * 4.0 * math.pi * radius * radius for number in color]
    scale = placed.matrix.to_scale()
    if abs(scale.x - scale.y) > 1e-4 * abs(scale.x) or abs(scale.x - scale.z) > 1e-4 * abs(scale.x):
        context.report.note(f"light '{light.name}': its cone is round, whatever its scale")
    if light.use_square:
        context.report.leave_out(f"the square cone of light '{light.name}': it is round")
    forward, turn = _forward(placed.matrix), placed.matrix.to_3x3().normalized()
    fields = fields | {"group": fields["name"], "type": "spot"}
    # Many spots of no size stand for one with a size, as they do for suns.
    places = disc_of(SPOTS) if radius > 0.0 else [(0.0, 0.0)]
    steps = spot_steps(light.spot_size / 2.0, light.spot_blend)
    for x, y in places:
        origin = position + turn @ Vector((radius * x, radius * y, 0.0))
        stands = {"position": _list(origin), "target": _list(origin + forward)}
        for inner, outer, share in steps:
            intensity = [number * share / (4.0 * math.pi * len(places)) for number in color]
            angles = {"cutoff_angle": math.degrees(outer), "beam_width": math.degrees(inner)}
            context.add_light(placed, fields | stands | {"intensity": intensity} | angles)


def spot_steps(half, blend):
    """(full up to, none from, share) of cones whose sum is nearest to the edge of a spot of Blender's.

    Its intensity is smoothstep(x) of the axis' with x = (cos theta - cos half) / ((1 - cos half) blend). The sum is a
    line between angles at even distances; its values there are those of the least squared error over the sphere.
    """
    half = min(half, 0.5 * math.pi * 0.9999)
    width = (1.0 - math.cos(half)) * blend
    if width < 1e-5:
        return [(half * (1.0 - 1e-4), half, 1.0)]
    knots = np.linspace(math.acos(min(math.cos(half) + width, 1.0)), half, SPOT_STEPS + 1)
    angles = np.linspace(knots[0], knots[-1], 1001)
    x = np.clip((np.cos(angles) - math.cos(half)) / width, 0.0, 1.0)
    weight = np.sqrt(np.sin(angles) + 1e-6)
    lines = np.stack([np.interp(angles, knots, row) for row in np.eye(SPOT_STEPS + 1)], axis=1)
    # At the ends the values are 1 and 0.
    inner = lines[:, 1:-1] * weight[:, None]
    wanted = (x * x * (3.0 - 2.0 * x) - lines[:, 0]) * weight
    values = [1.0, *np.linalg.lstsq(inner, wanted, rcond=None)[0], 0.0]
    values = np.minimum.accumulate(np.clip(values, 0.0, 1.0))
    steps = zip(knots, knots[1:], values, values[1:])
    return [(float(low), float(high), float(a - b)) for low, high, a, b in steps if a > b]


def _sun(placed, light, color, fields, context):
    if not _is_normalized(light) and light.angle > 0.0:
        color = [number * math.pi * math.sin(light.angle / 2.0) ** 2 for number in color]
    if context.world_medium is not None:
        context.report.leave_out(f"light '{light.name}': no light of a sun gets through a world full of a medium")
        return
    fields = fields | {"group": fields["name"], "type": "directional"}
    places = disc_of(SUNS) if light.angle > WIDE else [(0.0, 0.0)]
    if light.angle > 0.0 and len(places) == 1:
        context.report.note(f"light '{light.name}': its angle counts as 0, its shadows are sharp")
    turn = placed.matrix.to_3x3().normalized()
    # Of even radiance in its cone, so that what faces its middle has the irradiance that is given.
    cap = 1.0 - math.cos(light.angle / 2.0) if len(places) > 1 else 0.0
    irradiance = [number / len(places) * 2.0 / (2.0 - cap) for number in color]
    for x, y in places:
        # Even on the disc, even by the cosine.
        down = 1.0 - cap * (x * x + y * y)
        around = math.sqrt((1.0 + down) * cap)
        direction = (turn @ Vector((around * x, around * y, -down))).normalized()
        context.add_light(placed, fields | {"direction": _list(direction), "irradiance": irradiance})


SPOTS = 16
# As many suns stand for one that is wider than this angle: its shadows have as many steps.
SUNS, WIDE = 32, math.radians(0.6)
GOLDEN = math.pi * (3.0 - math.sqrt(5.0))


def disc_of(count):
    """So many points that fill the unit disc evenly."""
    return [(math.sqrt((k + 0.5) / count) * math.cos(k * GOLDEN), math.sqrt((k + 0.5) / count) * math.sin(k * GOLDEN))
            for k in range(count)]


def _area(placed, light, color, fields, context):
    if light.spread < math.pi * 0.9999:
        context.report.leave_out(f"the spread of light '{light.name}': it shines to all of its side")
    height = light.size_y if light.shape in ("RECTANGLE", "ELLIPSE") else light.size
    is_round = light.shape in ("DISK", "ELLIPSE")
    sides = Matrix.Diagonal((light.size / 2.0, -height / 2.0, -1.0, 1.0))
    matrix = placed.matrix @ sides
    columns = [matrix.to_3x3().col[i] for i in (0, 1)]
    area = columns[0].cross(columns[1]).length * (math.pi if is_round else 4.0)
    if area == 0.0:
        context.report.leave_out(f"light '{light.name}', which has no area")
        return
    if not _is_normalized(light):
        color = [number * area for number in color]
    shape = {"type": "disc" if is_round else "rectangle", "transform": [matrix_step(matrix)]}
    _lamp(placed, fields, shape, color, context)


ADD = {"POINT": _point, "SPOT": _spot, "SUN": _sun, "AREA": _area}
