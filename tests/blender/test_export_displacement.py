"""True displacement as exported; with BEAMFARM_LONG=1 against Cycles."""

import os
import unittest

import bpy
import compare
import scenes

LONG = bool(os.environ.get("BEAMFARM_LONG"))


def bumpy(texture="ShaderNodeTexNoise", space="OBJECT"):
    made = scenes.diffuse("Rock", (0.6, 0.5, 0.4))
    tree = made.node_tree
    made.displacement_method = "DISPLACEMENT"
    height, node = tree.nodes.new(texture), tree.nodes.new("ShaderNodeDisplacement")
    if texture == "ShaderNodeTexNoise":
        height.inputs["Scale"].default_value, height.inputs["Detail"].default_value = 3.0, 0.0
    node.space = space
    node.inputs["Midlevel"].default_value, node.inputs["Scale"].default_value = 0.5, 0.4
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(height.outputs[0], node.inputs["Height"])
    tree.links.new(node.outputs[0], output.inputs["Displacement"])
    return made


def stage(material):
    scenes.empty()
    scenes.camera((0.0, -4.0, 1.5), (0.0, 0.0, 0.0), 50.0)
    scenes.light("AREA", (2.0, -2.0, 3.0), 300.0, size=1.0)
    return scenes.ball("Ball", 0.8, material=material(), segments=128)


class Exports(unittest.TestCase):
    def test_the_mesh_as_it_is(self):
        stage(bumpy)
        result = compare.export_scene()
        self.assertEqual(result.left_out, [])
        self.assertIn("midlevel = 0.5", result.text)
        self.assertIn("edge = 1000000000", result.text)
        self.assertNotIn("bump", result.text.replace("bumpy", ""))

    def test_what_a_mesh_holds(self):
        # Alone, and with nodes that process it.
        for is_mixed in (False, True):
            ball = stage(lambda: bumpy("ShaderNodeAttribute"))
            colors = ball.data.color_attributes.new("Heights", "FLOAT_COLOR", "POINT")
            colors.data.foreach_set("color", [0.5] * (4 * len(ball.data.vertices)))
            tree = ball.active_material.node_tree
            attribute = next(node for node in tree.nodes if node.type == "ATTRIBUTE")
            attribute.attribute_name = "Heights"
            if is_mixed:
                mixed, noise = tree.nodes.new("ShaderNodeMath"), tree.nodes.new("ShaderNodeTexNoise")
                displacement = next(node for node in tree.nodes if node.type == "DISPLACEMENT")
                tree.links.new(attribute.outputs["Fac"], mixed.inputs[0])
                tree.links.new(noise.outputs[0], mixed.inputs[1])
                tree.links.new(mixed.outputs[0], displacement.inputs["Height"])
            result = compare.export_scene()
            self.assertEqual(len(result.left_out), 1, result.left_out)
            self.assertIn("displacement of material 'Rock'", result.left_out[0])
            self.assertNotIn("midlevel", result.text)

    def test_adaptive(self):
        ball = stage(bumpy)
        modifier = ball.modifiers.new("Subdivision", "SUBSURF")
        target = modifier if hasattr(modifier, "use_adaptive_subdivision") else ball.cycles
        target.use_adaptive_subdivision = True
        text = compare.export_scene().text
        edge = float(text.split("edge = ")[1].split()[0].rstrip(",}"))
        self.assertTrue(1e-4 < edge < 0.1, edge)


@unittest.skipUnless(LONG, "minutes")
class BesideCycles(unittest.TestCase):
    def test_noise(self):
        stage(bumpy)
        compare.use_cycles(48, 48, 128)
        compare.check(self, "displaced by noise", tolerance=0.02, blocks=1.5)


if __name__ == "__main__":
    unittest.main()
