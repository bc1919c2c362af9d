"""Volume shaders as media.

sigma_a and sigma_s follow from colours and density as Cycles defines them (Blender's manual: Volume Scatter, Volume
Absorption, Principled Volume).
"""

from dataclasses import dataclass, field, replace

import numpy as np

from .arithmetic import is_graph
from .bakes import upstream
from .graph import Place, follow, output_node
from .nodes import Reader
from .texture_nodes import ANYWHERE, coordinates
from .values import NotShown


@dataclass(frozen=True)
class Glow:
    """Emission of a volume: strength times colour per length, as in Cycles."""

    color: tuple
    """W/(m^2 sr) per scene unit; with a temperature, the fraction of a black body's emission per scene unit."""
    grid: str | None = None
    """Name of a volume object's grid that multiplies it; without such a grid the emission is zero."""
    kelvin: float | None = None
    """Temperature of a black body."""
    temperature: str | None = None
    """Name of a grid that multiplies the temperature, if there is such a grid."""

    def table(self, grid):
        """The field `emission`, None for zero. `grid`: maps a grid's name to the scene file's grid, or None."""
        fields = {"color": _short(self.color)}
        if self.grid is not None:
            fields["field"] = grid(self.grid)
            if fields["field"] is None:
                return None
        if self.kelvin is not None:
            by = None if self.temperature is None else grid(self.temperature)
            fields |= {"temperature": self.kelvin} if by is None else {"temperature": by, "kelvin": self.kelvin}
        return fields if len(fields) > 1 else fields["color"]


# Cycles' unit for black bodies in volumes is a watt per square millimetre and kelvin to the fourth.
BLACK_BODY = 1e-6


@dataclass(frozen=True)
class Medium:
    """Coefficients per scene unit, and per unit of density where the density is a grid."""

    sigma_a: tuple
    sigma_s: tuple
    lobes: tuple = ()
    """(g, share of the scattering) of each phase function."""
    grid: str | None = None
    """Name of a volume object's grid that multiplies the coefficients."""
    grid_is_optional: bool = False
    """Without such a grid the coefficients are used as they are, as for Principled Volume."""
    texture: object = None
    """`Shade` that multiplies the coefficients."""
    albedo: object = None
    """`Shade` of the fraction of the extinction that scatters; `sigma_s` is then the whole extinction."""
    glow: Glow | None = None
    """Its emission, independent of its density."""

    def is_empty(self):
        return not any(self.sigma_a) and not any(self.sigma_s) and self.glow is None

    def is_shaded(self):
        """Whether it varies with textures."""
        return self.texture is not None or self.albedo is not None

    def scaled(self, factor):
        return replace(
            self,
            sigma_a=tuple(factor * number for number in self.sigma_a),
            sigma_s=tuple(factor * number for number in self.sigma_s),
            glow=self.glow and replace(self.glow, color=tuple(factor * number for number in self.glow.color)),
        )

    def table(self, grid=lambda name: None, albedo=None):
        """The medium's fields without type and density. `grid`: maps a grid's name to the scene file's grid. `albedo`:
        the same for the texture of the albedo."""
        if albedo is None:
            fields = {"sigma_a": _short(self.sigma_a), "sigma_s": _short(self.sigma_s)}
        else:
            fields = {"sigma_t": _short(self.sigma_s), "albedo": albedo}
        emission = self.glow and self.glow.table(grid)
        if emission is not None:
            fields["emission"] = emission
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
    """The sum of two media in one place."""
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
        a.albedo or b.albedo,
        _glows(a.glow, b.glow),
    )


def _glows(a, b):
    """The sum of both, or the first if they cannot be added."""
    if a is None or b is None or not _add_up(a, b):
        return a or b
    return replace(a, color=tuple(x + y for x, y in zip(a.color, b.color)))


def _add_up(a, b):
    return (a.grid, a.kelvin, a.temperature) == (b.grid, b.kelvin, b.temperature)


@dataclass(frozen=True)
class Shade:
    """A density or a colour that is a texture graph."""

    owner: str
    output: tuple
    """Which of Blender's outputs it is."""
    value: object = field(compare=False)


