"""Blender's subsurface scattering: the medium below the surface, and Cycles' random walks."""

import os
import unittest

import bpy
import compare
import numpy as np
import scenes
from test_export_materials import room, shader
from test_export_text import exported

SKIN = {"Base Color": (0.8, 0.5, 0.35), "Subsurface Weight": 1.0, "Subsurface Radius": (1.0, 0.4, 0.2),
        "Subsurface Scale": 0.5, "Roughness": 0.5}


def principled(**values):
    made = scenes.material("Skin", "ShaderNodeBsdfPrincipled", **{})
    node = shader(made)
    node.subsurface_method = "RANDOM_WALK"
    scenes.set_inputs(node, SKIN | {name.replace("_", " "): value for name, value in values.items()})
    return made


def wax(falloff, **values):
    made = scenes.material("Wax", "ShaderNodeSubsurfaceScattering")
    node = shader(made)
    node.falloff = falloff
    scenes.set_inputs(node, {"Color": (0.7, 0.5, 0.3), "Radius": (1.0, 0.5, 0.2), "Scale": 0.4} | values)
    return made


def head(material):
    """A monkey's head without holes."""
    bpy.ops.mesh.primitive_monkey_add(size=1.3, location=(0.0, 0.0, 0.7), rotation=(-0.4, 0.0, 0.3))
    made = bpy.context.object
    made.modifiers.new("Whole", "REMESH").voxel_size = 0.03
    made.data.materials.append(material)
    return made


class Text(unittest.TestCase):
    def said(self):
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        return scene["materials"]

    def test_principled(self):
        room()
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), principled(Subsurface_Weight=0.6, Subsurface_Anisotropy=0.3))
        skin = self.said()["Skin"]
        self.assertEqual(skin["type"], "principled")
        self.assertNotIn("two_sided", skin)
        self.assertAlmostEqual(skin["subsurface"], 0.6, places=5)
        self.assertAlmostEqual(skin["subsurface_anisotropy"], 0.3, places=5)
        np.testing.assert_allclose(skin["subsurface_radius"], np.array([1.0, 0.4, 0.2]) * 0.5 / (4.0 * np.pi), rtol=1e-5)
        # Less is reflected than the colour says.
        self.assertTrue((np.array(skin["base_color"]) < np.array(SKIN["Base Color"])).all())

    def test_nothing_sinks_into_metal_or_by_no_weight(self):
        room()
        for values in ({"Subsurface_Weight": 0.0}, {"Metallic": 1.0}, {"Subsurface_Scale": 0.0}):
            scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), principled(**values))
        self.assertFalse(any("subsurface" in table for table in self.said().values()))

    def test_all_methods(self):
        for method in ("RANDOM_WALK", "RANDOM_WALK_SKIN", "BURLEY"):
            room()
            made = principled()
            shader(made).subsurface_method = method
            scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
            scenes.ball("Wax", 0.5, (2.0, 0.0, 0.55), wax(method))
            tables = self.said()
            self.assertTrue(all("subsurface" in tables[name] for name in ("Skin", "Wax")))

    def test_the_node(self):
        room()
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), wax("RANDOM_WALK"))
        table = self.said()["Wax"]
        self.assertEqual((table["type"], table["specular"], table["subsurface"]), ("principled", 0.0, 1.0))

    def test_parts_of_what_is_closed(self):
        room()
        one = scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), wax("RANDOM_WALK"))
        one.data.materials.append(scenes.diffuse("Paint"))
        one.data.polygons[0].material_index = 1
        scene, _ = exported()
        parts = [shape for shape in scene["shapes"] if shape.get("material") == "Wax"]
        self.assertEqual([part.get("open") for part in parts], [True])

    def test_one_medium_beneath_a_mix(self):
        room()
        made = scenes.material("Both", "ShaderNodeMixShader")
        tree = made.node_tree
        for socket, scale in zip(shader(made).inputs[1:], (0.1, 0.3)):
            node = tree.nodes.new("ShaderNodeSubsurfaceScattering")
            node.inputs["Scale"].default_value = scale
            tree.links.new(node.outputs[0], socket)
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
        scene, result = exported()
        self.assertEqual(result.left_out, ["left out: subsurface scattering of the second shader in a mix of material "
                                           "'Both'"])
        self.assertEqual(sum("subsurface" in table for table in scene["materials"].values()), 1)


@unittest.skipUnless(os.environ.get("BEAMFARM_LONG"), "minutes: BEAMFARM_LONG=1")
class Compared(unittest.TestCase):
    """Cycles' own walks end after 256 scatterings, and differ between light and camera paths: hence the tolerance."""

    def check(self, name, blocks=2.0):
        self.assertEqual(compare.check(self, name, tolerance=0.02, blocks=blocks, passes=64).left_out, [])

    def test_ball(self):
        for method in ("RANDOM_WALK", "RANDOM_WALK_SKIN"):
            with self.subTest(method=method):
                room()
                made = principled()
                shader(made).subsurface_method = method
                scenes.ball("Ball", 0.7, (0.0, 0.0, 0.75), made)
                self.check(f"ball of skin, {method.lower()}")

    def test_ball_of_wax(self):
        for falloff in ("RANDOM_WALK", "RANDOM_WALK_SKIN"):
            with self.subTest(falloff=falloff):
                room()
                scenes.ball("Ball", 0.7, (0.0, 0.0, 0.75), wax(falloff))
                self.check(f"ball of wax, {falloff.lower()}")

    def test_slab_that_light_comes_through(self):
        room(world=0.05)
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 0.75))
        slab = bpy.context.object
        slab.scale = (2.0, 0.12, 1.4)
        slab.data.materials.append(wax("RANDOM_WALK", Scale=0.6))
        scenes.light("AREA", (0.0, 2.0, 1.5), 200.0, size=1.0).rotation_euler = (-1.2, 0.0, 0.0)
        # Light that is refracted as it enters gets through more often.
        self.check("slab with light behind it", blocks=3.0)

    def test_bust(self):
        room()
        head(principled(Subsurface_Scale=0.3))
        self.check("bust")


if __name__ == "__main__":
    unittest.main()
