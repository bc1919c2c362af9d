"""Settings of this machine, not of a file: the program, and who renders."""

from pathlib import Path

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from . import engines, program


class BeamfarmPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: StringProperty(
        name="Program",
        description="Path of the command beamfarm; empty: the one that came with the add-on, or else the one on PATH",
        subtype="FILE_PATH",
    )
    engine: EnumProperty(
        name="Engine",
        description="What renders on this machine. A scene may override it in Render Properties > Sampling",
        items=engines.ITEMS,
        default=engines.CPU,
    )
    workers: IntProperty(
        name="Workers",
        description="Worker processes on this machine; 0: one up to four cores, then about one per four cores",
        min=0,
        soft_max=64,
        max=1024,
    )
    threads: IntProperty(
        name="Threads",
        description="Threads of each worker; 0: so that workers times threads is the number of cores",
        min=0,
        soft_max=64,
        max=1024,
    )
    use_farm: BoolProperty(
        name="Other machines work too",
        description="Final renders listen for workers from other machines, in addition to those on this one",
    )
    listen: StringProperty(
        name="Listen",
        description="Address and port for workers on other machines; 0.0.0.0 is every address of this machine",
        default="0.0.0.0:7325",
    )
    token: StringProperty(
        name="Token",
        description="Secret that lets in workers on other machines. Kept in Blender's preferences unencrypted",
        subtype="PASSWORD",
    )

    def path(self) -> Path:
        """The command; raises `program.ProgramError`."""
        return self.found()[0]

    def found(self) -> tuple[Path, str]:
        """The command and its origin; raises `program.ProgramError`."""
        return program.usable(bpy.path.abspath(self.program))

    def draw(self, _context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "program")
        row = layout.row()
        try:
            path, whose = self.found()
            row.label(text=f"Version {program.version(path)}, {whose}: {path}", icon="CHECKMARK")
        except program.ProgramError as error:
            lines = layout.column(align=True)
            lines.alert = True
            for line in str(error).replace(": ", ":\n").replace(". ", ".\n").split("\n"):
                lines.label(text=line)
        layout.prop(self, "engine")
        layout.prop(self, "workers")
        layout.prop(self, "threads")
        layout.prop(self, "use_farm")
        if self.use_farm:
            layout.prop(self, "listen")
            layout.prop(self, "token")
            port = self.listen.rpartition(":")[2]
            layout.label(text="On each of the others, with the token in BEAMFARM_TOKEN:")
            layout.label(text=f"beamfarm worker --connect http://THIS-MACHINE:{port} --patience 1h")


def get() -> BeamfarmPreferences:
    """The preferences of this add-on."""
    return bpy.context.preferences.addons[__package__].preferences
