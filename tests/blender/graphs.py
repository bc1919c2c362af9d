"""Texture graphs of scene files as Blender's nodes: the inverse of what the add-on writes.

`KINDS` maps each node of a scene file to one of Blender's. The tests use it to build graphs in Blender, to see how
Cycles evaluates them and whether the add-on writes them unchanged.
"""

import math

import bpy


class Kind:
    """A node: its class in Blender, (socket, default) of its inputs, (property, Blender's values) of its options."""

    def __init__(self, name, inputs, outputs, options=(), change=None):
        self.name = f"ShaderNode{name}"
        self.inputs = inputs
        self.outputs = outputs
        self.options = dict(options)
        self.change = change


def upper(*values, **others):
    """Blender's words for option values: the same in capitals, except for `others`."""
    return {value: value.upper() for value in values} | others


def texture(*names, **numbers):
    """Inputs of a texture: a vector, and those named."""
    return {"vector": ("Vector", (0.0, 0.0, 0.0))} | {name: (socket(name), value) for name, value in numbers.items()}


def socket(name):
    return " ".join(word.capitalize() for word in name.split("_"))


COLOR_AND_FACTOR = {"color": "Color", "value": "Fac"}
FACTOR_AND_COLOR = {"value": "Fac", "color": "Color"}
SIZES = upper("1d", "2d", "3d", "4d")
BLENDS = upper("mix", "darken", "multiply", "burn", "lighten", "screen", "dodge", "add", "overlay", "soft_light",
               "linear_light", "difference", "exclusion", "subtract", "divide", "hue", "saturation", "color", "value")
MATH = upper(*(item.identifier.lower() for item in bpy.types.ShaderNodeMath.bl_rna.properties["operation"].enum_items))
VECTOR_MATH = upper(
    *(item.identifier.lower() for item in bpy.types.ShaderNodeVectorMath.bl_rna.properties["operation"].enum_items)
)
GREY, DARK, BLACK = (0.8, 0.8, 0.8), (0.2, 0.2, 0.2), (0.0, 0.0, 0.0)


def _ramp(node, table):
    ramp = node.color_ramp
    ramp.interpolation = table.get("interpolation", "linear").upper()
    while len(ramp.elements) > 1:
        ramp.elements.remove(ramp.elements[0])
    for number, (position, *color) in enumerate(table["stops"]):
        element = ramp.elements[0] if number == 0 else ramp.elements.new(position)
        element.position = position
        element.color = (*color, 1.0)[:4]


def _curves(*names):
    def change(node, table):
        mapping = node.mapping
        mapping.extend = "EXTRAPOLATED"
        for name, curve in zip(names, mapping.curves):
            points = table.get(name)
            if points is None:
                continue
            while len(curve.points) > 2:
                curve.points.remove(curve.points[1])
            for number, (x, y) in enumerate(points):
                point = curve.points[number] if number < 2 else curve.points.new(x, y)
                point.location = x, y
            for point in curve.points:
                point.handle_type = "VECTOR"
        mapping.update()

    return change


def _mix(node, table):
    node.data_type = {"float": "FLOAT", "vector": "VECTOR", "color": "RGBA"}[table.get("data", "color")]
    if node.data_type == "VECTOR":
        is_number = isinstance(table.get("factor", 0.5), (int, float))
        node.factor_mode = "UNIFORM" if is_number or "scalar" in table else "NON_UNIFORM"


def _mix_socket(name, table):
    data = {"float": "Float", "vector": "Vector", "color": "Color"}[table.get("data", "color")]
    if name == "factor":
        return "Factor_Vector" if data == "Vector" and not isinstance(table[name], (int, float)) else "Factor_Float"
    return f"{socket(name)}_{data}"


def _range_socket(name, table):
    if table.get("data", "float") == "float":
        return socket(name)
    return {"value": "Vector", "result": "Vector"}.get(name, f"{'_'.join(socket(name).split())}_FLOAT3")


KINDS = {
    "mapping": Kind(
        "Mapping", texture(location=BLACK, rotation=BLACK, scale=(1.0, 1.0, 1.0)), {"vector": "Vector"},
        {"type": ("vector_type", upper("point", "texture", "vector", "normal"))}),
    "noise": Kind(
        "TexNoise",
        texture(w=0.0, scale=5.0, detail=2.0, roughness=0.5, lacunarity=2.0, offset=0.0, gain=1.0, distortion=0.0),
        FACTOR_AND_COLOR,
        {"dimensions": ("noise_dimensions", SIZES), "normalize": ("normalize", None), "type": ("noise_type", upper(
            "fbm", "multifractal", "hybrid_multifractal", "ridged_multifractal", "hetero_terrain"))}),
    "voronoi": Kind(
        "TexVoronoi",
        texture(w=0.0, scale=5.0, detail=0.0, roughness=0.5, lacunarity=2.0, smoothness=1.0, exponent=0.5,
                randomness=1.0),
        {name: socket(name) for name in ("distance", "color", "position", "w", "radius")},
        {"dimensions": ("voronoi_dimensions", SIZES), "normalize": ("normalize", None),
         "feature": ("feature", upper("f1", "f2", "smooth_f1", "distance_to_edge", "n_sphere_radius")),
         "metric": ("distance", upper("euclidean", "manhattan", "chebychev", "minkowski"))}),
    "gradient": Kind("TexGradient", texture(), FACTOR_AND_COLOR, {"type": ("gradient_type", upper(
        "linear", "quadratic", "easing", "diagonal", "spherical", "quadratic_sphere", "radial"))}),
    "magic": Kind("TexMagic", texture(scale=5.0, distortion=1.0), COLOR_AND_FACTOR,
                  {"depth": ("turbulence_depth", None)}),
    "wave": Kind(
        "TexWave",
        texture(scale=5.0, distortion=0.0, detail=2.0, detail_scale=1.0, detail_roughness=0.5, phase_offset=0.0),
        COLOR_AND_FACTOR,
        {"type": ("wave_type", upper("bands", "rings")), "direction": (("bands_direction", "rings_direction"), upper(
            "x", "y", "z", "diagonal", "spherical")),
         "profile": ("wave_profile", {"sine": "SIN", "saw": "SAW", "triangle": "TRI"})}),
    "brick": Kind(
        "TexBrick",
        texture(color1=GREY, color2=DARK, mortar=BLACK, scale=5.0, mortar_size=0.02, mortar_smooth=0.1, bias=0.0,
                brick_width=0.5, row_height=0.25),
        COLOR_AND_FACTOR,
        {name: (name, None) for name in ("offset", "offset_frequency", "squash", "squash_frequency")}),
    "checker": Kind("TexChecker", texture(color1=GREY, color2=DARK, scale=5.0), COLOR_AND_FACTOR),
    "white_noise": Kind("TexWhiteNoise", texture(w=0.0), {"value": "Value", "color": "Color"},
                        {"dimensions": ("noise_dimensions", SIZES)}),
    "ramp": Kind("ValToRGB", {"factor": ("Fac", 0.5)}, {"color": "Color", "alpha": "Alpha"}, change=_ramp),
    "rgb_curves": Kind("RGBCurve", {"factor": ("Fac", 1.0), "color": ("Color", (1.0, 1.0, 1.0))}, {"color": "Color"},
                       change=_curves("red", "green", "blue", "combined")),
    "vector_curves": Kind("VectorCurve", {"factor": ("Fac", 1.0), "vector": ("Vector", BLACK)}, {"vector": "Vector"},
                          change=_curves("x", "y", "z")),
    "float_curve": Kind("FloatCurve", {"factor": ("Factor", 1.0), "value": ("Value", 1.0)}, {"value": "Value"},
                        change=_curves("curve")),
    "mix": Kind(
        "Mix", {"factor": (_mix_socket, 0.5), "a": (_mix_socket, None), "b": (_mix_socket, None)},
        {"result": lambda _, table: f"Result_{_mix_socket('a', table)[2:]}"},
        {"blend": ("blend_type", BLENDS), "clamp_factor": ("clamp_factor", None),
         "clamp_result": ("clamp_result", None)}, _mix),
    "math": Kind("Math", {"a": ("Value", 0.5), "b": ("Value_001", 0.5), "c": ("Value_002", 0.0)}, {"value": "Value"},
                 {"operation": ("operation", MATH), "clamp": ("use_clamp", None)}),
    "vector_math": Kind(
        "VectorMath",
        {"a": ("Vector", BLACK), "b": ("Vector_001", BLACK), "c": ("Vector_002", BLACK), "scale": ("Scale", 1.0)},
        {"vector": "Vector", "value": "Value"}, {"operation": ("operation", VECTOR_MATH)}),
    "map_range": Kind(
        "MapRange",
        {"value": (_range_socket, None)} | {
            name: (_range_socket, value)
            for name, value in (("from_min", 0.0), ("from_max", 1.0), ("to_min", 0.0), ("to_max", 1.0), ("steps", 4.0))
        },
        {"result": lambda _, table: "Vector" if table.get("data") == "vector" else "Result"},
        {"data": ("data_type", {"float": "FLOAT", "vector": "FLOAT_VECTOR"}), "clamp": ("clamp", None),
         "interpolation": ("interpolation_type", upper("linear", "stepped", "smoothstep", "smootherstep"))}),
    "clamp": Kind("Clamp", {"value": ("Value", 1.0), "min": ("Min", 0.0), "max": ("Max", 1.0)}, {"value": "Result"},
                  {"type": ("clamp_type", upper("minmax", "range"))}),
    "hue_saturation": Kind(
        "HueSaturation",
        {"hue": ("Hue", 0.5), "saturation": ("Saturation", 1.0), "value": ("Value", 1.0), "factor": ("Fac", 1.0),
         "color": ("Color", GREY)}, {"color": "Color"}),
    "bright_contrast": Kind(
        "BrightContrast",
        {"color": ("Color", (1.0, 1.0, 1.0)), "bright": ("Bright", 0.0), "contrast": ("Contrast", 0.0)},
        {"color": "Color"}),
    "gamma": Kind("Gamma", {"color": ("Color", (1.0, 1.0, 1.0)), "gamma": ("Gamma", 1.0)}, {"color": "Color"}),
    "invert": Kind("Invert", {"factor": ("Fac", 1.0), "color": ("Color", BLACK)}, {"color": "Color"}),
    "luminance": Kind("RGBToBW", {"color": ("Color", None)}, {"value": "Val"}),
    "blackbody": Kind("Blackbody", {"temperature": ("Temperature", 6500.0)}, {"color": "Color"}),
    "vector_rotate": Kind(
        "VectorRotate", texture(center=BLACK, axis=(0.0, 0.0, 1.0), angle=0.0, rotation=BLACK), {"vector": "Vector"},
        {"type": ("rotation_type", {
            "axis_angle": "AXIS_ANGLE", "x": "X_AXIS", "y": "Y_AXIS", "z": "Z_AXIS", "euler_xyz": "EULER_XYZ"}),
         "invert": ("invert", None)}),
    "fresnel": Kind("Fresnel", {"ior": ("IOR", 1.5)}, {"value": "Fac"}),
    "layer_weight": Kind("LayerWeight", {"blend": ("Blend", 0.5)}, {"fresnel": "Fresnel", "facing": "Facing"}),
    "geometry": Kind("NewGeometry", {}, {
        name: socket(name) for name in ("position", "normal", "true_normal", "incoming", "backfacing")}),
    "object_info": Kind("ObjectInfo", {}, {"location": "Location", "random": "Random", "index": "Object Index"}),
    "light_path": Kind("LightPath", {}, {"is_camera": "Is Camera Ray", "is_shadow": "Is Shadow Ray"}),
}
"""By kind. Those that correspond to several of Blender's are in `_found`."""

# Options and inputs that are angles in degrees here.
ANGLES = {("mapping", "rotation"), ("vector_rotate", "angle"), ("vector_rotate", "rotation")}


def _found(table):
    """The `Kind` of a table."""
    if "attribute" in table:
        return Kind("Attribute", {}, {"vector": "Vector"}, change=_attribute)
    kind = table["node"]
    mode = table.get("mode", "rgb")
    if kind == "separate":
        if mode == "xyz":
            return Kind("SeparateXYZ", {"value": ("Vector", None)}, {"x": "X", "y": "Y", "z": "Z"})
        return Kind("SeparateColor", {"value": ("Color", None)}, {"x": "Red", "y": "Green", "z": "Blue"},
                    {"mode": ("mode", upper("rgb", "hsv", "hsl"))})
    if kind == "combine":
        if mode == "xyz":
            return Kind("CombineXYZ", {name: (name.upper(), 0.0) for name in "xyz"}, {"result": "Vector"})
        return Kind("CombineColor", {"x": ("Red", 0.0), "y": ("Green", 0.0), "z": ("Blue", 0.0)}, {"result": "Color"},
                    {"mode": ("mode", upper("rgb", "hsv", "hsl"))})
    if kind == "coordinates":
        of = table["of"]
        if of == "attribute":
            return Kind("Attribute", {}, {"vector": "Vector"}, change=_attribute)
        if of == "world":
            return Kind("NewGeometry", {}, {"vector": "Position"})
        return Kind("TexCoord", {}, {"vector": "UV" if of == "uv" else of.capitalize()})
    return KINDS[kind]


