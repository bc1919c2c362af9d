"""Volume shaders as media.

sigma_a and sigma_s follow from colours and density as Cycles defines them (Blender's manual: Volume Scatter, Volume
Absorption, Principled Volume).
"""

from dataclasses import dataclass, field, replace

import numpy as np

from .arithmetic import is_graph
from .graph import Place, follow, output_node
from .nodes import Reader
from .texture_nodes import ANYWHERE, coordinates
from .values import NotShown


@dataclass(frozen=True)
class Medium:
    """Coefficients per scene unit, and per unit of density where the density is a grid."""

    sigma_a: tuple
    sigma_s: tuple
    lobes: tuple = ()
    """(g, share of what is scattered) of each phase function."""
    grid: str | None = None
    """Name of the grid of a volume object that the coefficients are multiplied by."""
    grid_is_optional: bool = False
    """Without such a grid the coefficients hold as they are, as they do for Principled Volume."""
    texture: object = None
    """`Shade` that the coefficients are multiplied by."""

    def is_empty(self):
        return not any(self.sigma_a) and not any(self.sigma_s)

    def scaled(self, factor):
        return replace(
            self,
            sigma_a=tuple(factor * number for number in self.sigma_a),
            sigma_s=tuple(factor * number for number in self.sigma_s),
        )

    def table(self):
        fields = {"sigma_a": _short(self.sigma_a), "sigma_s": _short(self.sigma_s)}
        lobes = [(g, share) for g, share in self.lobes if share > 0.0]
        phase = _phase(lobes)
        return fields | ({} if phase == "isotropic" else {"phase": phase})


def _short(numbers):
    numbers = [float(number) for number in numbers]
    return numbers[0] if numbers[0] == numbers[1] == numbers[2] else numbers


def _phase(lobes):
    if not lobes:
        return "isotropic"
    g, share = lobes[0]
    first = "isotropic" if g == 0.0 else {"type": "hg", "g": g}
    if len(lobes) == 1:
        return first
    rest = sum(share for _, share in lobes[1:])
    return {"type": "blend", "weight": rest / (share + rest), "phases": [first, _phase(lobes[1:])]}


def sum_of(a, b):
    """Two media in one place."""
    if a is None or b is None:
        return a if b is None else b
    weights = {}
    for medium in (a, b):
        for g, share in medium.lobes:
            weights[g] = weights.get(g, 0.0) + share * sum(medium.sigma_s)
    whole = sum(weights.values())
    return Medium(
        tuple(x + y for x, y in zip(a.sigma_a, b.sigma_a)),
        tuple(x + y for x, y in zip(a.sigma_s, b.sigma_s)),
        tuple((g, weight / whole) for g, weight in sorted(weights.items()) if whole > 0.0),
        a.grid or b.grid,
        a.grid_is_optional or b.grid_is_optional,
        a.texture or b.texture,
    )


@dataclass(frozen=True)
class Shade:
    """A density that is a texture graph."""

    owner: str
    output: tuple
    """Which of Blender's outputs it is."""
    value: object = field(compare=False)


class VolumeReader(Reader):
    """Reads volume shaders of one tree."""

    def medium(self, place):
        found = follow(place)
        if found is None or not found.socket.is_output or found.node.mute:
            return None
        handler = VOLUMES.get(found.node.type)
        if handler is None:
            self.lack(found.node)
            return None
        return handler(self, found)

    def constant(self, place, name, otherwise):
        """A number or three; what varies in space is left out."""
        value = self.get(place, name)
        if value is None:
            return otherwise
        if value.is_constant:
            return value.data
        self.lack(place.node, f"{name.lower()} by texture")
        return otherwise

    def density(self, place):
        """(number, grid or None, `Shade` or None) of a Density input: an Attribute node stands for a grid."""
        found = follow(place.input("Density"))
        factor, grid = 1.0, None
        if found is not None and found.socket.is_output:
            node = found.node
            if node.type == "ATTRIBUTE":
                return 1.0, node.attribute_name, None
            if node.type == "VOLUME_INFO" and found.socket.name == "Density":
                return 1.0, "density", None
            if node.type == "MATH" and node.operation == "MULTIPLY":
                for here, other in ((0, 1), (1, 0)):
                    inner = follow(Place(node.inputs[here], found.groups))
                    is_grid = inner.socket.is_output and inner.node.type in ("ATTRIBUTE", "VOLUME_INFO")
                    if is_grid and not node.inputs[other].is_linked:
                        grid = inner.node.attribute_name if inner.node.type == "ATTRIBUTE" else "density"
                        return float(node.inputs[other].default_value), grid, None
        shade = self._shade(place)
        if shade is not None:
            return 1.0, None, shade
        value = self.constant(place, "Density", np.array([0.0]))
        return max(float(np.mean(value)), 0.0) * factor, grid, None

    def _shade(self, place):
        """A density that varies in space, None for one that does not, or that the scene file has no word for."""
        reader = ShadeReader(self.context, self.owner, self.scope)
        value = reader.get(place, "Density")
        if value is None or not is_graph(value) or reader.has_grid:
            return None
        return Shade(self.owner, (value.special["texture"].key, value.special["output"]), value)


