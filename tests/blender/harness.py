"""Blender without a window, with the add-on installed from its zip as users install it.

Import this before anything else of Blender: preferences and extensions are then those of an empty folder, not of the
user.
"""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

RESOURCES = Path(tempfile.mkdtemp(prefix="beamfarm-blender-"))
atexit.register(shutil.rmtree, RESOURCES, ignore_errors=True)
os.environ["BLENDER_USER_RESOURCES"] = str(RESOURCES)

import bpy  # noqa: E402

ADDONS = Path(__file__).resolve().parents[2] / "addons" / "blender"
sys.path.insert(0, str(ADDONS))

import package  # noqa: E402

PROGRAM = Path(os.environ["BEAMFARM"]).resolve()
MODULE = "bl_ext.user_default.beamfarm"


def install() -> None:
    """Installs the zip, and tells the add-on where the command is."""
    if MODULE not in bpy.context.preferences.addons:
        path = package.build(RESOURCES / "beamfarm.zip")
        bpy.ops.extensions.package_install_files(filepath=str(path), repo="user_default", enable_on_install=True)
    preferences().program = str(PROGRAM)


def preferences() -> bpy.types.AddonPreferences:
    """The add-on's preferences."""
    return bpy.context.preferences.addons[MODULE].preferences


def module(name: str):
    """A module of the installed add-on."""
    return sys.modules[f"{MODULE}.{name}"]


def folder() -> Path:
    """An empty folder that is removed at the end."""
    return Path(tempfile.mkdtemp(dir=RESOURCES))


def lit_floor(size: tuple[int, int] = (64, 48)) -> bpy.types.Scene:
    """A floor seen from above with a lamp over its upper left, so that no two corners of the picture are alike."""
    install()
    bpy.ops.wm.read_homefile(use_empty=True)
    # Reading a file may read the preferences again.
    install()
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=8.0)
    bpy.context.object.name = "floor"
    bpy.ops.object.camera_add(location=(0.0, 0.0, 6.0))
    scene.camera = bpy.context.object
    bpy.ops.object.light_add(type="POINT", location=(-1.2, 0.8, 1.0))
    bpy.context.object.name = "lamp"
    bpy.context.object.data.energy = 60.0
    scene.render.engine = "BEAMFARM"
    scene.render.resolution_x, scene.render.resolution_y = size
    scene.render.resolution_percentage = 100
    scene.render.filepath = str(folder() / "out.exr")
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        # Blender 5.0 and later.
        settings.media_type = "MULTI_LAYER_IMAGE"
        settings.use_exr_interleave = True
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth = "32"
    settings.exr_codec = "ZIP"
    scene.beamfarm.passes = 4
    scene.beamfarm.paths = 2000
    return scene


def command(*arguments: object) -> str:
    """Runs the command itself. Returns its output."""
    line = [str(PROGRAM), *(str(argument) for argument in arguments)]
    done = subprocess.run(line, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout
