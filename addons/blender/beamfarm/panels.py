"""Panels: those of Blender and of Cycles that are used as they are, and a few of our own."""

from __future__ import annotations

import re
from collections.abc import Iterator

import bpy

from . import told

ENGINE = "BEAMFARM"

# Panels for every engine that mean nothing here.
_NOT_OURS = {
    "RENDER_PT_simplify",
    "RENDER_PT_stamp_burnin",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
    "RENDER_PT_freestyle",
    "VIEWLAYER_PT_freestyle_lineset",
}

# Materials, lights, the world, lenses, visibility, light groups: what they set is what the export reads.
_OF_CYCLES = re.compile(
    r"CYCLES_(PT_context_material"
    r"|MATERIAL_PT_(preview|surface|volume|displacement)"
    r"|LIGHT_PT_(preview|light|nodes|beam_shape)"
    r"|WORLD_PT_(preview|surface|volume|ray_visibility|settings_light_group)"
    r"|CAMERA_PT_dof(_aperture)?"
    r"|OBJECT_PT_(lightgroup|visibility|visibility_ray_visibility|light_linking|shadow_linking)"
    r"|RENDER_PT_passes_lightgroups)"
)


def _shared() -> Iterator[type]:
    """Panels of others that are shown for this engine as well."""
    for panel in _all_of(bpy.types.Panel):
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines is None or panel.__name__ in _NOT_OURS:
            continue
        if "BLENDER_RENDER" in engines or _OF_CYCLES.fullmatch(panel.__name__):
            yield panel


def _all_of(cls: type) -> Iterator[type]:
    for derived in cls.__subclasses__():
        yield derived
        yield from _all_of(derived)


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES


class BEAMFARM_RENDER_PT_sampling(_Panel, bpy.types.Panel):
    bl_label = "Sampling"
    bl_context = "render"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.beamfarm
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Render")
        column.prop(settings, "passes")
        column.prop(settings, "time_limit")
        column.prop(settings, "target_error")
        if not (settings.passes or settings.time_limit or settings.target_error):
            layout.label(text="Never ends: give passes, time or error", icon="ERROR")
        layout.prop(settings, "viewport_passes", text="Viewport")
        layout.prop(settings, "seed")


class BEAMFARM_RENDER_PT_photons(_Panel, bpy.types.Panel):
    bl_label = "Photons"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.beamfarm
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "paths")
        layout.prop(settings, "radius")


class BEAMFARM_RENDER_PT_left_out(_Panel, bpy.types.Panel):
    """Lists what the last picture lacks."""

    bl_label = "Left Out"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        known = told.of(context.scene.name)
        if known is None:
            layout.label(text="Known after a render or an export")
            return
        if not known.left_out:
            layout.label(text="Nothing is left out", icon="CHECKMARK")
        column = layout.column(align=True)
        for line in known.left_out[:20]:
            column.label(text=line.removeprefix("left out: "), icon="DOT")
        if len(known.left_out) > 20 or known.notes:
            more = max(0, len(known.left_out) - 20)
            layout.label(text=f"{more} more, and {len(known.notes)} notes")
        layout.operator("beamfarm.show_left_out", icon="TEXT")


class BEAMFARM_VIEWLAYER_PT_passes(_Panel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context: bpy.types.Context) -> None:
        layout, view_layer = self.layout, context.view_layer
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Data")
        column.prop(view_layer, "use_pass_z", text="Depth")
        column.prop(view_layer, "use_pass_normal", text="Normal")
        column.prop(view_layer.beamfarm, "use_denoising")
        column.prop(view_layer.beamfarm, "use_standard_error")
        column = layout.column(heading="Light")
        column.prop(view_layer.beamfarm, "use_direct")
        column.prop(view_layer.beamfarm, "use_indirect")
        column.prop(view_layer.beamfarm, "use_volume")
        column.prop(view_layer.beamfarm, "use_light_groups")


CLASSES = (
    BEAMFARM_RENDER_PT_sampling,
    BEAMFARM_RENDER_PT_photons,
    BEAMFARM_RENDER_PT_left_out,
    BEAMFARM_VIEWLAYER_PT_passes,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in _shared():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    for panel in _shared():
        panel.COMPAT_ENGINES.discard(ENGINE)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
