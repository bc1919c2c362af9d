"""The world's shader as an environment light, and its volume."""

from dataclasses import replace

import numpy as np
from mathutils import Euler, Matrix, Vector

from .animated import is_animated
from .arithmetic import Node, is_graph, scaled
from .bakes import upstream
from .graph import Place, follow, output_node
from .interiors import medium_name
from .media import read_volume
from .mixes import opaque
from .nodes import mapping_matrix, missing_picture
from .pictures import pixels
from .records import Graphs, equirectangular
from .sky import picture, sky_of, with_sun
from .surfaces import SurfaceReader
from .transforms import matrix_step
from .texture_nodes import ANYWHERE, coordinates, made, vector_of
from .values import Lookup, NotShown, Source, Value

# Cycles' panorama has +z at the top, +x in the middle and +y a quarter from the left; the scene file's has +y at the
# top, +z in the middle and +x a quarter from the left.
STANDS = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


# The outputs of a Light Path node that are 1, by the kind of rays that see the surroundings.
PATHS = {
    "camera": {"Is Camera Ray"},
    "reflected": {"Is Glossy Ray", "Is Reflection Ray"},
    "refracted": {"Is Glossy Ray", "Is Transmission Ray"},
    "shadow": {"Is Diffuse Ray", "Is Reflection Ray"},
    "photon": {"Is Diffuse Ray", "Is Reflection Ray"},
}


class WorldReader(SurfaceReader):
    """Reads the surface of a world; images are looked up by direction."""

    sees_surface = False
    # What lights the scene matters more than what is seen behind it.
    sees_path, rays_of_path = "Is Diffuse Ray", "for those that light the scene"

    def __init__(self, context, owner, scope, rays):
        super().__init__(context, owner, scope)
        self.rays = rays
        """The kind of rays, of `PATHS`, that it reads for."""

    def light_path(self, place):
        name = place.socket.name
        if not any(name in names for names in PATHS.values()):
            return None
        return float(name in PATHS[self.rays])

    def _of(self, place):
        if place.node.type == "TEX_ENVIRONMENT":
            return self._environment(place)
        if place.node.type == "TEX_SKY":
            return replace(self.sky(place), lookup=Lookup(self._directions(place.input("Vector"))))
        if place.node.type in ("TEX_IMAGE", "TEX_CHECKER"):
            raise NotShown("an image that is not projected around the world")
        return super()._of(place)

    def surface(self, place):
        found = follow(place)
        if found is not None and found.socket.is_output and not found.node.mute and found.node.type == "BACKGROUND":
            color, strength = self.get(found, "Color"), self.get(found, "Strength")
            return opaque(None, emission=scaled(color, strength))
        return super().surface(place)

    def _environment(self, place):
        return self._picture(place, Lookup(self._directions(place.input("Vector"))))

    def _picture(self, place, lookup):
        node = place.node
        missing = missing_picture(self, place)
        if missing is not None:
            return missing
        image = node.image
        if node.projection != "EQUIRECTANGULAR":
            raise NotShown("a mirror ball")
        if image.source in ("MOVIE", "TILED"):
            raise NotShown(f"image '{image.name}' cannot be read")
        path = image.filepath_from_user(image_user=node.image_user)
        return Value(lambda: pixels(image)[..., :3], 3, lookup, Source(image, path), name=image.name)

    def sky(self, place):
        """A Sky Texture as a panorama."""
        found = sky_of(place.node)
        if found is None:
            raise NotShown("the sky of Hosek and Wilkie")
        if place.node.sky_type == "MULTIPLE_SCATTERING":
            baked = self._baked(place)
            if baked is not None:
                return replace(baked, load=lambda: with_sun(baked.data, found))
            self.lack(place.node, "light that the air scatters more than once is missing")
        return Value(lambda: picture(found), 3, Lookup(), name="sky")

    def _directions(self, place):
        """Rows of the matrix from world directions to the directions of an image lookup."""
        # A sky with its sun has no input.
        found = None if place is None else follow(place)
        matrix = np.eye(4)
        if found is not None and found.socket.is_output:
            matrix = self._matrix(found)
        if np.abs(matrix[:3, 3]).max() > 0.0:
            raise NotShown("a mapping that moves directions")
        turn = matrix[:3, :3]
        product = turn @ turn.T
        if not np.allclose(product, product[0, 0] * np.eye(3), rtol=1e-5, atol=1e-6):
            raise NotShown("a mapping that stretches directions")
        turn = turn / np.sqrt(product[0, 0])
        return tuple(tuple(float(number) for number in row) for row in turn)

    def _matrix(self, place):
        node = place.node
        if node.type == "TEX_COORD" and place.socket.name in ("Generated", "Object") and node.object is None:
            return np.eye(4)
        if node.type == "NEW_GEOMETRY" and place.socket.name == "Position":
            return np.eye(4)
        if node.type in ("MAPPING", "VECTOR_ROTATE"):
            inner = follow(place.input("Vector"))
            if inner is None or not inner.socket.is_output:
                raise NotShown("no directions")
            own = mapping_matrix(self, place) if node.type == "MAPPING" else self._rotation(place)
            return own @ self._matrix(inner)
        raise NotShown(f"directions by '{node.bl_label}'")


    def _rotation(self, place):
        """Matrix of a Vector Rotate node."""
        node = place.node
        values = {name: self.get(place, name) for name in ("Center", "Axis", "Angle", "Rotation")}
        if any(value is not None and not value.is_constant for value in values.values()):
            raise NotShown("a rotation by texture")
        if any(values["Center"].color()):
            raise NotShown("a rotation around a point other than the centre")
        if node.rotation_type == "EULER_XYZ":
            turn = Euler(values["Rotation"].color()).to_matrix()
        else:
            axis = {"X_AXIS": (1, 0, 0), "Y_AXIS": (0, 1, 0), "Z_AXIS": (0, 0, 1)}.get(node.rotation_type)
            axis = Vector(axis or values["Axis"].color())
            turn = Matrix.Rotation(values["Angle"].number(), 3, axis) if axis.length else Matrix.Identity(3)
        matrix = np.eye(4)
        matrix[:3, :3] = np.array(turn.inverted() if node.invert else turn)
        return matrix


