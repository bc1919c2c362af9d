"""Scenes of Blender as scene files of beamfarm, with their meshes and images beside them."""

from .exporter import Exporter, Result
from .settings import ExportSettings, View

__all__ = ["ExportSettings", "Exporter", "Result", "View", "write_scene"]


def write_scene(depsgraph, folder, settings):
    """Writes `folder`/scene.toml and what it names; see `Result`."""
    return Exporter(folder).write(depsgraph, settings)
