"""Blender's nodes as nodes of texture graphs, for what is neither constant nor one image."""

import math

import bpy
import numpy as np

from . import by_normal
from .arithmetic import Node, is_graph
from .graph import Place, follow
from .nodes import picture
from .values import NotShown, Value, constant

ZERO, ONE = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
GREY, DARK = (0.8, 0.8, 0.8), (0.2, 0.2, 0.2)


def made(reader, place, kind, fields, output=None, is_inline=False, uv_map=None):
    """`Value` for an output of a node that stands for Blender's. `is_inline`: written where it is used."""
    names = tuple(group.name for group in place.groups) + (place.node.name,)
    parts = () if is_inline else (reader.scope, *names)
    node = Node(kind, fields, parts, (reader.owner, *names), uv_map)
    is_number = place.socket.type in ("VALUE", "INT", "BOOLEAN")
    return node.output(output, 1 if is_number else 3, place.socket.type == "VECTOR")


def word(text):
    return text.lower()


def taken(reader, place, names):
    """Inputs of a node that differ from the scene file's defaults: {field: (Blender's name or index, default)}."""
    fields = {}
    for name, (socket, default) in names.items():
        at = _input(place, socket)
        if at is None:
            continue
        value = reader.value(at)
        if value.is_constant and default is not None:
            numbers = value.color() if isinstance(default, tuple) else value.number()
            if np.allclose(numbers, default, rtol=1e-7, atol=0.0):
                continue
        fields[name] = value
    return fields


def _input(place, socket):
    if isinstance(socket, str):
        return place.input(socket)
    found = place.node.inputs[socket]
    return Place(found, place.groups) if found.enabled else None


def coordinates(reader, place, of, uv_map=None):
    return made(reader, place, "coordinates", {"of": of}, is_inline=True, uv_map=uv_map)


def vector_of(reader, place, otherwise="generated"):
    """Where a texture is looked up; {} for one without a position, such as a one-dimensional one. Raises `NotShown` if
    the scene file cannot express it. `otherwise`: used if nothing is linked, None for the input's own numbers.
    """
    at = place.input("Vector")
    if at is None:
        return {}
    found = follow(at)
    if found is not None and found.socket.is_output:
        return {"vector": constant(*ZERO, is_vector=True) if found.node.mute else reader.linked(found)}
    if otherwise is None:
        return taken(reader, place, {"vector": ("Vector", ZERO)})
    uv_map = "" if otherwise == "uv" else None
    return {"vector": Node("coordinates", {"of": otherwise}, uv_map=uv_map).output(width=3, is_vector=True)}


def named(**numbers):
    """Inputs whose names are Blender's in lower case."""
    return {name: (" ".join(word.capitalize() for word in name.split("_")), value) for name, value in numbers.items()}


def _textured(kind, inputs, outputs, options=lambda node: {}):
    """Handler for a texture with a Vector input."""

    def handler(reader, place):
        fields = vector_of(reader, place) | taken(reader, place, inputs) | options(place.node)
        return made(reader, place, kind, fields, _output(place, outputs))

    return handler


def _plain(kind, inputs, outputs=None, options=lambda node: {}):
    """Handler for a node whose inputs are as in the scene file."""

    def handler(reader, place):
        fields = taken(reader, place, inputs) | options(place.node)
        return made(reader, place, kind, fields, _output(place, outputs or {}))

    return handler


def _output(place, outputs):
    """Name of an output from that of the socket, None for the first."""
    return outputs.get(place.socket.name)


def _unless(default, **options):
    """Options that differ from the default."""
    return {name: value for name, value in options.items() if value != default.get(name)}


def _noise(node):
    return _unless(
        {"dimensions": "3d", "type": "fbm", "normalize": True},
        dimensions=word(node.noise_dimensions), type=word(node.noise_type),
        **({"normalize": node.normalize} if node.noise_type == "FBM" else {}))


def _voronoi(node):
    metric = {} if node.feature in ("DISTANCE_TO_EDGE", "N_SPHERE_RADIUS") else {"metric": word(node.distance)}
    if node.voronoi_dimensions == "1D":
        metric = {}
    normalize = {} if node.feature == "N_SPHERE_RADIUS" else {"normalize": node.normalize}
    # The cells have moved since Blender 5.0, except in one dimension.
    is_old = bpy.app.version < (5, 0, 0) and node.voronoi_dimensions != "1D"
    return _unless(
        {"dimensions": "3d", "feature": "f1", "metric": "euclidean", "normalize": False},
        dimensions=word(node.voronoi_dimensions), feature=word(node.feature), **metric, **normalize,
        **({"hash": "lookup3"} if is_old else {}))