def _coordinates(reader, place):
    """The direction, or its opposite, as for normals."""
    name = place.socket.name
    if getattr(place.node, "object", None) is None and name in ("Generated", "Object", "Position"):
        return coordinates(reader, place, "generated")
    if name in ("Normal", "True Normal", "Incoming"):
        fields = {"operation": "scale", "a": coordinates(reader, place, "generated"), "scale": -1.0}
        return made(reader, place, "vector_math", fields, is_inline=True)
    raise NotShown(f"{name.lower()} coordinates" if place.node.type == "TEX_COORD" else name)


def _environment(reader, place):
    """A panorama whose lookup is not a rotation."""
    value = reader.sky(place) if place.node.type == "TEX_SKY" else reader._picture(place, Lookup())
    direction = vector_of(reader, place)["vector"]
    unit = Node("vector_math", {"operation": "normalize", "a": direction}).output(width=3, is_vector=True)
    return made(reader, place, "image", {"image": value, "vector": equirectangular(unit)})


WorldReader.graphs = ANYWHERE | {
    "TEX_COORD": _coordinates, "NEW_GEOMETRY": _coordinates, "TEX_ENVIRONMENT": _environment,
    "TEX_SKY": _environment}


def read_world(context):
    """Adds the world's light, and its medium."""
    world = context.scene.world
    if world is None:
        return
    owner = f"world '{world.name}'"
    if not world.use_nodes or world.node_tree is None:
        _add(context, world, owner, list(PATHS), [float(number) for number in world.color])
        return
    context.world_medium = _medium(context, world, owner)
    output = output_node(world.node_tree, "ShaderNodeOutputWorld")
    if output is None or not output.inputs["Surface"].is_linked:
        return
    place = Place(output.inputs["Surface"])
    told = {each.socket.name for each in upstream(place) if each.node.type == "LIGHT_PATH"}
    alike = {}
    for rays, names in PATHS.items():
        alike.setdefault(frozenset(names & told), []).append(rays)
    for group in alike.values():
        shown = owner if len(alike) == 1 else f"{owner} as {group[0]} rays see it"
        reader = _reader(context, world, shown, group[0])
        emission = reader.surface(place).emission
        if context.bakes is not None:
            context.bakes.ask_world(world, reader.wants)
        _add_seen(context, world, shown, group, emission)


