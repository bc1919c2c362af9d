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
    world_medium: object = None
    media: dict = field(default_factory=dict)
    materials: dict = field(default_factory=dict)
    shapes: list = field(default_factory=list)
    lights: list = field(default_factory=list)
    groups: dict = field(default_factory=dict)
    rules: list = field(default_factory=list)
    shown: dict = field(default_factory=dict)
    """Names of shapes and lights by `session_uid` of the object that they come from."""

    def show(self, placed, name):
        """Notes that `name` stands for an object and for what makes it as an instance, for rules."""
        for uid in (placed.uid, placed.instancer):
            if uid is not None and name not in self.shown.setdefault(uid, []):
                self.shown[uid].append(name)
