"""beamfarm in Blender: a render engine for light in fog, smoke and water, and for caustics.

`export` writes Blender's scenes as scene files; all else here runs the command `beamfarm` on them and shows what comes.
"""

from __future__ import annotations

import bpy

from . import engine, operators, panels, preferences, properties, told


@bpy.app.handlers.persistent
def _forget(*_of_blender: object) -> None:
    told.forget()


def register() -> None:
    bpy.utils.register_class(preferences.BeamfarmPreferences)
    properties.register()
    operators.register()
    bpy.utils.register_class(engine.BeamfarmRenderEngine)
    panels.register()
    bpy.app.handlers.load_post.append(_forget)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(_forget)
    panels.unregister()
    bpy.utils.unregister_class(engine.BeamfarmRenderEngine)
    operators.unregister()
    properties.unregister()
    bpy.utils.unregister_class(preferences.BeamfarmPreferences)