def _wave(node):
    direction = node.bands_direction if node.wave_type == "BANDS" else node.rings_direction
    profile = {"SIN": "sine", "SAW": "saw", "TRI": "triangle"}[node.wave_profile]
    return _unless({"type": "bands", "direction": "x", "profile": "sine"},
                   type=word(node.wave_type), direction=word(direction), profile=profile)


def _brick(node):
    options = {name: float(getattr(node, name)) for name in ("offset", "squash")}
    options |= {name: int(getattr(node, name)) for name in ("offset_frequency", "squash_frequency")}
    return _unless({"offset": 0.5, "offset_frequency": 2, "squash": 1.0, "squash_frequency": 2}, **options)


def _image(reader, place):
    """An image whose coordinates are not UV with a mapping."""
    value = picture(reader, place)
    if value.is_constant:
        return value
    fields = {"image": value} | vector_of(reader, place, "uv")
    return made(reader, place, "image", fields)


def _coordinates(reader, place):
    node, name = place.node, place.socket.name
    if name not in COORDINATES:
        raise NotShown(f"{name.lower()} coordinates")
    if node.object is not None and name in ("Object", "Normal"):
        raise NotShown(f"coordinates of another object, '{node.object.name}'")
    if node.from_instancer and name in ("Generated", "UV"):
        raise NotShown(f"{name.lower()} coordinates of the instancer")
    return coordinates(reader, place, COORDINATES[name], "" if name == "UV" else None)


COORDINATES = {"Generated": "generated", "Normal": "normal", "UV": "uv", "Object": "object", "Camera": "camera"}


def _uv_map(reader, place):
    if place.node.from_instancer:
        raise NotShown("UV of the instancer")
    return coordinates(reader, place, "uv", place.node.uv_map)


def _told(kind, outputs):
    """Handler for a node without inputs."""

    def handler(reader, place):
        name = place.socket.name
        if name not in outputs:
            raise NotShown(name)
        output = outputs[name]
        first = next(iter(outputs.values()))
        return made(reader, place, kind, {}, None if output == first else output, is_inline=True)

    return handler


GEOMETRY = {"Position": "position", "Normal": "normal", "True Normal": "true_normal", "Incoming": "incoming",
            "Backfacing": "backfacing"}


def _camera(reader, place):
    at = Node("coordinates", {"of": "camera"}).output(width=3, is_vector=True)
    name = place.socket.name
    if name == "View Vector":
        return made(reader, place, "vector_math", {"operation": "normalize", "a": at})
    if name == "View Distance":
        return made(reader, place, "vector_math", {"operation": "length", "a": at}, "value")
    return made(reader, place, "separate", {"mode": "xyz", "value": at}, "z")


def _by_view(kind, inputs, outputs):
    """Handler for Fresnel and Layer Weight."""
    plain = _plain(kind, inputs, outputs)

    def handler(reader, place):
        if reader.is_linked(place, "Normal"):
            try:
                return _by_normal(reader, place)
            except NotShown:
                reader.context.report.leave_out(f"the Normal input of node '{place.node.name}' of {reader.owner}")
        return plain(reader, place)

    return handler


def _by_normal(reader, place):
    """Fresnel or Layer Weight with a normal other than the surface's."""
    normal = reader.linked(follow(place.input("Normal")))
    if place.node.type == "FRESNEL":
        return by_normal.fresnel(normal, reader.get(place, "IOR"))
    blend = reader.get(place, "Blend")
    if place.socket.name == "Fresnel":
        return by_normal.fresnel(normal, by_normal.index_of_blend(blend))
    if not blend.is_constant:
        raise NotShown("a blend by texture")
    return by_normal.facing(normal, blend)


def _unturned(reader, place):
    """The normal of a Bump without heights."""
    height = reader.get(place, "Height")
    if not height.is_constant:
        raise NotShown("a normal as a value")
    below = place.input("Normal")
    found = None if below is None else follow(below)
    if found is not None and found.socket.is_output:
        return reader.linked(found)
    return made(reader, place, "geometry", {}, "normal", is_inline=True)


def degrees(reader, place, name):
    """An input that is one angle, or three; None for 0."""
    value = reader.get(place, name)
    if value is None:
        return None
    if value.is_constant:
        # As 32-bit numbers, so that 20 degrees are 20 again.
        numbers = [float(np.float32(math.degrees(number))) for number in value.data]
        return constant(*numbers) if any(numbers) else None
    fields = {"a": value, ("b" if value.width == 1 else "scale"): math.degrees(1.0)}
    if value.width == 1:
        return Node("math", {"operation": "multiply"} | fields).output()
    return Node("vector_math", {"operation": "scale"} | fields).output(width=3, is_vector=True)


def _given(**values):
    return {name: value for name, value in values.items() if value is not None}


def _mapping(reader, place):
    fields = vector_of(reader, place, None) | taken(reader, place, {"location": ("Location", ZERO)})
    fields |= _given(rotation=degrees(reader, place, "Rotation"))
    fields |= taken(reader, place, {"scale": ("Scale", ONE)})
    fields |= _unless({"type": "point"}, type=word(place.node.vector_type))
    is_inline = all(value.is_constant or _is_leaf(value) for value in fields.values() if isinstance(value, Value))
    return made(reader, place, "mapping", fields, is_inline=is_inline)


def _is_leaf(value):
    return is_graph(value) and value.special["texture"].kind in ("coordinates", "geometry", "object_info")


ROTATIONS = {"AXIS_ANGLE": "axis_angle", "X_AXIS": "x", "Y_AXIS": "y", "Z_AXIS": "z", "EULER_XYZ": "euler_xyz"}


def _rotate(reader, place):
    names = {"vector": ("Vector", None), "center": ("Center", ZERO), "axis": ("Axis", (0.0, 0.0, 1.0))}
    fields = taken(reader, place, names)
    fields |= _given(angle=degrees(reader, place, "Angle"), rotation=degrees(reader, place, "Rotation"))
    options = _unless({"type": "axis_angle", "invert": False}, type=ROTATIONS[place.node.rotation_type],
                      invert=place.node.invert)
    return made(reader, place, "vector_rotate", fields | options)


STEPS = 256


def _ramp(reader, place):
    ramp = place.node.color_ramp
    fields = taken(reader, place, {"factor": (0, 0.5)})
    if ramp.color_mode == "RGB" and ramp.interpolation in ("LINEAR", "CONSTANT", "EASE"):
        stops = [[element.position, *element.color] for element in ramp.elements]
        fields |= _unless({"interpolation": "linear"}, interpolation=word(ramp.interpolation))
    else:
        stops = [[i / STEPS, *ramp.evaluate(i / STEPS)] for i in range(STEPS + 1)]
    if all(stop[4] == 1.0 for stop in stops):
        stops = [stop[:4] for stop in stops]
    return made(reader, place, "ramp", fields | {"stops": stops}, _output(place, {"Alpha": "alpha"}))


def _curves(kind, inputs, names):
    """Handler for curves. `names`: fields in the order of Blender's curves."""

    def handler(reader, place):
        mapping = place.node.mapping
        mapping.initialize()
        fields = taken(reader, place, inputs)
        for name, curve in zip(names, mapping.curves):
            points = _points(mapping, curve)
            if points is not None:
                fields[name] = points
        return made(reader, place, kind, fields)

    return handler


def _points(mapping, curve):
    """Points of the linear segments of a curve, which continues beyond them as at its ends; None for the identity."""
    low, high = curve.points[0].location.x, curve.points[-1].location.x
    if high <= low:
        return [[low, mapping.evaluate(curve, low)], [low + 1.0, mapping.evaluate(curve, low)]]
    x = low + (high - low) * np.arange(STEPS + 1) / STEPS
    y = np.array([mapping.evaluate(curve, float(at)) for at in x])
    straight = y[0] + (y[-1] - y[0]) * (x - low) / (high - low)
    ends = [0, -1] if np.abs(y - straight).max() < 1e-5 else range(STEPS + 1)
    points = [[float(x[i]), float(np.float32(y[i]))] for i in ends]
    if mapping.extend == "HORIZONTAL":
        return [[low - 1.0, points[0][1]], *points, [high + 1.0, points[-1][1]]]
    is_same = len(points) == 2 and all(abs(a - b) < 1e-6 for a, b in points)
    return None if is_same else points