def _attribute(node, _):
    node.attribute_name = "p"


def build(tree, table, textures=None):
    """Makes the nodes of a graph, which may refer to `textures`. Returns the socket of its output."""
    if "texture" in table:
        table = {**textures[table["texture"]], **{name: table[name] for name in table if name != "texture"}}
    kind = _found(table)
    node = tree.nodes.new(kind.name)
    for option, (name, values) in kind.options.items():
        if option not in table:
            continue
        if isinstance(name, tuple):
            name = name[table.get("type", "bands") == "rings"]
        setattr(node, name, table[option] if values is None else values[table[option]])
    if kind.change is not None:
        kind.change(node, table)
    for name, (identifier, default) in kind.inputs.items():
        if name not in table and default is None:
            continue
        value = table.get(name, default)
        identifier = identifier if isinstance(identifier, str) else identifier(name, table | {name: value})
        place = next(socket for socket in node.inputs if socket.identifier == identifier)
        if isinstance(value, dict):
            made = build(tree, value, textures)
            if (table.get("node"), name) in ANGLES:
                made = _in_radians(tree, made)
            tree.links.new(made, place)
        elif name in table or default is not None:
            _set(place, value, (table.get("node"), name) in ANGLES)
    output = table.get("output", next(iter(kind.outputs)))
    wanted = kind.outputs[output]
    wanted = wanted if isinstance(wanted, str) else wanted(output, table)
    return next(socket for socket in node.outputs if wanted in (socket.identifier, socket.name))


def _set(place, value, is_angle):
    values = list(value) if isinstance(value, (list, tuple)) else [value]
    values = [math.radians(number) if is_angle else number for number in values]
    if place.type == "VALUE":
        place.default_value = values[0]
        return
    values = values * 3 if len(values) == 1 else values
    place.default_value = (*values, 1.0) if place.type == "RGBA" else values


def _in_radians(tree, made):
    scale = tree.nodes.new("ShaderNodeVectorMath")
    scale.operation = "SCALE"
    scale.inputs["Scale"].default_value = math.radians(1.0)
    tree.links.new(made, scale.inputs[0])
    return scale.outputs[0]
