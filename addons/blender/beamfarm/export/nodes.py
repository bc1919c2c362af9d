"""Nodes that give numbers, colours and textures."""

from dataclasses import replace

import numpy as np

from . import formulas
from .bakes import SIZE, can_be_baked, upstream
from .graph import Place, follow
from .pictures import pixels
from .values import Lookup, NotShown, Source, Value, combine, constant


class Reader:
    """Reads values of one node tree, and reports what it cannot read as belonging to `owner`: "material 'Rock'"."""

    sees_path, rays_of_path = "Is Camera Ray", "for the camera's"
    """The output of a Light Path node that is 1, and the rays that this stands for."""

    graphs = {}
    """Functions from a reader and a `Place` to a `Value` that is a graph, by kind of node; empty where no texture can
    be a graph."""
    sees_surface = False
    """Whether graphs may depend on the viewing direction and the kind of ray."""

    def __init__(self, context, owner, scope=""):
        self.context = context
        self.owner = owner
        self.scope = scope
        """The first part of the names of its textures."""
        self._known = {}
        self.bake = None
        """Function from a `Place` to its baked result, or None; None if nothing can be baked."""
        self.bakes_attributes = False
        """Whether vertex colours must be baked because the UV of baked images takes their place."""
        self.wants = []
        """Outputs to bake."""

    def lack(self, node, why=""):
        """Reports that a node is left out."""
        kind = node.bl_label if node.name.startswith(node.bl_label) else f"{node.name}' ({node.bl_label}"
        shown = f"node '{kind}'" if "(" not in kind else f"node '{kind})"
        self.context.report.leave_out(f"{shown} of {self.owner}" + (f": {why}" if why else ""))

    def value(self, place):
        """Value of an input socket, as a colour, a vector or a number depending on the socket's kind."""
        socket = place.socket
        found = follow(place)
        try:
            if found is None:
                value = default(socket)
            elif not found.socket.is_output:
                value = default(found.socket)
            elif found.node.mute:
                value = default(socket)
            elif found.node.type == "SHADERTORGB":
                self.context.report.note(f"{self.owner}: 'Shader to RGB' is for EEVEE only; as in Cycles, what it "
                                         "is linked to uses its own value")
                value = default(socket)
            else:
                value = self.linked(found)
        except NotShown as problem:
            self.lack(found.node, str(problem))
            value = default(socket)
        if socket.type == "VALUE" or socket.type == "INT":
            return value.as_float()
        return value.as_color()

    def light_path(self, place):
        """The value of a Light Path node's output for the rays being read; None if it cannot be known."""
        return None

    def linked(self, place):
        """Value of an output: a constant, pixels of an image, or a graph. Raises `NotShown`."""
        if place not in self._known:
            try:
                self._known[place] = self._alone(place, self._shown(place))
            except NotShown:
                baked = self._baked(place)
                if baked is None:
                    raise
                self._known[place] = baked
        return self._known[place]

    def _alone(self, place, value):
        """The value, baked if it comes from the mesh and baked images need its place."""
        is_attribute = self.bakes_attributes and value.special is not None and "attribute" in value.special
        return self._baked(place) or value if is_attribute else value

    def _shown(self, place):
        try:
            return self._of(place)
        except NotShown as problem:
            handler = self.graphs.get(place.node.type)
            if handler is None:
                raise
            return self._graph(handler, place, problem)

    def _baked(self, place):
        """The baked result of an output, or None; it is then requested, if possible."""
        if self.bake is None:
            return None
        baked = self.bake(place)
        if baked is not None:
            self.context.report.note(f"{self.owner}: node '{place.node.name}' is baked at {SIZE}")
        elif can_be_baked(place) and not set(upstream(place)) & set(self.wants):
            self.wants.append(place)
        return baked

    def _graph(self, handler, place, problem):
        try:
            return handler(self, place)
        except NotShown as other:
            raise other if str(other) else problem from None

    def get(self, node_place, name):
        """Value of an input by name; None if the node has none."""
        place = node_place.input(name)
        return None if place is None else self.value(place)

    def is_linked(self, node_place, name):
        place = node_place.input(name)
        found = None if place is None else follow(place)
        return found is not None and found.socket.is_output

    def _of(self, place):
        node = place.node
        handler = HANDLERS.get(node.type)
        if handler is None:
            raise NotShown("")
        return handler(self, place)

    def inputs(self, place):
        """Values of all visible inputs."""
        return [self.value(Place(socket, place.groups)) for socket in place.node.inputs if socket.enabled]


