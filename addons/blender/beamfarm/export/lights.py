"""Light objects as `[[lights]]`, or as shapes that emit.

Blender's watts are those of a source that shines to all sides: a point or spot of P watts has an intensity of P / (4
pi) W/sr, whatever the spot's cone cuts off; an area light of P watts has a radiance of P / (pi A) W/(m^2 sr); a sun's
strength is in W/m^2.
"""

import math

import bpy
from mathutils import Matrix, Vector

from .animated import is_animated
from .falloff import add_falloff
from .graph import Place, follow, output_node
from .names import file_name
from .nodes import Reader
from .transforms import matrix_step
from .values import NotShown
from .visibility import light_rays

# From this spread on an area light shines into the whole hemisphere.
WHOLE = math.pi * 0.9999

# Largest angle of a sun in the scene file, degrees; Blender's may be a hemisphere.
WIDEST = 179.9


def add_light(placed, context):
    """Adds a light object at its place to the scene file."""
    object = placed.object
    light = object.data
    if light.type == "AREA" and getattr(getattr(light, "cycles", None), "is_portal", False):
        # It shows Cycles where the world's light enters, and emits nothing itself.
        return
    color, ies = _color(light, context)
    if not any(color) and not (context.motion is not None and is_animated(light)):
        return
    name = context.names.get(("object", placed.key), object.name)
    context.show(placed, name)
    fields = {"name": name}
    visible = light_rays(object, context)
    if visible is not None:
        fields["visible"] = visible
    if not light.use_shadow:
        context.without_shadows.append(name)
    for factor, what in (("diffuse_factor", "diffuse"), ("specular_factor", "specular"), ("volume_factor", "volume")):
        if getattr(light, factor, 1.0) != 1.0:
            context.report.note(f"light '{light.name}': its {what} factor is ignored, as in Cycles")
    if ies is not None:
        if light.type not in ("POINT", "SPOT"):
            context.report.leave_out(f"the IES file of light '{light.name}': {light.type.lower()} lights have none")
        else:
            _by_file(placed, light, color, fields, ies, context)
            return
    ADD[light.type](placed, light, color, fields, context)


def _color(light, context):
    """(strength of a light times its colour and the result of its nodes, content of an IES file or None)."""
    ies = None
    color = [float(number) * light.energy for number in light.color]
    exposure = getattr(light, "exposure", 0.0)
    if exposure:
        color = [number * 2.0**exposure for number in color]
    if getattr(light, "use_temperature", False):
        color = [a * float(b) for a, b in zip(color, light.temperature_color)]
    if light.use_nodes and light.node_tree is not None:
        factors, ies = _from_nodes(light, context)
        color = [a * b for a, b in zip(color, factors)]
    if min(color) < 0.0:
        context.report.leave_out(f"light '{light.name}', whose strength is below 0")
    return [max(number, 0.0) for number in color], ies


class LightReader(Reader):
    """Reads the nodes of a light."""

    def _of(self, place):
        if place.node.type != "LIGHT_FALLOFF":
            return super()._of(place)
        smooth = self.get(place, "Smooth")
        if place.socket.name != "Quadratic":
            raise NotShown(f"a falloff that is {place.socket.name.lower()}")
        if not smooth.is_constant or smooth.number() != 0.0:
            self.context.report.note(f"{self.owner}: its smooth falloff is ignored: it is brighter close by")
        return self.get(place, "Strength")


def _from_nodes(light, context):
    owner = f"light '{light.name}'"
    output = output_node(light.node_tree, "ShaderNodeOutputLight")
    if output is None or not output.inputs["Surface"].is_linked:
        return [0.0, 0.0, 0.0], None
    reader = LightReader(context, owner)
    found = follow(Place(output.inputs["Surface"]))
    if found is None or found.node.type != "EMISSION" or found.node.mute:
        if found is not None:
            reader.lack(found.node)
        return [1.0, 1.0, 1.0], None
    place = found.input("Strength")
    table = follow(place) if place is not None else None
    if table is not None and table.node.type == "TEX_IES" and not table.node.mute:
        color, strength = reader.get(found, "Color"), reader.get(table, "Strength")
        ies = _ies(table.node, owner, context)
        if table.node.inputs["Vector"].is_linked:
            context.report.leave_out(f"the vector of the IES texture of {owner}: it follows the light's orientation")
    else:
        color, strength, ies = reader.get(found, "Color"), reader.get(found, "Strength"), None
    for value, name in ((color, "color"), (strength, "strength")):
        if not value.is_constant:
            reader.lack(found.node, f"{name} by texture")
    shown = color.color() if color.is_constant else [1.0, 1.0, 1.0]
    factor = strength.number() if strength.is_constant else 1.0
    return [factor * number for number in shown], ies


def _ies(node, owner, context):
    """Content of the file of an IES texture; None, with a line in the report, if it has none."""
    if node.mode == "INTERNAL":
        if node.ies is not None:
            return node.ies.as_string().encode("utf-8", "replace")
        context.report.leave_out(f"the IES texture of {owner}, which has no text")
        return None
    path = bpy.path.abspath(node.filepath, library=node.id_data.library)
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError:
        context.report.leave_out(f"the IES texture of {owner}: there is no file '{path}'")
        return None


