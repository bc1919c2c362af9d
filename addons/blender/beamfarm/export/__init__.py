"""Exports Blender's scenes as scene files of beamfarm, with their meshes and images."""

from .camera import lens_of
from .exporter import Exporter, Result
from .settings import ExportSettings, View

__all__ = ["ExportSettings", "Exporter", "Result", "View", "lens_of", "write_scene"]


def write_scene(depsgraph, folder, settings, go_to=None, all_frames=False):
    """Writes `folder`/scene.toml and what it names; see `Result` and `Exporter.write`."""
    return Exporter(folder).write(depsgraph, settings, go_to, all_frames)
