"""Materials of Blender: the surface, emission and medium of a mesh's slots."""

from dataclasses import dataclass, field, replace

from . import records
from .animated import is_animated
from .arithmetic import is_graph
from .media import read_volume
from .mixes import BLACK
from .panes import is_rough, pane_of
from .spaces import own_of, reached
from .subsurface import is_beneath
from .surfaces import read_surface
from .tangents import ALPHA, AlongUv
from .values import NotShown, Value, constant

NUMBERS = {"alpha", "metallic", "roughness", "specular", "opacity", "weight"}
NUMBERS |= {"spec_trans", "sheen", "clearcoat", "clearcoat_gloss", "subsurface"}
NUMBERS |= {"coat_weight", "coat_roughness", "thin_film_thickness"}
NUMBERS |= {"sheen_weight", "sheen_roughness", "diffuse_roughness"}
NUMBERS |= {"anisotropic", "anisotropic_rotation", "alpha_u", "alpha_v"}
BOUNDARIES = {"dielectric", "rough_dielectric", "null"}


@dataclass
class Slot:
    """What a shape takes from a material."""

    material: str | None
    table: dict | None
    emission: dict | None = None
    medium: object = None
    """`media.Medium` inside, or None."""
    uv_map: str = ""
    attribute: str | None = None
    """Name of the attribute that becomes vertex colours."""
    is_animated: bool = False
    """Whether it may change over time."""
    extra: dict = field(default_factory=dict)
    """Further tables that `material` refers to, by name."""
    textures: dict = field(default_factory=dict)
    """The graphs that it uses, by name."""
    own: set = field(default_factory=set)
    """What its graphs require of their object: `spaces.OWN`."""
    displacement: dict | None = None
    """Fields of a shape's `displacement` without `edge`, and `in_world`."""
    grows: bool = False
    """Whether the heights of its bumps grow with the object's scale."""
    pane: object = None
    """The `Slot` to use instead on meshes that are not closed, for glass without a volume; or None."""
    wants: tuple = ()
    """Outputs of nodes to bake, separately for each object."""
    is_rough: bool = False
    """For a pane: whether the original glass is rough, which a pane cannot be."""

    @property
    def is_beneath(self):
        """Whether light enters a medium of the material's own below the surface."""
        return is_beneath(self.table, self.extra)

    @property
    def is_boundary(self):
        """Whether the surface can have a medium behind it."""
        return self.table is not None and _bounds(self.table, self.extra) is True


def _bounds(table, others):
    """Whether a surface bounds media; None for an opaque one."""
    if "opacity" in table:
        return False
    if table["type"] == "blend":
        parts = [_bounds(others[name], others) for name in table["materials"]]
        told = [part for part in parts if part is not None]
        return all(told) if told else None
    if table["type"] in BOUNDARIES or "spec_trans" in table:
        return True
    return False if table["type"] == "thin_dielectric" else None


def _is_opaque(table, others):
    """Whether a surface is opaque."""
    if "opacity" in table:
        return False
    if table["type"] == "blend":
        return all(_is_opaque(others[name], others) for name in table["materials"])
    return table["type"] not in {*BOUNDARIES, "thin_dielectric", "translucent", "hair"} and "spec_trans" not in table


# Cycles shows objects without a material as 0.8 grey.
PLAIN = {"type": "diffuse", "reflectance": 0.8, "two_sided": True}


def slot(context, material, placed=None):
    """The `Slot` of a Blender material, or of none; call `take` for the one that is used. `placed`: the object on which
    parts of it were baked.
    """
    key = ("material", material.original.session_uid if material is not None else None)
    if placed is not None:
        key = (*key, placed.uid)
    if key not in context.slots:
        context.slots[key] = _read(context, material, placed)
        context.slots[key].is_animated = is_animated(material)
    return context.slots[key]


def take(context, found):
    """Puts the material of a `Slot` into the scene file. Returns the slot."""
    if found.material is not None:
        context.materials[found.material] = found.table
    context.materials.update(found.extra)
    context.textures.update(found.textures)
    return found


def _read(context, material, placed):
    if material is None:
        return Slot(context.material_names.get(None, "no material"), PLAIN)
    owner, key = f"material '{material.name}'", material.original.session_uid
    scope = context.material_names.get(key, material.name)
    bake = None if context.bakes is None else lambda place: None
    if placed is not None:
        owner, key = f"{owner} on '{placed.name}'", (key, "baked", placed.uid)
        scope = context.material_names.get(key, f"{material.name} on {placed.name}")
        bake = lambda place: context.bakes.of_surface(placed, material, place)
    surface = read_surface(context, material, owner, scope, bake, placed is not None)
    medium = None
    if material.use_nodes:
        medium = read_volume(context, material.node_tree, "ShaderNodeOutputMaterial", owner, scope, has_colors=True)
    found = _Writer(context, owner, scope).slot(surface, medium)
    found.wants = surface.wants
    pane = None if medium is not None else pane_of(surface.bsdf)
    if pane is not None and found.table["type"] != "null":
        name = context.material_names.get((key, "pane"), f"{material.name} pane")
        found.pane = _Writer(context, owner, name).slot(replace(surface, bsdf=pane), None)
        found.pane.is_rough = is_rough(surface.bsdf)
    return found