class ShadeReader(Reader):
    """Reads densities that vary in space."""

    has_grid = False

    def _of(self, place):
        kind = place.node.type
        if kind in ("ATTRIBUTE", "VERTEX_COLOR", "VOLUME_INFO"):
            self.has_grid = True
            raise NotShown("a grid")
        if kind in ("TEX_IMAGE", "TEX_CHECKER"):
            # These have no UV in here.
            raise NotShown("in a volume")
        return super()._of(place)


def _coordinates(reader, place):
    node, name = place.node, place.socket.name
    if name not in ("Generated", "Object") or node.object is not None:
        raise NotShown(f"{name.lower()} coordinates")
    return coordinates(reader, place, name.lower())


def _geometry(reader, place):
    if place.socket.name != "Position":
        raise NotShown(place.socket.name)
    return coordinates(reader, place, "world")


ShadeReader.graphs = ANYWHERE | {"TEX_COORD": _coordinates, "NEW_GEOMETRY": _geometry}


def _rgb(numbers):
    numbers = np.maximum(np.asarray(numbers, dtype=np.float64), 0.0)
    return np.repeat(numbers, 3) if numbers.size == 1 else numbers


def _tuple(numbers):
    return tuple(float(number) for number in numbers)


def _scatter(reader, place):
    color = _rgb(reader.constant(place, "Color", [0.8] * 3))
    density, grid, shade = reader.density(place)
    phase = getattr(place.node, "phase", "HENYEY_GREENSTEIN")
    if phase != "HENYEY_GREENSTEIN":
        reader.lack(place.node, f"phase function {phase.lower().replace('_', ' ')}; Henyey-Greenstein stands in")
    g = _g(reader, place)
    return Medium((0.0, 0.0, 0.0), _tuple(color * density), ((g, 1.0),), grid, texture=shade)


def _g(reader, place):
    g = float(np.mean(reader.constant(place, "Anisotropy", [0.0])))
    return min(max(g, -0.99), 0.99)


def _absorption(reader, place):
    color = _rgb(reader.constant(place, "Color", [0.8] * 3))
    density, grid, shade = reader.density(place)
    return Medium(_tuple(np.maximum(1.0 - color, 0.0) * density), (0.0, 0.0, 0.0), (), grid, texture=shade)


def _coefficients(reader, place):
    """Volume Coefficients: the coefficients as they are."""
    absorbed = _rgb(reader.constant(place, "Absorption Coefficients", [0.0] * 3))
    scattered = _rgb(reader.constant(place, "Scatter Coefficients", [0.0] * 3))
    _emits(reader, place, "Emission Coefficients")
    return Medium(_tuple(absorbed), _tuple(scattered), ((_g(reader, place), 1.0),))


def _principled(reader, place):
    color = _rgb(reader.constant(place, "Color", [0.5] * 3))
    dark = _rgb(reader.constant(place, "Absorption Color", [0.0] * 3))
    density, grid, shade = reader.density(place)
    for name in ("Color Attribute", "Temperature Attribute"):
        socket = place.input(name)
        if name == "Color Attribute" and socket is not None and socket.socket.default_value:
            reader.lack(place.node, "the color attribute")
    name = place.input("Density Attribute")
    is_optional = name is not None and bool(name.socket.default_value) and grid is None and shade is None
    if is_optional:
        grid = name.socket.default_value
    _emits(reader, place, "Emission Strength")
    _emits(reader, place, "Blackbody Intensity")
    absorbed = np.maximum(1.0 - color, 0.0) * np.maximum(1.0 - np.sqrt(dark), 0.0)
    lobes = ((_g(reader, place), 1.0),)
    return Medium(_tuple(absorbed * density), _tuple(color * density), lobes, grid, is_optional, shade)


def _emits(reader, place, name):
    value = reader.get(place, name)
    if value is not None and not (value.is_constant and not any(value.color())):
        reader.lack(place.node, "a volume that shines")


def _add(reader, place):
    inputs = place.node.inputs
    return _join(reader, place, *(reader.medium(Place(inputs[i], place.groups)) for i in (0, 1)))


def _mix(reader, place):
    factor = reader.value(Place(place.node.inputs[0], place.groups)).as_float()
    if not factor.is_constant:
        reader.lack(place.node, "a factor by texture")
        return None
    share = min(max(factor.number(), 0.0), 1.0)
    parts = [reader.medium(Place(place.node.inputs[i], place.groups)) for i in (1, 2)]
    scaled = [None if part is None else part.scaled(by) for part, by in zip(parts, (1.0 - share, share))]
    return _join(reader, place, *scaled)


def _join(reader, place, a, b):
    if a is not None and b is not None and (a.grid != b.grid or a.texture != b.texture):
        reader.lack(place.node, "volumes of different densities; the first counts")
        return a
    return sum_of(a, b)


VOLUMES = {
    "VOLUME_SCATTER": _scatter,
    "VOLUME_ABSORPTION": _absorption,
    "VOLUME_COEFFICIENTS": _coefficients,
    "PRINCIPLED_VOLUME": _principled,
    "ADD_SHADER": _add,
    "MIX_SHADER": _mix,
}


def read_volume(context, tree, kind, owner, scope=""):
    """`Medium` of a tree's output node of the class `kind`; None where there is none. `scope`: first part of the names
    of its textures."""
    output = None if tree is None else output_node(tree, kind)
    if output is None or not output.inputs["Volume"].is_linked:
        return None
    medium = VolumeReader(context, owner, scope).medium(Place(output.inputs["Volume"]))
    return None if medium is None or medium.is_empty() else medium
