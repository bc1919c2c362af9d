"""beamfarm in Blender: a render engine for light in fog, smoke and water, and for caustics.

`export` writes Blender's scenes as scene files; everything else runs the command `beamfarm` on them and shows the
results.
"""

from __future__ import annotations

import atexit

import bpy

from . import engine, operators, panels, preferences, properties, told
from .viewport import session


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
    atexit.register(session.close_all)


def unregister() -> None:
    atexit.unregister(session.close_all)
    session.close_all()
    bpy.app.handlers.load_post.remove(_forget)
    panels.unregister()
    bpy.utils.unregister_class(engine.BeamfarmRenderEngine)
    operators.unregister()
    properties.unregister()
    bpy.utils.unregister_class(preferences.BeamfarmPreferences)