def _mix(reader, place):
    node = place.node
    data = {"FLOAT": "float", "VECTOR": "vector", "RGBA": "color"}.get(node.data_type)
    if data is None:
        raise NotShown(f"a mix of {node.data_type.lower()}s")
    values = [(name, reader.value(Place(socket, place.groups)))
              for name, socket in zip(("factor", "a", "b"), (socket for socket in node.inputs if socket.enabled))]
    fields = {name: value for name, value in values if not (name == "factor" and _is(value, 0.5))}
    fields |= _unless({"data": "color", "clamp_factor": True}, data=data, clamp_factor=node.clamp_factor)
    if data == "color":
        fields |= _unless({"blend": "mix", "clamp_result": False}, blend=word(node.blend_type),
                          clamp_result=node.clamp_result)
    return made(reader, place, "mix", fields)


def _is(value, number):
    return value.is_constant and all(entry == number for entry in value.data)


def _mix_rgb(reader, place):
    node = place.node
    fields = taken(reader, place, {"factor": (0, 0.5), "a": (1, None), "b": (2, None)})
    fields |= _unless({"blend": "mix", "clamp_result": False}, blend=word(node.blend_type), clamp_result=node.use_clamp)
    return made(reader, place, "mix", fields)


def _math(node):
    return _unless({"operation": "add", "clamp": False}, operation=word(node.operation), clamp=node.use_clamp)


def _map_range(reader, place):
    node = place.node
    data = {"FLOAT": "float", "FLOAT_VECTOR": "vector"}[node.data_type]
    if data == "float":
        fields = taken(reader, place, named(value=None, from_min=0.0, from_max=1.0, to_min=0.0, to_max=1.0, steps=4.0))
    else:
        names = named(from_min=ZERO, from_max=ONE, to_min=ZERO, to_max=ONE, steps=(4.0, 4.0, 4.0))
        fields = taken(reader, place, {"value": ("Vector", None)} | names)
    fields |= _unless(
        {"data": "float", "interpolation": "linear", "clamp": True},
        data=data, interpolation=word(node.interpolation_type), clamp=node.clamp)
    return made(reader, place, "map_range", fields)


def _separate(reader, place):
    node = place.node
    mode = "xyz" if node.type == "SEPXYZ" else word(getattr(node, "mode", "RGB"))
    index = [socket.name for socket in node.outputs].index(place.socket.name)
    fields = taken(reader, place, {"value": (0, None)}) | _unless({"mode": "rgb"}, mode=mode)
    return made(reader, place, "separate", fields, (None, "y", "z")[index])


def _combine(reader, place):
    node = place.node
    mode = "xyz" if node.type == "COMBXYZ" else word(getattr(node, "mode", "RGB"))
    fields = taken(reader, place, {name: (index, 0.0) for index, name in enumerate("xyz")})
    return made(reader, place, "combine", fields | _unless({"mode": "rgb"}, mode=mode))


def _invert(reader, place):
    return made(reader, place, "invert", taken(reader, place, {"factor": (0, 1.0), "color": (1, ZERO)}))


def _normal(reader, place):
    """A direction, or the cosine between it and another."""
    direction = [float(number) for number in place.node.outputs["Normal"].default_value]
    length = math.sqrt(sum(number * number for number in direction))
    direction = constant(*(number / length if length else 0.0 for number in direction), is_vector=True)
    if place.socket.name == "Normal":
        return direction
    value = reader.get(place, "Normal")
    unit = Node("vector_math", {"operation": "normalize", "a": value}).output(width=3, is_vector=True)
    return made(reader, place, "vector_math", {"operation": "dot_product", "a": unit, "b": direction}, "value")


COLOR, VALUE = {"Color": "color"}, {"Fac": "value", "Factor": "value", "Value": "value"}
CURVED = {"factor": (0, 1.0)}

