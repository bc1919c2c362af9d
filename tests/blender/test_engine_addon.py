"""The add-on as a whole: its zip, and what it does to Blender's panels."""

from __future__ import annotations

import unittest
import zipfile

import harness
import bpy

ENGINE = "BEAMFARM"


def panels() -> set[str]:
    """Names of Blender's and Cycles' panels that are shown for this engine."""
    found, left = set(), [bpy.types.Panel]
    while left:
        derived = left.pop().__subclasses__()
        left += derived
        found |= {panel.__name__ for panel in derived if ENGINE in getattr(panel, "COMPAT_ENGINES", ())}
    return {name for name in found if not name.startswith(ENGINE)}


def of_cycles() -> list[type]:
    """Cycles' panels for renders."""
    return [panel for panel in bpy.types.Panel.__subclasses__() if panel.__name__.startswith("CYCLES_RENDER_PT")]


class AddOn(unittest.TestCase):
    def test_the_zip_is_the_same_each_time(self) -> None:
        folder = harness.folder()
        first, second = (harness.package.build(folder / name) for name in ("a.zip", "b.zip"))
        self.assertEqual(first.read_bytes(), second.read_bytes())
        with zipfile.ZipFile(first) as archive:
            names = archive.namelist()
        self.assertIn("blender_manifest.toml", names)
        self.assertIn("export/__init__.py", names)
        self.assertFalse([name for name in names if "__pycache__" in name])

    def test_it_comes_and_goes(self) -> None:
        harness.install()
        shown = panels()
        wanted = {
            "CYCLES_MATERIAL_PT_surface",
            "CYCLES_MATERIAL_PT_volume",
            "CYCLES_LIGHT_PT_light",
            "CYCLES_WORLD_PT_surface",
            "CYCLES_OBJECT_PT_visibility",
            "CYCLES_RENDER_PT_passes_lightgroups",
            "RENDER_PT_format",
            "DATA_PT_camera",
        }
        self.assertLessEqual(wanted, shown)
        self.assertIn("CYCLES_OBJECT_PT_motion_blur", shown)
        self.assertFalse([name for name in shown if "RENDER_PT_motion_blur" in name or "RENDER_PT_sampling" in name])
        self.assertNotIn("DATA_PT_light", shown)
        self.assertTrue(hasattr(bpy.types.Scene, "beamfarm"))
        bpy.ops.preferences.addon_disable(module=harness.MODULE)
        self.assertEqual(panels(), set())
        self.assertTrue(all("CYCLES" in panel.COMPAT_ENGINES for panel in of_cycles()))
        self.assertFalse(hasattr(bpy.types.Scene, "beamfarm"))
        bpy.ops.preferences.addon_enable(module=harness.MODULE)
        self.assertEqual(panels(), shown)

    def test_light_and_material_nodes_are_those_of_cycles(self) -> None:
        harness.install()
        engine = harness.module("engine").BeamfarmRenderEngine
        self.assertFalse(engine.bl_use_shading_nodes_custom)


if __name__ == "__main__":
    unittest.main()