class VolumeReader(Reader):
    """Reads volume shaders of one tree."""

    has_colors = False
    """Whether its owner may have colours that vary in space."""

    def medium(self, place):
        found = follow(place)
        if found is None or not found.socket.is_output or found.node.mute:
            return None
        handler = VOLUMES.get(found.node.type)
        if handler is None:
            if found.node.type.startswith(SURFACES):
                self.context.report.note(f"{self.owner}: '{found.node.name}' has no effect in a volume, as in Cycles")
            else:
                self.lack(found.node)
            return None
        return handler(self, found)

    def constant(self, place, name, otherwise):
        """A number or three; a value that varies in space is left out."""
        value = self.get(place, name)
        if value is None:
            return otherwise
        if value.is_constant:
            return value.data
        self.lack(place.node, f"{name.lower()} by texture")
        return otherwise

    def by_grid(self, place, name):
        """(factor, grid) for an input linked to an Attribute node, or to the product of one and a number; otherwise
        None."""
        found = follow(place.input(name))
        if found is None or not found.socket.is_output:
            return None
        grid = _grid(found)
        if grid is not None:
            return 1.0, grid
        node = found.node
        if node.type == "MATH" and node.operation == "MULTIPLY":
            for here, other in ((0, 1), (1, 0)):
                grid = _grid(follow(Place(node.inputs[here], found.groups)))
                if grid is not None and not node.inputs[other].is_linked:
                    return float(node.inputs[other].default_value), grid
        return None

    def density(self, place):
        """(number, grid or None, `Shade` or None) for a Density input."""
        found = self.by_grid(place, "Density")
        if found is not None:
            return *found, None
        shade = self.shade(place, "Density")
        if shade is not None:
            return 1.0, None, shade
        value = self.constant(place, "Density", np.array([0.0]))
        return max(float(np.mean(value)), 0.0), None, None

    def glow(self, place, strength, color):
        """`Glow` for inputs of strength and colour, or None."""
        found = self.by_grid(place, strength)
        if found is not None:
            factor, grid = found
        else:
            factor, grid = float(np.mean(self.constant(place, strength, [0.0]))), None
        shade = _rgb(self.constant(place, color, [1.0] * 3)) * max(factor, 0.0)
        return Glow(_tuple(shade), grid) if shade.any() else None

    def shade(self, place, name):
        """The `Shade` of an input that varies in space; None for one that does not, or that the scene file cannot
        express."""
        reader = ShadeReader(self.context, self.owner, self.scope)
        value = reader.get(place, name)
        if value is None or not is_graph(value) or reader.has_grid:
            return None
        return Shade(self.owner, (value.special["texture"].key, value.special["output"]), value)


# Outputs of the node Volume Info, and their grids.
VOLUME_INFO = {"Density": "density", "Flame": "flame", "Temperature": "temperature"}


def _grid(found):
    """Name of the grid that an output stands for, or None."""
    if found is None or not found.socket.is_output:
        return None
    if found.node.type == "ATTRIBUTE":
        return found.node.attribute_name
    return VOLUME_INFO.get(found.socket.name) if found.node.type == "VOLUME_INFO" else None


class ShadeReader(Reader):
    """Reads densities and colours that vary in space."""

    has_grid = False

    def _of(self, place):
        kind = place.node.type
        if kind in ("ATTRIBUTE", "VERTEX_COLOR", "VOLUME_INFO"):
            self.has_grid = True
            raise NotShown("a grid")
        if kind in ("TEX_IMAGE", "TEX_CHECKER"):
            # There is no UV inside a volume.
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
    emitted = _rgb(reader.constant(place, "Emission Coefficients", [0.0] * 3))
    glow = Glow(_tuple(emitted)) if emitted.any() else None
    return Medium(_tuple(absorbed), _tuple(scattered), ((_g(reader, place), 1.0),), glow=glow)


def _emission(reader, place):
    nothing = (0.0, 0.0, 0.0)
    return Medium(nothing, nothing, glow=reader.glow(place, "Strength", "Color"))