class _Writer:
    """Turns values into fields, and collects the UV map that they need."""

    def __init__(self, context, owner, name):
        self.context = context
        self.owner = owner
        self.name = name
        self.uv_maps = []
        self.attributes = []
        self.extra = {}

    def slot(self, surface, medium):
        opacity = surface.opacity
        if opacity.is_constant and opacity.number() <= 0.0:
            table = {"type": "null"}
        else:
            table = self.table(surface.bsdf or BLACK, surface.turned)
            if not (opacity.is_constant and opacity.number() >= 1.0):
                table["opacity"] = self.field("opacity", opacity)
        emission = None
        if surface.emission is not None:
            try:
                emission = self.emission(surface.emission)
            except NotShown as problem:
                self.context.report.leave_out(f"emission of {self.owner}: {problem}")
        displacement = None
        if surface.displacement is not None and table["type"] != "null":
            displacement = self.displacement(surface.displacement)
        if len(self.uv_maps) > 1:
            self.context.report.note(f"{self.owner}: all its textures use the UV map '{self.uv_maps[0] or 'active'}'")
        found = Slot(self.name, table, emission, medium, extra=self.extra)
        found.uv_map = self.uv_maps[0] if self.uv_maps else ""
        if len(self.attributes) > 1:
            self.context.report.leave_out(f"attributes of {self.owner}: all are '{self.attributes[0] or 'active'}'")
        found.attribute = self.attributes[0] if self.attributes else None
        found.displacement = displacement
        tables = [found.table, found.emission, found.extra, found.displacement]
        found.textures = reached(tables, self.context.textures)
        found.own = own_of([*tables, found.textures])
        found.grows = bool(surface.turned and surface.turned.get("grows")) and table["type"] != "null"
        if medium is not None and not found.is_boundary:
            if _is_opaque(found.table, found.extra):
                self.context.report.note(f"the volume of {self.owner} is not visible: its surface is opaque")
            else:
                self.context.report.leave_out(f"the volume of {self.owner}, whose surface cannot bound one")
            found.medium = None
        return found

    def table(self, bsdf, turned=None):
        table = {}
        for name, value in bsdf.items():
            if name == "materials":
                table[name] = [self.nested(inner, turned) for inner in value]
            elif isinstance(value, Value):
                table[name] = self.field(name, value)
            elif name == "coat_turned":
                own = self.turned(value, "coat ")
                table |= {f"coat_{key}": made for key, made in own.items()} or {"coat_levels": True}
            elif isinstance(value, AlongUv):
                # Fields left at their defaults.
                self.wants(value.uv_map)
            else:
                table[name] = value
        if turned is not None and bsdf["type"] != "blend":
            table |= self.turned(turned)
        return table

    def nested(self, bsdf, turned):
        name = f"{self.name}.{len(self.extra) + 1}"
        self.extra[name] = None
        self.extra[name] = self.table(bsdf, turned)
        return name

    def turned(self, turned, of=""):
        fields = {}
        if "bump" in turned:
            fields["bump"] = self.bump(turned, of=of)
        if "normal_map" in turned:
            texture = records.texture(self.seen(turned["normal_map"]), self.context, self.owner, None)
            texture.pop("raw", None)
            fields["normal_map"] = texture
        return fields

    def bump(self, turned, number=1, of=""):
        value = self.seen(turned["bump"])
        if is_graph(value):
            name = of + ("bump" if number == 1 else f"bump {number}")
            texture = records.Graphs(self.context, self.owner).named(value, self.name, name)
        else:
            texture = records.number_texture(value, self.context, self.owner, None)
        table = texture | {"scale": turned["scale"]}
        if "strength" in turned:
            table["strength"] = turned["strength"]
        if "over" in turned:
            table["over"] = self.bump(turned["over"], number + 1, of)
        return table

    def displacement(self, moved):
        value = self.seen(moved["height"])
        if value.is_constant:
            height = value.number()
        elif is_graph(value):
            height = records.Graphs(self.context, self.owner).named(value, self.name, "displacement")
        else:
            height = records.number_texture(value, self.context, self.owner, None)
        return moved | {"height": height}

    def field(self, name, value):
        try:
            self.seen(value)
            if name in NUMBERS:
                if name in ("alpha_u", "alpha_v") and value.is_constant:
                    return min(max(value.number(), ALPHA[0]), ALPHA[1])
                low = 0.001 if name == "alpha" else 0.0
                return records.number(value, self.context, self.owner, low)
            return records.color(value, self.context, self.owner, None if name == "radiance" else 1.0)
        except NotShown as problem:
            self.context.report.leave_out(f"a texture of {self.owner}: {problem}")
            return records.color(constant(0.5, 0.5, 0.5), self.context, self.owner)

    def emission(self, value):
        """Fields of a shape's `emission`."""
        if value.is_constant:
            return {"radiance": self.field("radiance", value)}
        value = self.seen(value.as_color())
        if is_graph(value):
            gain = value.special.get("scale", 1.0)
            value = replace(value, special=value.special | {"scale": 1.0})
            table = records.Graphs(self.context, self.owner).named(value, self.name, "emission")
            return {"radiance": table} | ({} if gain == 1.0 else {"scale": gain})
        table = records.texture(value, self.context, self.owner, None)
        # Baked numbers already include their factor.
        is_file = value.source is not None and not value.source.image.is_float
        gain = value.source.gain if is_file else table.pop("scale", 1.0)
        return {"radiance": table} | ({} if gain == 1.0 else {"scale": gain})

    def seen(self, value):
        if is_graph(value):
            for node, leaf in records.inputs_of(value):
                if leaf is not None:
                    self.seen(leaf)
                elif node.uv_map is not None:
                    self.wants(node.uv_map)
            return value
        if value.special is not None and "attribute" in value.special and value.name not in self.attributes:
            self.attributes.append(value.name)
        if value.lookup is not None:
            self.wants(value.lookup.uv_map)
        return value

    def wants(self, uv_map):
        if uv_map not in self.uv_maps:
            self.uv_maps.append(uv_map)
