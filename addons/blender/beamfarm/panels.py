"""Panels: those of Blender and Cycles that are used unchanged, and a few of our own."""

from __future__ import annotations

import re
from collections.abc import Iterator

import bpy

from . import passes, told

ENGINE = "BEAMFARM"

# Panels for every engine that have no effect here, and those that Cycles replaces.
_NOT_OURS = re.compile(
    r"VIEWLAYER_PT_(filter|layer_passes|freestyle.*)"
    r"|RENDER_PT_(freestyle|simplify.*|stereoscopy|output_views|motion_blur.*)"
    r"|MATERIAL_PT_freestyle_line"
    r"|DATA_PT_camera_stereoscopy"
)
_TWICE = re.compile(r"(NODE_)?DATA_PT_(light|spot|area|preview)|OBJECT_PT_visibility")

# The export reads what Cycles' panels for materials, lights, the world, lenses, objects and light groups set, but not
# its integrator's.
_OF_ITS_INTEGRATOR = re.compile(r"CYCLES_(RENDER|VIEW3D)_PT_(?!passes_lightgroups).*|CYCLES_PT_(?!context_material).*")


def _all_of(cls: type) -> Iterator[type]:
    for derived in cls.__subclasses__():
        yield derived
        yield from _all_of(derived)


def _of_cycles() -> type | None:
    """The base class of all Cycles' panels; None if that add-on is off.

    Most of them leave it to this class to ask whether they are for the engine.
    """
    for panel in _all_of(bpy.types.Panel):
        for base in panel.__mro__:
            if base.__name__ == "CyclesButtonsPanel":
                return base
    return None


def _share() -> None:
    """Enables others' panels for this engine."""
    cycles = _of_cycles()
    for panel in _all_of(bpy.types.Panel):
        engines = getattr(panel, "COMPAT_ENGINES", set())
        name = panel.__name__
        if cycles is not None and issubclass(panel, cycles):
            if _OF_ITS_INTEGRATOR.fullmatch(name) and engines is cycles.COMPAT_ENGINES:
                panel.COMPAT_ENGINES = engines - {ENGINE}
        elif "BLENDER_RENDER" in engines and not (_NOT_OURS.fullmatch(name) or cycles and _TWICE.fullmatch(name)):
            engines.add(ENGINE)
    if cycles is not None:
        cycles.COMPAT_ENGINES.add(ENGINE)


def _keep_out() -> None:
    """Undoes this."""
    cycles = _of_cycles()
    for panel in _all_of(bpy.types.Panel):
        is_of_cycles = cycles is not None and panel is not cycles and issubclass(panel, cycles)
        if is_of_cycles and _OF_ITS_INTEGRATOR.fullmatch(panel.__name__) and "COMPAT_ENGINES" in vars(panel):
            del panel.COMPAT_ENGINES
        getattr(panel, "COMPAT_ENGINES", set()).discard(ENGINE)


class _Panel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine == ENGINE


class BEAMFARM_RENDER_PT_sampling(_Panel, bpy.types.Panel):
    bl_label = "Sampling"
    bl_context = "render"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.beamfarm
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(settings, "engine")
        column = layout.column(heading="Render")
        column.prop(settings, "passes")
        column.prop(settings, "time_limit")
        column.prop(settings, "target_error")
        if not (settings.passes or settings.time_limit or settings.target_error):
            layout.label(text="Never ends: set passes, time or error", icon="ERROR")
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


class BEAMFARM_RENDER_PT_motion_blur(_Panel, bpy.types.Panel):
    """Blender's own settings; those of objects are in Cycles' panels."""

    bl_label = "Motion Blur"
    bl_context = "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.render, "use_motion_blur", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, render = self.layout, context.scene.render
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.active = render.use_motion_blur
        layout.prop(render, "motion_blur_position", text="Position")
        layout.prop(render, "motion_blur_shutter")


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
        column = layout.column(heading="Cryptomatte")
        column.prop(view_layer, "use_pass_cryptomatte_object", text="Object")
        column.prop(view_layer, "use_pass_cryptomatte_material", text="Material")
        column = layout.column()
        column.active = bool(passes.cryptomattes(view_layer))
        column.prop(view_layer, "pass_cryptomatte_depth", text="Levels")


CLASSES = (
    BEAMFARM_RENDER_PT_sampling,
    BEAMFARM_RENDER_PT_photons,
    BEAMFARM_RENDER_PT_motion_blur,
    BEAMFARM_RENDER_PT_left_out,
    BEAMFARM_VIEWLAYER_PT_passes,
)


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    _share()


def unregister() -> None:
    _keep_out()
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