def default(socket):
    if not hasattr(socket, "default_value"):
        return constant(0.0)
    value = socket.default_value
    if socket.type == "RGBA":
        return constant(*value[:3])
    if socket.type in ("VECTOR", "ROTATION"):
        return constant(*value[:3], is_vector=True)
    return constant(float(value))


def _rgb(reader, place):
    return constant(*place.node.outputs[0].default_value[:3])


def _number(reader, place):
    return constant(place.node.outputs[0].default_value)


def _image(reader, place):
    value = picture(reader, place)
    if value.is_constant:
        return value
    uv, uv_map = mapping(reader, place.input("Vector"))
    return replace(value, lookup=replace(value.lookup, uv=uv, uv_map=uv_map))


def picture(reader, place):
    """An image, wherever it is looked up."""
    node = place.node
    image = node.image
    missing = missing_picture(reader, place)
    if missing is not None:
        return missing
    if image.source in ("MOVIE", "TILED"):
        raise NotShown(f"an image of the kind {image.source.lower()}")
    if node.projection != "FLAT":
        raise NotShown(f"projection {node.projection.lower()}")
    wrap = {"REPEAT": "repeat", "MIRROR": "mirror", "EXTEND": "clamp", "CLIP": "clamp"}[node.extension]
    if node.extension == "CLIP":
        reader.context.report.note(f"image '{image.name}' of {reader.owner}: continues beyond its border, not clipped")
    if node.interpolation in ("Cubic", "Smart"):
        reader.context.report.note(f"image '{image.name}' of {reader.owner}: interpolated linearly, not cubically")
    lookup = Lookup(filter="nearest" if node.interpolation == "Closest" else "bilinear", wrap=wrap)
    path = image.filepath_from_user(image_user=node.image_user)
    if place.socket.name == "Alpha":
        source = Source(image, path, "a")
        return Value(lambda: pixels(image)[..., 3:], 1, lookup, source, name=f"{image.name}-alpha")
    alpha = node.outputs.get("Alpha")
    if not alpha.is_linked and reader.context.pictures.is_see_through(image, path):
        return Value(lambda: pixels(image, times_alpha=True)[..., :3], 3, lookup, name=image.name)
    return Value(lambda: pixels(image)[..., :3], 3, lookup, Source(image, path), name=image.name)


def missing_picture(reader, place):
    """Cycles' replacement for a missing image: pink. None if the image exists; otherwise it is reported."""
    image = place.node.image
    if image is None:
        reader.lack(place.node, "no image")
    # Images shown by a viewer or a render have no file.
    elif image.source == "VIEWER" or image.source not in ("MOVIE", "TILED") and 0 in image.size:
        reader.lack(place.node, f"image '{image.name}' cannot be read")
    else:
        return None
    return constant(1.0) if place.socket.name == "Alpha" else constant(1.0, 0.0, 1.0)


def mapping(reader, place):
    """(2 x 3 numbers or None, UV map) for a texture's Vector input."""
    found = follow(place)
    if found is None or not found.socket.is_output:
        return (), ""
    matrix, uv_map = _coordinates(reader, found)
    rows = tuple(tuple(float(number) for number in row) for row in matrix[:2][:, [0, 1, 3]])
    return (() if rows == ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)) else rows), uv_map


def _coordinates(reader, place):
    """(4 x 4 matrix, UV map) of texture coordinates."""
    node = place.node
    if node.type == "TEX_COORD":
        if place.socket.name != "UV":
            raise NotShown(f"{place.socket.name.lower()} coordinates")
        return np.eye(4), ""
    if node.type == "UVMAP":
        if node.from_instancer:
            raise NotShown("UV of the instancer")
        return np.eye(4), node.uv_map
    if node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY" and place.socket.name == "Vector":
        return np.eye(4), node.attribute_name
    if node.type == "MAPPING":
        inner = follow(place.input("Vector"))
        if inner is None or not inner.socket.is_output:
            raise NotShown("no texture coordinates")
        matrix, uv_map = _coordinates(reader, inner)
        return mapping_matrix(reader, place) @ matrix, uv_map
    raise NotShown(f"coordinates by '{node.bl_label}'")


