"""From the evaluated dependency graph to a scene file."""

from dataclasses import dataclass, field
from pathlib import Path

from . import toml
from .camera import camera_table
from .lights import add_light
from .meshes import Files, MeshArrays, ply
from .names import Names, file_name
from .report import Report
from .settings import ExportSettings
from .transforms import steps


@dataclass
class Result:
    """What an export wrote."""

    scene: Path
    left_out: list
    notes: list


@dataclass
class Placed:
    """An object at one of its places."""

    object: object
    key: object
    matrix: object


@dataclass
class Context:
    """What the parts of one export share."""

    depsgraph: object
    scene: object
    settings: ExportSettings
    files: Files
    report: Report
    names: Names = field(default_factory=Names)
    media: dict = field(default_factory=dict)
    materials: dict = field(default_factory=dict)
    shapes: list = field(default_factory=list)
    lights: list = field(default_factory=list)


class Exporter:
    """Writes scenes into one folder, again and again; a file whose content stays is not written twice."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.files = Files(self.folder)
        self.settings = None

    def write(self, depsgraph, settings):
        """Writes the scene as `settings` ask for it."""
        self.settings = settings
        self.folder.mkdir(parents=True, exist_ok=True)
        context = Context(depsgraph, depsgraph.scene_eval, settings, self.files, Report())
        _add_objects(context)
        path = self.folder / "scene.toml"
        text = toml.document(_tables(context))
        partial = path.with_name("scene.toml.part")
        partial.write_text(text, encoding="utf-8", newline="\n")
        partial.replace(path)
        self.files.sweep()
        return Result(path, context.report.left_out, context.report.notes)

    def update(self, depsgraph, settings=None):
        """Writes the scene again after a change; what the depsgraph does not call changed is not looked at again."""
        return self.write(depsgraph, settings or self.settings)


def _tables(context):
    settings = context.settings
    image = {"width": settings.width, "height": settings.height}
    if settings.crop is not None:
        x, y, width, height = settings.crop
        image["crop"] = {"x": x, "y": y, "width": width, "height": height}
    if settings.filter is not None:
        image["filter"] = settings.filter
    return {
        "image": image,
        "render": dict(settings.render),
        "camera": camera_table(context),
        "media": context.media,
        "materials": context.materials,
        "shapes": context.shapes,
        "lights": context.lights,
    }


def _add_objects(context):
    for instance in context.depsgraph.object_instances:
        if not instance.show_self:
            continue
        object = instance.object
        key = object.original.session_uid, tuple(instance.persistent_id)
        placed = Placed(object, key, instance.matrix_world.copy())
        if object.type == "LIGHT":
            add_light(placed, context)
        elif object.type == "MESH":
            _add_mesh(placed, context)


def _add_mesh(placed, context):
    content = ply(MeshArrays(placed.object.data), None)
    if content is None:
        return
    name = context.names.get(("shape", placed.key), placed.object.name)
    file = context.files.put("meshes", file_name(placed.object.name), ".ply", content)
    shape = {"name": name, "type": "mesh", "file": file}
    transform = steps(placed.matrix)
    if transform:
        shape["transform"] = transform
    context.shapes.append(shape)