GRAPHS = {
    "TEX_NOISE": _textured("noise", named(
        w=0.0, scale=5.0, detail=2.0, roughness=0.5, lacunarity=2.0, offset=0.0, gain=1.0, distortion=0.0),
        COLOR, _noise),
    "TEX_VORONOI": _textured("voronoi", named(
        w=0.0, scale=5.0, detail=0.0, roughness=0.5, lacunarity=2.0, smoothness=1.0, exponent=0.5, randomness=1.0),
        {"Color": "color", "Position": "position", "W": "w", "Radius": "radius"}, _voronoi),
    "TEX_GRADIENT": _textured("gradient", {}, COLOR, lambda node: _unless(
        {"type": "linear"}, type=word(node.gradient_type))),
    "TEX_MAGIC": _textured("magic", named(scale=5.0, distortion=1.0), VALUE, lambda node: _unless(
        {"depth": 2}, depth=node.turbulence_depth)),
    "TEX_WAVE": _textured("wave", named(
        scale=5.0, distortion=0.0, detail=2.0, detail_scale=1.0, detail_roughness=0.5, phase_offset=0.0), VALUE, _wave),
    "TEX_BRICK": _textured("brick", named(
        color1=GREY, color2=DARK, mortar=ZERO, scale=5.0, mortar_size=0.02, mortar_smooth=0.1, bias=0.0,
        brick_width=0.5, row_height=0.25), VALUE, _brick),
    "TEX_CHECKER": _textured("checker", named(color1=GREY, color2=DARK, scale=5.0), VALUE),
    "TEX_WHITE_NOISE": _textured("white_noise", named(w=0.0), COLOR, lambda node: _unless(
        {"dimensions": "3d"}, dimensions=word(node.noise_dimensions))),
    "TEX_IMAGE": _image,
    "TEX_COORD": _coordinates,
    "UVMAP": _uv_map,
    "NEW_GEOMETRY": _told("geometry", GEOMETRY),
    "OBJECT_INFO": _told("object_info", {"Location": "location", "Random": "random", "Object Index": "index"}),
    "LIGHT_PATH": _told("light_path", {"Is Camera Ray": "is_camera", "Is Shadow Ray": "is_shadow"}),
    "CAMERA": _camera,
    "BUMP": _unturned,
    "FRESNEL": _by_view("fresnel", {"ior": ("IOR", 1.5)}, {}),
    "LAYER_WEIGHT": _by_view("layer_weight", {"blend": ("Blend", 0.5)}, {"Facing": "facing"}),
    "MAPPING": _mapping,
    "VECTOR_ROTATE": _rotate,
    "NORMAL": _normal,
    "VALTORGB": _ramp,
    "CURVE_RGB": _curves("rgb_curves", CURVED | {"color": (1, ONE)}, ("red", "green", "blue", "combined")),
    "CURVE_VEC": _curves("vector_curves", CURVED | {"vector": (1, ZERO)}, "xyz"),
    "CURVE_FLOAT": _curves("float_curve", CURVED | {"value": (1, 1.0)}, ("curve",)),
    "MIX": _mix,
    "MIX_RGB": _mix_rgb,
    "MATH": _plain("math", {"a": (0, 0.5), "b": (1, 0.5), "c": (2, 0.0)}, {}, _math),
    "VECT_MATH": _plain("vector_math", {"a": (0, ZERO), "b": (1, ZERO), "c": (2, ZERO), "scale": (3, 1.0)},
                        {"Value": "value"}, lambda node: {"operation": word(node.operation)}),
    "MAP_RANGE": _map_range,
    "CLAMP": _plain("clamp", named(value=1.0, min=0.0, max=1.0), {}, lambda node: _unless(
        {"type": "minmax"}, type=word(node.clamp_type))),
    "SEPARATE_COLOR": _separate,
    "SEPRGB": _separate,
    "SEPXYZ": _separate,
    "COMBINE_COLOR": _combine,
    "COMBRGB": _combine,
    "COMBXYZ": _combine,
    "HUE_SAT": _plain("hue_saturation", {
        "hue": (0, 0.5), "saturation": (1, 1.0), "value": (2, 1.0), "factor": (3, 1.0), "color": (4, GREY)}),
    "BRIGHTCONTRAST": _plain("bright_contrast", {"color": (0, ONE), "bright": (1, 0.0), "contrast": (2, 0.0)}),
    "GAMMA": _plain("gamma", {"color": (0, ONE), "gamma": (1, 1.0)}),
    "INVERT": _invert,
    "RGBTOBW": _plain("luminance", {"color": (0, None)}),
    "BLACKBODY": _plain("blackbody", {"temperature": (0, 6500.0)}),
}

# Nodes that need a surface.
OF_SURFACES = {"TEX_IMAGE", "TEX_COORD", "UVMAP", "NEW_GEOMETRY", "OBJECT_INFO", "LIGHT_PATH", "CAMERA", "FRESNEL",
               "LAYER_WEIGHT", "BUMP"}
ANYWHERE = {kind: handler for kind, handler in GRAPHS.items() if kind not in OF_SURFACES}
