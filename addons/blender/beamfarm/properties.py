"""Settings of a scene and of its view layers, which are kept in the file.

Without postponed annotations: those of these classes are Blender's properties.
"""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from . import engines


class BeamfarmSceneSettings(bpy.types.PropertyGroup):
    passes: IntProperty(
        name="Passes",
        description="Photon passes, whose average is the image; 0: as many as the time or the error allows",
        default=64,
        min=0,
        soft_max=4096,
    )
    time_limit: FloatProperty(
        name="Time",
        description="Stop after this time with the passes that are complete, seconds; 0: no limit",
        min=0.0,
        unit="TIME_ABSOLUTE",
        step=100,
    )
    target_error: FloatProperty(
        name="Error",
        description="Stop when the relative standard error of the image is at most this; 0: off",
        min=0.0,
        soft_max=50.0,
        max=100.0,
        subtype="PERCENTAGE",
        precision=2,
    )
    paths: IntProperty(
        name="Photon Paths",
        description="Photon paths that each pass emits; 0: as many as a pilot finds best",
        min=0,
        soft_max=10_000_000,
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of all photon beams and surface photons in the first pass; 0: by photon differentials",
        min=0.0,
        unit="LENGTH",
        precision=4,
    )
    engine: EnumProperty(
        name="Engine",
        description="What renders this scene. Both render correct passes, with different bits",
        items=engines.ITEMS_OF_SCENES,
        default=engines.AS_PREFERRED,
    )
    seed: IntProperty(name="Seed", description="Seed of all random numbers", min=0)
    viewport_passes: IntProperty(
        name="Passes",
        description="Passes in the viewport, once nothing changes any more",
        default=256,
        min=1,
        soft_max=4096,
    )


class BeamfarmLayerSettings(bpy.types.PropertyGroup):
    use_denoising: BoolProperty(
        name="Denoising Data",
        description="Reflectance and normal of the first surface, for the compositor's Denoise node",
    )
    use_direct: BoolProperty(
        name="Direct",
        description="Visible lights, and surfaces lit directly by lights",
    )
    use_indirect: BoolProperty(
        name="Indirect",
        description="All other light from surfaces. Combined is Direct + Indirect + Volume",
    )
    use_volume: BoolProperty(name="Volume", description="Light that fog and smoke scatter towards the camera")
    use_light_groups: BoolProperty(
        name="Light Groups",
        description="Light from each light group of the view layer",
        default=True,
    )
    use_standard_error: BoolProperty(
        name="Standard Error",
        description="Estimated standard error of Combined, pixel by pixel",
    )


CLASSES = BeamfarmSceneSettings, BeamfarmLayerSettings


def register() -> None:
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Scene.beamfarm = PointerProperty(type=BeamfarmSceneSettings)
    bpy.types.ViewLayer.beamfarm = PointerProperty(type=BeamfarmLayerSettings)


def unregister() -> None:
    del bpy.types.ViewLayer.beamfarm
    del bpy.types.Scene.beamfarm
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