def mapping_matrix(reader, place):
    """4 x 4 matrix of a Mapping node."""
    from mathutils import Euler

    def vector(name, otherwise):
        value = reader.get(place, name)
        if value is None:
            return otherwise
        if not value.is_constant:
            raise NotShown("a mapping by texture")
        return value.color()

    location = vector("Location", [0.0, 0.0, 0.0])
    rotation = np.eye(4)
    rotation[:3, :3] = np.array(Euler(vector("Rotation", [0.0, 0.0, 0.0])).to_matrix(), dtype=np.float64)
    size = np.array(vector("Scale", [1.0, 1.0, 1.0]))
    kind = place.node.vector_type
    move = np.eye(4)
    move[:3, 3] = location
    if kind == "POINT":
        return move @ rotation @ np.diag([*size, 1.0])
    if kind == "VECTOR":
        return rotation @ np.diag([*size, 1.0])
    if kind == "TEXTURE":
        move[:3, 3] = [-number for number in location]
        return np.diag([*_inverse(size), 1.0]) @ rotation.T @ move
    raise NotShown("a mapping of normals")


def _inverse(size):
    return np.divide(1.0, size, out=np.zeros(3), where=size != 0.0)


def _checker(reader, place):
    first, second = reader.get(place, "Color1"), reader.get(place, "Color2")
    scale = reader.get(place, "Scale")
    if place.socket.name != "Color":
        first, second = constant(1.0), constant(0.0)
    if not (first.is_constant and second.is_constant and scale.is_constant):
        raise NotShown("colours or a scale by texture")
    if not reader.is_linked(place, "Vector"):
        raise NotShown("generated coordinates")
    uv, uv_map = mapping(reader, place.input("Vector"))
    # Checks of 1 / scale here, of half a unit of UV in the scene file.
    matrix = np.vstack([uv or ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (0.0, 0.0, 1.0)])
    matrix = np.diag([scale.number() / 2, scale.number() / 2, 1.0]) @ matrix
    lookup = Lookup(tuple(tuple(float(number) for number in row) for row in matrix[:2]), uv_map)
    # Blender's first colour is that of odd cells: an even floor(x) + floor(y) + floor(z) gives the second at (0, 0).
    colors = [second.color(), first.color()]
    return Value(None, 3, lookup, special={"checkerboard": colors})


def _vertex_color(reader, place):
    if place.socket.name != "Color":
        raise NotShown(f"opacity of colour attribute '{place.node.layer_name}'")
    return attribute(place.node.layer_name)


def _attribute(reader, place):
    node = place.node
    if node.attribute_type != "GEOMETRY" or place.socket.name == "Alpha":
        what = "opacity of attribute" if place.socket.name == "Alpha" else "attribute"
        raise NotShown(f"{what} '{node.attribute_name}' of the {node.attribute_type.lower()}")
    return attribute(node.attribute_name)


def attribute(name):
    """A mesh's attribute as vertex colours; "" is its colour attribute for renders."""
    return Value(None, 3, special={"attribute": "color"}, name=name)


def _formula(function):
    """Handler for a node whose value is a function of all its visible inputs."""

    def handler(reader, place):
        values = reader.inputs(place)
        result = combine(lambda *arrays: function(place.node, *arrays), *values)
        return result

    return handler


def _separate(reader, place):
    index = [socket.name for socket in place.node.outputs].index(place.socket.name)
    value = reader.inputs(place)[0].as_color()
    mode = getattr(place.node, "mode", "RGB")
    if mode != "RGB":
        return combine(lambda array: formulas.from_rgb(array, mode)[..., index : index + 1], value)
    if value.source is not None and value.source.channel is None and value.special is None:
        source = Source(value.source.image, value.source.path, "rgb"[index])
        return Value(lambda: value.data[..., index : index + 1], 1, value.lookup, source, name=f"{value.name}-{index}")
    return combine(lambda array: array[..., index : index + 1], value)


def _combine(reader, place):
    mode = getattr(place.node, "mode", "RGB")
    parts = reader.inputs(place)
    value = combine(lambda *arrays: np.concatenate(np.broadcast_arrays(*arrays), axis=-1), *parts)
    if mode != "RGB":
        value = combine(lambda array: formulas.to_rgb(array, mode), value)
    value.is_vector = place.node.type == "COMBXYZ"
    return value


