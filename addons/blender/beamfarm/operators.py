"""Menu entries: export of a scene for use without Blender, and the list of what a picture lacks as a text."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from . import frame, told
from .export import write_scene


def _go_to(scene: bpy.types.Scene, time: float) -> None:
    whole, subframe = frame.parts(time)
    scene.frame_set(whole, subframe=subframe)


class BEAMFARM_OT_export(bpy.types.Operator):
    """Write the scene as scene.toml into a folder, with its meshes and images beside it"""

    bl_idname = "export_scene.beamfarm"
    bl_label = "Export beamfarm scene"

    directory: StringProperty(name="Folder", subtype="DIR_PATH")
    filter_folder: BoolProperty(default=True, options={"HIDDEN"})
    all_frames: BoolProperty(
        name="All Frames",
        description="Export one scene with all frames from the first to the last instead of the current frame alone",
    )

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        folder = Path(bpy.path.abspath(self.directory))
        depsgraph = context.evaluated_depsgraph_get()
        scene = depsgraph.scene_eval
        try:
            settings = frame.export_settings(scene, frame.of_scene(scene))
            result = write_scene(
                depsgraph, folder, settings, lambda time: _go_to(context.scene, time), self.all_frames
            )
        except (ValueError, OSError) as error:
            self.report({"ERROR"}, f"The scene cannot be written: {error}")
            return {"CANCELLED"}
        told.remember(scene.name, result.left_out, result.notes)
        if result.left_out:
            self.report({"WARNING"}, told.warning(result.left_out))
        self.report({"INFO"}, f"Wrote {result.scene}")
        return {"FINISHED"}


class BEAMFARM_OT_show_left_out(bpy.types.Operator):
    """Write the list of what the last picture lacks into a text"""

    bl_idname = "beamfarm.show_left_out"
    bl_label = "Show as Text"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return told.of(context.scene.name) is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        name = f"beamfarm: {context.scene.name}"
        text = bpy.data.texts.get(name) or bpy.data.texts.new(name)
        text.from_string(told.of(context.scene.name).text(context.scene.name))
        self.report({"INFO"}, f"See the text “{text.name}” in the text editor")
        return {"FINISHED"}


CLASSES = BEAMFARM_OT_export, BEAMFARM_OT_show_left_out


def _menu(self, _context: bpy.types.Context) -> None:
    self.layout.operator(BEAMFARM_OT_export.bl_idname, text="beamfarm scene (.toml)")


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.TOPBAR_MT_file_export.append(_menu)


def unregister() -> None:
    bpy.types.TOPBAR_MT_file_export.remove(_menu)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