def _principled(reader, place):
    dark = _rgb(reader.constant(place, "Absorption Color", [0.0] * 3))
    # What is not scattered is absorbed, or everything if the absorption colour is black.
    tint = reader.shade(place, "Color") if reader.has_colors and not dark.any() else None
    color = _rgb(reader.constant(place, "Color", [0.5] * 3)) if tint is None else np.ones(3)
    density, grid, shade = reader.density(place)
    socket = place.input("Color Attribute")
    if socket is not None and socket.socket.default_value:
        reader.lack(place.node, "the color attribute")
    name = place.input("Density Attribute")
    is_optional = name is not None and bool(name.socket.default_value) and grid is None and shade is None
    if is_optional:
        grid = name.socket.default_value
    glow, hot = reader.glow(place, "Emission Strength", "Emission Color"), _black_body(reader, place)
    if glow is not None and hot is not None:
        reader.lack(place.node, "emission in addition to a black body's, which is used")
    absorbed = np.maximum(1.0 - color, 0.0) * np.maximum(1.0 - np.sqrt(dark), 0.0)
    lobes = ((_g(reader, place), 1.0),)
    sigmas = _tuple(absorbed * density), _tuple(color * density)
    return Medium(*sigmas, lobes, grid, is_optional, shade, tint, hot or glow)


def _black_body(reader, place):
    """`Glow` of Principled Volume's black body, or None."""
    tint = reader.glow(place, "Blackbody Intensity", "Blackbody Tint")
    if tint is None or max(tint.color) < 1e-3 * BLACK_BODY:
        return None
    kelvin = float(np.mean(reader.constant(place, "Temperature", [1000.0])))
    name = place.input("Temperature Attribute")
    grid = name.socket.default_value if name is not None else ""
    color = tuple(BLACK_BODY * number for number in tint.color)
    return replace(tint, color=color, kelvin=max(kelvin, 0.0), temperature=grid or None)


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
    kinds = [None if part is None else (part.grid, part.texture, part.albedo) for part in (a, b)]
    if a is not None and b is not None and kinds[0] != kinds[1]:
        if any(b.sigma_a) or any(b.sigma_s):
            if any(a.sigma_a) or any(a.sigma_s):
                reader.lack(place.node, "volumes of different densities or colours; the first is used")
                return a
            # One of them only emits.
            a, b = b, a
        b = replace(b, grid=a.grid, grid_is_optional=a.grid_is_optional, texture=a.texture, albedo=a.albedo)
    if a is not None and b is not None and a.glow is not None and b.glow is not None and not _add_up(a.glow, b.glow):
        reader.lack(place.node, "two kinds of emission; one is used")
    return sum_of(a, b)


VOLUMES = {
    "VOLUME_SCATTER": _scatter,
    "VOLUME_ABSORPTION": _absorption,
    "VOLUME_COEFFICIENTS": _coefficients,
    "PRINCIPLED_VOLUME": _principled,
    "EMISSION": _emission,
    "ADD_SHADER": _add,
    "MIX_SHADER": _mix,
}


# Prefixes of shader types that are for surfaces only.
SURFACES = ("BSDF_", "SUBSURFACE_")


def is_volume(output):
    """Whether the node linked to an output node's Volume can be a volume shader."""
    found = follow(Place(output.inputs["Volume"]))
    if found is None or not found.socket.is_output:
        return False
    shaders = [here.node.type for here in upstream(found) if here.socket.type == "SHADER"]
    return not shaders or any(not kind.startswith((*SURFACES, "ADD_", "MIX_")) for kind in shaders)


def read_volume(context, tree, kind, owner, scope="", has_colors=False):
    """The `Medium` of a tree's output node of the class `kind`; None if there is none. `scope`: first part of the names
    of its textures. `has_colors`: it may have colours that vary in space."""
    output = None if tree is None else output_node(tree, kind)
    if output is None or not output.inputs["Volume"].is_linked:
        return None
    reader = VolumeReader(context, owner, scope)
    reader.has_colors = has_colors
    medium = reader.medium(Place(output.inputs["Volume"]))
    return None if medium is None or medium.is_empty() else medium