def _ramp(reader, place):
    ramp = place.node.color_ramp
    steps = 4096
    table = np.array([ramp.evaluate(i / steps) for i in range(steps + 1)], dtype=np.float32)
    table = table[:, 3:] if place.socket.name == "Alpha" else table[:, :3]
    return combine(lambda factor: formulas.look_up(table, factor), reader.inputs(place)[0].as_float())


def _curves(reader, place):
    curves = place.node.mapping
    curves.initialize()
    steps = 1024
    curve = [[curves.evaluate(curves.curves[i], x / steps) for x in range(steps + 1)] for i in range(4)]
    tables = np.array(curve, dtype=np.float32)
    return combine(lambda factor, color: formulas.curves(tables, factor, color), *reader.inputs(place))


def _blackbody(reader, place):
    return combine(formulas.blackbody, reader.inputs(place)[0].as_float())


def fresnel_index(reader, place):
    """Index of refraction of a Fresnel node, or of Layer Weight's Fresnel; None for another socket."""
    if place.node.type == "FRESNEL":
        index = reader.get(place, "IOR")
    elif place.node.type == "LAYER_WEIGHT" and place.socket.name == "Fresnel":
        blend = reader.get(place, "Blend")
        index = combine(lambda blend: 1.0 / np.maximum(1.0 - blend, 1e-5), blend)
    else:
        return None
    if not index.is_constant:
        raise NotShown("an index by texture")
    return max(index.number(), 1e-5)


def _head_on(reader, place):
    """A value that depends on the viewing direction, evaluated for a head-on view."""
    if reader.sees_surface:
        raise NotShown(place.socket.name)
    index = fresnel_index(reader, place)
    reader.lack(place.node, f"{place.socket.name} is taken as for a head-on view")
    return constant(0.0 if index is None else ((index - 1.0) / (index + 1.0)) ** 2)


def _light_path(reader, place):
    name = place.socket.name
    told = reader.light_path(place)
    if told is not None:
        return constant(told)
    if name not in LIGHT_PATH or reader.sees_surface and name in ("Is Camera Ray", "Is Shadow Ray"):
        raise NotShown(name)
    reader.lack(place.node, f"'{name}' is taken for all rays as {reader.rays_of_path}")
    return constant(1.0 if name == reader.sees_path else 0.0)


LIGHT_PATH = {"Is Camera Ray", "Is Shadow Ray", "Is Diffuse Ray", "Is Glossy Ray", "Is Singular Ray",
              "Is Reflection Ray", "Is Transmission Ray", "Is Volume Scatter Ray", "Ray Depth", "Diffuse Depth",
              "Glossy Depth", "Transparent Depth", "Transmission Depth", "Portal Depth"}


HANDLERS = {
    "RGB": _rgb,
    "VALUE": _number,
    "TEX_IMAGE": _image,
    "TEX_CHECKER": _checker,
    "VERTEX_COLOR": _vertex_color,
    "ATTRIBUTE": _attribute,
    "MATH": _formula(formulas.math),
    "VECT_MATH": _formula(formulas.vector_math),
    "MIX": _formula(formulas.mix),
    "MIX_RGB": _formula(formulas.mix_rgb),
    "INVERT": _formula(formulas.invert),
    "GAMMA": _formula(formulas.gamma),
    "BRIGHTCONTRAST": _formula(formulas.bright_contrast),
    "HUE_SAT": _formula(formulas.hue_saturation),
    "CLAMP": _formula(formulas.clamp),
    "MAP_RANGE": _formula(formulas.map_range),
    "RGBTOBW": _formula(lambda node, color: formulas.luminance(color)),
    "SEPARATE_COLOR": _separate,
    "SEPRGB": _separate,
    "SEPXYZ": _separate,
    "COMBINE_COLOR": _combine,
    "COMBRGB": _combine,
    "COMBXYZ": _combine,
    "VALTORGB": _ramp,
    "CURVE_RGB": _curves,
    "BLACKBODY": _blackbody,
    "FRESNEL": _head_on,
    "LAYER_WEIGHT": _head_on,
    "LIGHT_PATH": _light_path,
}
