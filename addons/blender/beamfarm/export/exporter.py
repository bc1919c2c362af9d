"""From the evaluated dependency graph to a scene file."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import through, toml
from .bakes import Bakes
from .camera import camera_table
from .context import Context, Placed
from .falloff import soften_in_media
from .files import Files
from .groups import add_light_groups
from .lights import add_light
from .links import add_rules
from .motion import moving
from .nothing import Nothing
from .pictures import Pictures
from .points import add_points
from .report import Report
from .shapes import Shapes
from .spaces import random_of, reached
from .spans import Exposure, Frames
from .strands import add_curves, add_hair
from .visibility import rays
from .volumes import add_volume
from .world import name_world_medium, read_world


@dataclass
class Result:
    """The files and messages of an export."""

    scene: Path
    left_out: list
    notes: list


# Objects that no renderer shows.
UNSEEN = {"EMPTY", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER", "LIGHT_PROBE"}


class Exporter:
    """Writes scenes into one folder repeatedly; what did not change is not written twice."""

    def __init__(self, folder):
        self.folder = Path(folder)
        self.files = Files(self.folder)
        self.pictures = Pictures(self.files)
        self.settings = None
        self._slots = {}
        self._geometries = {}

    def write(self, depsgraph, settings, go_to=None, all_frames=False):
        """Writes the whole scene as `settings` say.

        `go_to`: a function that sets the depsgraph to a time in frames; with it there is motion blur if the scene asks
        for it. It is finally called with the time at which the scene was found. `all_frames`: write one scene of all
        frames, not of this one alone.
        """
        self._slots, self._geometries = {}, {}
        return self._write(depsgraph, settings, go_to, all_frames)

    def update(self, depsgraph, settings=None):
        """Writes the scene again after a change: geometry and materials that the depsgraph reports as changed, and
        transforms.

        Must be called for each update of the depsgraph, or changes are missed.
        """
        changed = {update.id.original.session_uid for update in depsgraph.updates if update.is_updated_geometry}
        for key in list(self._geometries):
            object, data, _, instancer = key
            if changed & {object, data, instancer}:
                del self._geometries[key]
        if any(update.id.id_type not in PLACED for update in depsgraph.updates):
            self._slots = {}
        return self._write(depsgraph, settings or self.settings)

    def _write(self, depsgraph, settings, go_to=None, all_frames=False):
        self.settings = settings
        self.folder.mkdir(parents=True, exist_ok=True)
        span = None
        if go_to is not None:
            span = (Frames if all_frames else Exposure).of(depsgraph)
        bakes = Bakes() if settings.bakes else None

        def read():
            context = Context(
                depsgraph, depsgraph.scene_eval, settings, self.files, self.pictures, Report(), self._slots,
                self._geometries, bakes=bakes,
            )
            return context, _read(context) if span is None else moving(context, span, go_to, _read)

        context, tables = read()
        # Baked results may show that more is needed.
        for _ in range(ROUNDS):
            if bakes is None or not bakes.is_wanted:
                break
            bakes.run(depsgraph)
            self._slots, self._geometries = {}, {}
            context, tables = read()
            for why in bakes.failed.values():
                context.report.note(f"nodes without an equivalent were not baked: {why}")
        _say_of_scene(context, go_to is not None)
        path = self.folder / "scene.toml"
        partial = path.with_name("scene.toml.part")
        partial.write_text(toml.document(tables), encoding="utf-8", newline="\n")
        partial.replace(path)
        self.files.sweep()
        return Result(path, context.report.left_out, context.report.notes)


# How often baked results may lead to more requests.
ROUNDS = 3
# Changes to these leave materials as they are.
PLACED = {"OBJECT", "MESH", "CURVE", "CURVES", "META", "CAMERA", "LIGHT", "SCENE", "COLLECTION", "LATTICE", "ARMATURE"}


def _read(context):
    """Tables of the scene file for the depsgraph's present state."""
    read_world(context)
    _add_objects(context)
    add_light_groups(context)
    add_rules(context)
    through.add_rules(context)
    settings = context.settings
    image = {"width": settings.width, "height": settings.height}
    if settings.crop is not None:
        x, y, width, height = settings.crop
        image["crop"] = {"x": x, "y": y, "width": width, "height": height}
    if settings.filter is not None:
        image["filter"] = settings.filter
    world = name_world_medium(context)
    shown = [context.media, context.materials, context.shapes, context.lights]
    return {
        "image": image,
        "render": dict(settings.render),
        "camera": camera_table(context),
        "world": world,
        "textures": reached(shown, context.textures),
        "media": context.media,
        "materials": context.materials,
        "shapes": context.shapes,
        "lights": context.lights,
        "rules": context.rules,
    }


