"""State that the parts of one export share."""

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
    """None once the depsgraph shows the next object: Blender makes instances temporarily, in memory that it reuses."""
    name: str
    uid: int
    """`session_uid` of the object."""
    key: tuple
    """The same in each export; for instances it includes their numbers."""
    matrix: object
    instancer: int | None = None
    """`session_uid` of the object whose instance it is; None for objects of the scene."""
    visible: list | None = None
    """The rays that see it, None for all; for objects that are not lights."""
    mesh: tuple | None = None
    """A key for each mesh that is written: object, data, the evaluated data's address, instancer."""
    steps: int = 0
    """Motion steps as in Cycles: keys at 2**steps + 1 times; 0 without blur."""
    deforms: bool = False
    """Whether the motion of its vertices is blurred."""
    random: int = 0
    """Blender's random number for it, 32 bits."""
    index: int = 0
    """Its pass index."""
    edge: float | None = None
    """Edge length to which its mesh is subdivided for displacement; None without subdivision."""


@dataclass
class Source:
    """The origin of a table of shapes or lights, used to find it again at other times."""

    keys: list
    """Unique per place and the same at all times: the object at its place, and which part of it this is."""
    steps: int
    deforms: bool = False
    geometry: object = None
    """`geometry.Geometry` and what of it goes into the file; None if it is no mesh."""
    variant: tuple | None = None
    within: object = None
    """The matrix that precedes the object's, if the object's is to move separately."""


@dataclass
class Context:
    """The scene file's tables as they grow, and what is requested meanwhile."""

    depsgraph: object
    scene: object
    settings: ExportSettings
    files: Files
    pictures: Pictures
    report: Report
    slots: dict
    """`materials.Slot` by material; kept between exports."""
    geometries: dict
    """`geometry.Geometry` by object; kept likewise."""
    names: Names = field(default_factory=Names)
    material_names: Names = field(default_factory=Names)
    media_names: Names = field(default_factory=Names)
    texture_names: Names = field(default_factory=Names)
    world_medium: object = None
    textures: dict = field(default_factory=dict)
    """Graphs by name, including those that the scene file does not use in the end."""
    written: dict = field(default_factory=dict)
    """Name of a texture, by its `arithmetic.Node` and what the name is for."""
    media: dict = field(default_factory=dict)
    materials: dict = field(default_factory=dict)
    shapes: list = field(default_factory=list)
    lights: list = field(default_factory=list)
    groups: dict = field(default_factory=dict)
    rules: list = field(default_factory=list)
    without_shadows: list = field(default_factory=list)
    """Names of lights."""
    shown: dict = field(default_factory=dict)
    """Names of shapes and lights, by `session_uid` of their object."""

    motion: object = None
    """`motion.Moment`, if the scene is read at several times."""
    sources: dict = field(default_factory=dict)
    """`Source` by `id` of a table of shapes or lights."""
    nearest: dict = field(default_factory=dict)
    """Distance from lights at their places to the nearest object, the same at all times."""
    soft: list = field(default_factory=list)
    """Tables of lights whose soft falloff does not show on surfaces."""
    bakes: object = None
    """`bakes.Bakes`, if Blender may bake what the scene file cannot express."""
    counts: dict = field(default_factory=dict)
    """How many parts an object at its place has so far."""

    def part(self, placed, kind):
        """The key of one more part of this kind of an object at its place."""
        count = self.counts.get((placed.key, kind), 0)
        self.counts[placed.key, kind] = count + 1
        return placed.key, kind, count

    def add_medium(self, placed, name, medium):
        """Adds to `[media]` a medium that moves with an object."""
        self.media[name] = medium
        if self.motion is not None:
            self.sources[id(medium)] = Source([], placed.steps)

    def add_light(self, placed, light):
        """Adds to `[[lights]]`."""
        self.lights.append(light)
        if self.motion is not None:
            self.sources[id(light)] = Source([self.part(placed, "light")], placed.steps)

    def add_surroundings(self, light, rays):
        """Adds the world's light, or what some kinds of rays see of it."""
        self.lights.append(light)
        if self.motion is not None:
            self.sources[id(light)] = Source([("world", *rays)], 1)

    def add_shape(self, placed, shape, kind="shape", **source):
        """Adds a shape at one place to `[[shapes]]`."""
        self.shapes.append(shape)
        if self.motion is not None:
            self.sources[id(shape)] = Source([self.part(placed, kind)], placed.steps, placed.deforms, **source)

    def add_copies(self, places, shape, kind="shape", **source):
        """Adds instances of one shape at these numbered places to `[[shapes]]`."""
        self.shapes.append(shape)
        if self.motion is not None:
            keys = [self.part(placed, (kind, number)) for placed, number in places]
            placed = places[0][0]
            self.sources[id(shape)] = Source(keys, placed.steps, placed.deforms, **source)

    def show(self, placed, name):
        """Records that `name` stands for an object and its instancer, for rules."""
        for uid in (placed.uid, placed.instancer):
            if uid is not None and name not in self.shown.setdefault(uid, []):
                self.shown[uid].append(name)