# Lumens per watt: Cycles' value for candela, and the scene file's.
CYCLES_LUMENS, LUMENS = 177.83, 683.0


def _by_file(placed, light, color, fields, ies, context):
    """Adds a point or a spot with the intensity of an IES file. For one candela Cycles' texture gives 4 pi / 177.83,
    which multiplies the light's P / (4 pi) W/sr."""
    if light.shadow_soft_size > 0.0:
        context.report.note(f"light '{light.name}': with an IES texture it shines from a point")
    position, turn = placed.matrix.translation, placed.matrix.to_3x3()
    fields = fields | {
        "type": light.type.lower(),
        "position": _list(position),
        "target": _list(position + _forward(placed.matrix)),
        "up": _list((turn @ Vector((0.0, -1.0, 0.0))).normalized()),
        "ies": context.files.put("lights", file_name(light.name), ".ies", ies),
        "scale": [number * LUMENS / CYCLES_LUMENS for number in color],
    }
    if light.type == "SPOT":
        full, none = spot_angles(light.spot_size / 2.0, light.spot_blend)
        cone = {"cutoff_angle": math.degrees(none), "beam_width": math.degrees(full), "falloff": "smooth"}
        context.add_light(placed, fields | cone)
    else:
        context.add_light(placed, fields)


def _is_normalized(light):
    return getattr(light, "normalize", True)


def _forward(matrix):
    """Unit vector along which a light with a direction shines."""
    return (matrix.to_3x3() @ Vector((0.0, 0.0, -1.0))).normalized()


def _list(vector):
    return [float(number) for number in vector]


# Lamps in Cycles let all light pass, and so do the scene file's lamps with a surface.
LAMP = "lamp"


def _lamp(placed, fields, shape, color, context, spread=math.pi):
    """Adds a shape that only emits; `color` is its power, `spread` the full angle of its cone. Returns the table of its
    emission."""
    material = context.material_names.get(("lamp",), LAMP)
    context.materials[material] = {"type": "null"}
    emission = {"power": color}
    if spread < WHOLE:
        # Cycles has the same minimum.
        emission["spread"] = max(math.degrees(spread), 1.0)
    shape = {"name": fields["name"]} | shape | {"material": material, "emission": emission}
    if "visible" in fields:
        shape["visible"] = fields["visible"]
    context.add_shape(placed, shape)
    return emission


def _point(placed, light, color, fields, context):
    position, radius = placed.matrix.translation, light.shadow_soft_size
    if radius == 0.0:
        intensity = [number / (4.0 * math.pi) for number in color]
        context.add_light(placed, fields | {"type": "point", "position": _list(position), "intensity": intensity})
        return
    if not _is_normalized(light):
        color = [number * 4.0 * math.pi * radius * radius for number in color]
    shape = {"type": "sphere", "center": _list(position), "radius": float(radius)}
    add_falloff(placed, light, _lamp(placed, fields, shape, color, context), context)


def _spot(placed, light, color, fields, context):
    position = placed.matrix.translation
    radius = light.shadow_soft_size
    if radius > 0.0 and not _is_normalized(light):
        color = [number * 4.0 * math.pi * radius * radius for number in color]
    scale = placed.matrix.to_scale()
    if abs(scale.x - scale.y) > 1e-4 * abs(scale.x) or abs(scale.x - scale.z) > 1e-4 * abs(scale.x):
        context.report.note(f"light '{light.name}': its cone is round, whatever its scale")
    if light.use_square:
        context.report.leave_out(f"the square cone of light '{light.name}': it is round")
    full, none = spot_angles(light.spot_size / 2.0, light.spot_blend)
    fields = fields | {
        "type": "spot",
        "position": _list(position),
        "target": _list(position + _forward(placed.matrix)),
        "intensity": [number / (4.0 * math.pi) for number in color],
        "radius": float(radius),
        "cutoff_angle": math.degrees(none),
        "beam_width": math.degrees(full),
        "falloff": "smooth",
    }
    add_falloff(placed, light, fields, context, light.spot_size / 2.0)
    context.add_light(placed, fields)


def spot_angles(half, blend):
    """(full up to, none from) for Blender's spot: its intensity is the axis' times smoothstep(x) with x = (cos theta -
    cos half) / ((1 - cos half) blend)."""
    half = min(half, 0.5 * math.pi * 0.9999)
    width = (1.0 - math.cos(half)) * blend
    return min(math.acos(min(math.cos(half) + width, 1.0)), half * (1.0 - 1e-4)), half


def _sun(placed, light, color, fields, context):
    if not _is_normalized(light) and light.angle > 0.0:
        color = [number * math.pi * math.sin(light.angle / 2.0) ** 2 for number in color]
    if context.world_medium is not None:
        context.report.leave_out(f"light '{light.name}': no sunlight gets through a world filled with a medium")
        return
    context.add_light(placed, fields | {
        "type": "directional",
        "direction": _list(_forward(placed.matrix)),
        "irradiance": color,
        "angle": min(math.degrees(light.angle), WIDEST),
    })


def _area(placed, light, color, fields, context):
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
    _lamp(placed, fields, shape, color, context, light.spread)


ADD = {"POINT": _point, "SPOT": _spot, "SUN": _sun, "AREA": _area}