def _reader(context, world, owner, rays):
    reader = WorldReader(context, owner, world.name, rays)
    if context.bakes is not None:
        reader.bake = lambda place: context.bakes.of_world(world, place)
    return reader


def _medium(context, world, owner):
    medium = read_volume(context, world.node_tree, "ShaderNodeOutputWorld", owner)
    if medium is not None and medium.grid is not None and not medium.grid_is_optional:
        context.report.leave_out(f"the volume of {owner}, whose density is an attribute")
        medium = None
    if medium is not None and medium.texture is not None:
        context.report.leave_out(f"the volume of {owner}, whose density is a texture")
        medium = None
    if medium is not None and medium.glow is not None:
        context.report.leave_out(f"what the volume of {owner} emits, which has no end")
        medium = replace(medium, glow=None)
    return medium


def _add_seen(context, world, owner, rays, emission):
    """Adds what some kinds of rays see of the world's light."""
    if emission is None:
        _add(context, world, owner, rays, [0.0, 0.0, 0.0])
        return
    if is_graph(emission):
        _add(context, world, owner, rays, None, _graph(context, world, owner, rays, emission))
        return
    if emission.special is not None:
        context.report.leave_out(f"a texture of {owner} that is no image")
        return
    if emission.is_constant:
        _add(context, world, owner, rays, [max(number, 0.0) for number in emission.color()])
        return
    fields = _image(context, emission)
    turn = np.eye(4)
    turn[:3, :3] = np.array(emission.lookup.uv).T @ STANDS
    _add(context, world, owner, rays, None, fields | {"transform": [matrix_step(turn)]})


def _graph(context, world, owner, rays, value):
    gain = value.special.get("scale", 1.0)
    value = replace(value, special=value.special | {"scale": 1.0})
    parts = (world.name, "light") if len(rays) == len(PATHS) else (world.name, "light", rays[0])
    table = Graphs(context, owner).named(value, *parts)
    return {"texture": table} | ({} if gain == 1.0 else {"scale": gain})


def _image(context, value):
    source = value.source
    if source is not None and source.channel is None and not source.image.is_float:
        written = context.pictures.file(source.image, source.path, context.report)
        if written is not None and not written[1]:
            return {"image": written[0]} | ({} if source.gain == 1.0 else {"scale": source.gain})
    return {"image": context.pictures.baked(value.name, value.data)}


def _add(context, world, owner, rays, radiance, fields=None):
    if radiance is not None and not any(radiance) and not (context.motion is not None and is_animated(world)):
        return
    if context.world_medium is not None:
        context.report.leave_out(f"the light of {owner}: none gets through the medium that fills it")
        return
    visible = _visible(context, world, rays)
    if visible == []:
        return
    key, name = (("world",), world.name) if len(rays) == len(PATHS) else (("world", *rays), f"{world.name} {rays[0]}")
    light = {"name": context.names.get(key, name), "type": "environment"}
    if visible is not None:
        light["visible"] = visible
    context.add_surroundings(light | (fields or {"radiance": radiance}), rays)


def _visible(context, world, rays):
    seen = world.cycles_visibility if hasattr(world, "cycles_visibility") else None
    flags = {
        "camera": (seen is None or seen.camera) and not context.scene.render.film_transparent,
        "reflected": seen is None or seen.glossy,
        "refracted": seen is None or seen.transmission,
        "shadow": seen is None or seen.diffuse,
        "photon": seen is None or seen.diffuse or seen.scatter,
    }
    seen_by = [name for name, sees in flags.items() if sees and name in rays]
    return None if len(seen_by) == len(flags) else seen_by


def name_world_medium(context):
    """`[world]`."""
    medium = context.world_medium
    return {} if medium is None else {"medium": medium_name(context, medium, "world")}


