"""What the parts of one export share."""

from dataclasses import dataclass, field

from .files import Files
from .names import Names
from .pictures import Pictures
from .report import Report
from .settings import ExportSettings


@dataclass
class Placed:
    """An object at one of its places."""

    object: object
    """None once the depsgraph shows the next one: of an instance Blender makes it for the moment, in memory that it
    uses again."""
    name: str
    uid: int
    """`session_uid` of the object."""
    key: tuple
    """The same in each export; for instances with their numbers in it."""
    matrix: object
    instancer: int | None = None
    """`session_uid` of the object that makes it as an instance; None for objects of the scene."""
    visible: list | None = None
    """The rays that see it, None for all: of objects that are not lights."""
    mesh: tuple | None = None
    """One for each mesh that is written: object, data, the evaluated data's place in memory, instancer."""
    steps: int = 0
    """Motion steps as Cycles counts them: keys at 2**steps + 1 times; 0 for what is not blurred."""
    deforms: bool = False
    """Whether the motion of its vertices is blurred."""
    random: int = 0
    """Blender's random number of it, 32 bits."""
    index: int = 0
    """Its pass index."""
    edge: float | None = None
    """How long edges of its mesh are where it is subdivided for displacement; None where it is not."""


@dataclass
class Source:
    """What a table of shapes or lights comes from, for keys at other times."""

    keys: list
    """One for each place, the same at all times: of the object at its place, and which part of it this is."""
    steps: int
    deforms: bool = False
    geometry: object = None
    """`geometry.Geometry` and what of it goes into the file; None for what is no mesh."""
    variant: tuple | None = None
    within: object = None
    """Matrix that comes before that of the object, if the object's is to be moved by itself."""


@dataclass
class Context:
    """Tables of the scene file as they grow, and what is asked for on the way."""

    depsgraph: object
    scene: object
    settings: ExportSettings
    files: Files
    pictures: Pictures
    report: Report
    slots: dict
    """`materials.Slot` by material; kept from export to export."""
    geometries: dict
    """`geometry.Geometry` by object; likewise."""
    names: Names = field(default_factory=Names)
    material_names: Names = field(default_factory=Names)
    media_names: Names = field(default_factory=Names)
    texture_names: Names = field(default_factory=Names)
    world_medium: object = None
    textures: dict = field(default_factory=dict)
    """Graphs by name, also of what is not in the scene file in the end."""
    written: dict = field(default_factory=dict)
    """Name of a texture by its `arithmetic.Node` and what the name is for."""
    media: dict = field(default_factory=dict)
    materials: dict = field(default_factory=dict)
    shapes: list = field(default_factory=list)
    lights: list = field(default_factory=list)
    groups: dict = field(default_factory=dict)
    rules: list = field(default_factory=list)
    without_shadows: list = field(default_factory=list)
    """Names of lights."""
    shown: dict = field(default_factory=dict)
    """Names of shapes and lights by `session_uid` of the object that they come from."""

    motion: object = None
    """`motion.Moment`, where the scene is read at several times."""
    sources: dict = field(default_factory=dict)
    """`Source` by `id` of a table of shapes or lights."""
    nearest: dict = field(default_factory=dict)
    """Distance of what is nearest to lights at their places, the same at all times."""
    soft: list = field(default_factory=list)
    """Tables of lights with soft falloff that does not show on surfaces."""
    bakes: object = None
    """`bakes.Bakes`, where Blender may bake what no node says."""
    counts: dict = field(default_factory=dict)
    """How many parts of an object at its place there are so far."""

    def part(self, placed, kind):
        """The key of one more part of this kind of an object at its place."""
        count = self.counts.get((placed.key, kind), 0)
        self.counts[placed.key, kind] = count + 1
        return placed.key, kind, count

    def add_medium(self, placed, name, medium):
        """Adds to `[media]` what moves with an object."""
        self.media[name] = medium
        if self.motion is not None:
            self.sources[id(medium)] = Source([], placed.steps)

    def add_light(self, placed, light):
        """Adds to `[[lights]]`."""
        self.lights.append(light)
        if self.motion is not None:
            self.sources[id(light)] = Source([self.part(placed, "light")], placed.steps)

    def add_surroundings(self, light, rays):
        """Adds the light of the world, or what some kinds of rays see of it."""
        self.lights.append(light)
        if self.motion is not None:
            self.sources[id(light)] = Source([("world", *rays)], 1)

    def add_shape(self, placed, shape, kind="shape", **source):
        """Adds to `[[shapes]]` what is at one place."""
        self.shapes.append(shape)
        if self.motion is not None:
            self.sources[id(shape)] = Source([self.part(placed, kind)], placed.steps, placed.deforms, **source)

    def add_copies(self, places, shape, kind="shape", **source):
        """Adds to `[[shapes]]` instances of one thing at these places, with a number at each."""
        self.shapes.append(shape)
        if self.motion is not None:
            keys = [self.part(placed, (kind, number)) for placed, number in places]
            placed = places[0][0]
            self.sources[id(shape)] = Source(keys, placed.steps, placed.deforms, **source)

    def show(self, placed, name):
        """Notes that `name` stands for an object and for what makes it as an instance, for rules."""
        for uid in (placed.uid, placed.instancer):
            if uid is not None and name not in self.shown.setdefault(uid, []):
                self.shown[uid].append(name)
