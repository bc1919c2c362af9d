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
    key: tuple
    """The same in each export; for instances with their numbers in it."""
    matrix: object
    instancer: int | None = None
    """`session_uid` of the object that makes it as an instance; None for objects of the scene."""


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

    def show(self, object, name):
        """Notes that `name` stands for an object, for rules."""
        names = self.shown.setdefault(object.original.session_uid, [])
        if name not in names:
            names.append(name)