def _add_objects(context):
    shapes, nothing = Shapes(context), Nothing()
    in_viewport = context.depsgraph.mode == "VIEWPORT"
    for instance in context.depsgraph.object_instances:
        object = instance.object
        parent = instance.parent if instance.is_instance else None
        if not instance.show_self or object.type in UNSEEN:
            continue
        # The viewport's depsgraph also has what renders hide.
        if in_viewport and context.settings.view is None and (parent or object).hide_render:
            continue
        instancer = None if parent is None else parent.original.session_uid
        uid = object.original.session_uid
        key = (uid, *(() if parent is None else (instancer, *instance.persistent_id)))
        placed = Placed(object, object.name, uid, key, instance.matrix_world.copy(), instancer)
        placed.random = random_of(object.name) if parent is None else instance.random_id
        placed.index = object.pass_index
        if context.motion is not None:
            placed.steps, placed.deforms = context.motion.steps_of(object, parent, context.report)
        if object.type == "LIGHT":
            add_light(placed, context)
        elif not nothing.is_made_of(object):
            placed.visible = rays(object, parent, context)
            why = _add_object(placed, shapes, context)
            if why is None:
                nothing.see(object, parent)
            else:
                nothing.add(placed, why)
        placed.object = None
    shapes.finish()
    # At other times it is as at the first.
    if context.motion is None or context.motion.is_first:
        nothing.tell(context.report)
    if context.media or context.world_medium is not None:
        soften_in_media(context)
        # Light that passes a lamp stays in the medium around the lamp.
        for shape in context.shapes:
            if "emission" in shape and "interior" not in shape:
                if context.materials[shape["material"]]["type"] == "null":
                    shape["boundary"] = False


def _add_object(placed, shapes, context):
    """Returns why nothing of it is visible, or None if something is or if the report already says it."""
    object = placed.object
    if object.type == "MESH":
        _say_of_object(object, context)
        matrix = placed.matrix
        has_hair = add_hair(placed, context)
        placed.matrix = matrix
        why = shapes.add(placed)
        return None if has_hair else why
    if object.type == "CURVES":
        return add_curves(placed, context)
    if object.type == "POINTCLOUD":
        return add_points(placed, context)
    if object.type == "VOLUME":
        add_volume(placed, context)
    else:
        context.report.leave_out(f"object '{object.name}' of the kind {object.type.lower()}")
    return None


def _say_of_object(object, context):
    report = context.report
    if object.is_holdout:
        report.leave_out(f"the holdout '{object.name}': it is shown as an ordinary object")
    if object.is_shadow_catcher:
        report.leave_out(f"the shadow catcher '{object.name}': it is shown as an ordinary object")
    for modifier in object.modifiers:
        if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
            if modifier.domain_settings.domain_type == "GAS" and has_gas(modifier.domain_settings):
                report.leave_out(f"the gas of '{object.name}'")
    for system in object.particle_systems:
        if system.settings.render_type in ("HALO", "LINE"):
            report.leave_out(f"the particles '{system.name}' of '{object.name}'")


def has_gas(domain):
    """Whether the domain has smoke or fire at this frame: without its cache it has none, in Cycles as well."""
    return any(np.any(np.asarray(grid, dtype=np.float32) > 0.0) for grid in (domain.density_grid, domain.flame_grid))


def _say_of_scene(context, has_times):
    scene, report = context.scene, context.report
    if scene.render.use_motion_blur:
        if not has_times:
            report.note("motion blur is only in renders, as in Cycles, not in the viewport")
        elif getattr(getattr(scene, "cycles", None), "rolling_shutter_type", "NONE") != "NONE":
            report.leave_out("the rolling shutter: the whole picture is exposed at once")
        if any(point.location[1] < 0.999 for point in scene.render.motion_blur_shutter_curve.curves[0].points):
            report.leave_out("the shutter's curve: it is fully open all the time")
    if scene.render.use_freestyle and context.depsgraph.view_layer_eval.use_freestyle:
        report.leave_out("the lines of Freestyle")
    exposure = getattr(getattr(scene, "cycles", None), "film_exposure", 1.0)
    if exposure != 1.0:
        report.leave_out(f"the exposure of Cycles' film, {exposure:.3g}: set Color Management > Exposure")
    if scene.render.film_transparent and getattr(getattr(scene, "cycles", None), "film_transparent_glass", False):
        report.leave_out("the transparent glass of the film: alpha includes glass")
    layers = [context.depsgraph.view_layer_eval.layer_collection]
    while layers:
        layer = layers.pop()
        if layer.holdout:
            report.leave_out(f"the holdout of collection '{layer.name}': it is shown as an ordinary object")
        if layer.indirect_only:
            report.leave_out(f"'indirect only' of collection '{layer.name}': it is shown as an ordinary object")
        layers.extend(layer.children)
