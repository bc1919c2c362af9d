"""Volumes that emit: what the add-on writes, and the pictures against Cycles."""

import pathlib
import tomllib
import unittest

import bpy
import compare
import numpy as np
import scenes

CLOUD = pathlib.Path(__file__).resolve().parents[2] / "scenes" / "volumes" / "cloud.vdb"


def floor():
    scenes.empty()
    compare.use_cycles()
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.4))
    scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))


def volume(*shaders, mix=None):
    """A material of one volume shader, or of the sum or mix of two: (type, inputs, {input: attribute})."""
    made = bpy.data.materials.new("Volume")
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    ends = []
    for node, inputs, attributes in shaders:
        shader = tree.nodes.new(node)
        scenes.set_inputs(shader, inputs)
        for name, (attribute, factor) in attributes.items():
            grid, times = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeMath")
            grid.attribute_name, times.operation = attribute, "MULTIPLY"
            times.inputs[1].default_value = factor
            tree.links.new(grid.outputs["Fac"], times.inputs[0])
            tree.links.new(times.outputs[0], shader.inputs[name])
        ends.append(shader.outputs[0])
    if len(ends) == 2:
        join = tree.nodes.new("ShaderNodeAddShader" if mix is None else "ShaderNodeMixShader")
        if mix is not None:
            join.inputs[0].default_value = mix
        for end, socket in zip(ends, list(join.inputs)[-2:]):
            tree.links.new(end, socket)
        ends = [join.outputs[0]]
    tree.links.new(ends[0], output.inputs["Volume"])
    return made


GLOW = ("ShaderNodeEmission", {"Color": (1.0, 0.5, 0.2), "Strength": 1.5}, {})
FOG = ("ShaderNodeVolumeScatter", {"Color": (0.8, 0.6, 0.4), "Density": 0.8, "Anisotropy": 0.3}, {})
DARK = ("ShaderNodeVolumeAbsorption", {"Color": (0.8, 0.6, 0.4), "Density": 2.0}, {})
HOT = (
    "ShaderNodeVolumePrincipled",
    {"Density": 1.0, "Blackbody_Intensity": 1.0, "Blackbody_Tint": (1.0, 0.8, 0.6), "Temperature": 2400.0},
    {},
)
SHINING = (
    "ShaderNodeVolumePrincipled", {"Density": 0.5, "Emission_Strength": 0.7, "Emission_Color": (0.2, 0.6, 1.0)}, {})


def cloud(*shaders):
    data = bpy.data.volumes.new("Cloud")
    data.filepath = str(CLOUD)
    data.grids.load()
    corners = np.array(scenes.link("Cloud", data).bound_box)
    made = bpy.data.objects["Cloud"]
    data.materials.append(volume(*shaders))
    size = (corners.max(0) - corners.min(0)).max()
    made.scale = [2.0 / size] * 3
    made.location = (0.0, 0.0, 1.2)
    return made


def media(result):
    return list(tomllib.loads(result.text)["media"].values())


class Text(unittest.TestCase):
    def medium(self, *shaders, **how):
        floor()
        scenes.cube("Fire", 1.0, (0.0, 0.0, 0.8), volume(*shaders, **how))
        result = compare.export_scene()
        self.assertEqual(result.left_out, [])
        return media(result)[0]

    def near(self, found, expected):
        np.testing.assert_allclose(found, expected, rtol=1e-5)

    def test_strength_times_colour(self):
        made = self.medium(GLOW)
        self.assertEqual((made["type"], made["sigma_a"], made["sigma_s"]), ("homogeneous", 0.0, 0.0))
        self.near(made["emission"], [1.5, 0.75, 0.3])

    def test_sums_and_mixtures(self):
        made = self.medium(GLOW, FOG)
        self.near(made["emission"], [1.5, 0.75, 0.3])
        self.near(made["sigma_s"], [0.64, 0.48, 0.32])
        self.near(self.medium(GLOW, GLOW)["emission"], [3.0, 1.5, 0.6])
        made = self.medium(FOG, GLOW, mix=0.25)
        self.near(made["emission"], [0.375, 0.1875, 0.075])
        self.near(made["sigma_s"], [0.48, 0.36, 0.24])

    def test_black_bodies(self):
        emission = self.medium(HOT)["emission"]
        self.near(emission["color"], [1e-6, 8e-7, 6e-7])
        self.near(emission["temperature"], 2400.0)

    def test_grids(self):
        floor()
        cloud(("ShaderNodeEmission", {}, {"Strength": ("density", 3.0)}))
        result = compare.export_scene()
        (made,) = media(result)
        self.assertEqual((made["type"], result.left_out), ("homogeneous", []))
        self.assertEqual(made["emission"]["field"]["grid"], "density")
        self.assertIn("transform", made)

    def test_a_world_that_shines_is_told(self):
        floor()
        tree = bpy.context.scene.world.node_tree
        shader = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(shader.outputs[0], tree.nodes["World Output"].inputs["Volume"])
        self.assertTrue(any("emits" in line for line in compare.export_scene().left_out))


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Pictures(unittest.TestCase):
    def test_cubes(self):
        cases = {"emission": (GLOW,), "and fog": (GLOW, FOG), "and absorption": (GLOW, DARK)}
        for name, shaders in (cases | {"black body": (HOT,), "principled": (SHINING,)}).items():
            with self.subTest(name):
                floor()
                scenes.cube("Fire", 1.0, (0.0, 0.0, 0.8), volume(*shaders))
                compare.check(self, f"cube: {name}", passes=32)

    def test_a_grid(self):
        floor()
        glow = ("ShaderNodeEmission", {"Color": (1.0, 0.5, 0.2)}, {"Strength": ("density", 6.0)})
        fog = ("ShaderNodeVolumeAbsorption", {"Color": (0.2, 0.3, 0.4)}, {"Density": ("density", 4.0)})
        cloud(glow, fog)
        # Its edges are off by a quarter of a pixel.
        result = compare.check(self, "cloud that emits", blocks=3.0, passes=64)
        self.assertEqual(result.left_out, [])


if __name__ == "__main__":
    unittest.main()
