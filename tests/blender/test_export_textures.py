"""Texture graphs, against Cycles."""

import unittest

import bpy
import compare
import numpy as np
import scenes
from test_export_graphs import add, link, noise
from test_export_materials import room, shader


@unittest.skipUnless(compare.reads("textures"), "no beamfarm that knows texture graphs: set BEAMFARM, or build it")
class Textures(unittest.TestCase):
    def check(self, name, **how):
        result = compare.check(self, name, **how)
        self.assertEqual(result.left_out, [])
        return result

    def floor(self, light=True, world=0.3):
        """The tree of the floor's material, and its shader."""
        made = room(light, world)
        return made.node_tree, shader(made)

    def test_coordinates(self):
        for output in ("Generated", "Object", "UV", "Camera"):
            with self.subTest(output=output):
                tree, node = self.floor()
                floor = bpy.data.objects["Floor"]
                floor.rotation_euler.z, floor.scale = 0.4, (1.0, 1.5, 1.0)
                where = add(tree, "TexCoord").outputs[output]
                mapped = add(tree, "Mapping", {"Vector": where, "Scale": (0.5, 0.7, 0.9)})
                link(tree, noise(tree, Vector=mapped.outputs[0], Scale=3.0).outputs["Color"], node.inputs["Color"])
                self.check(f"noise, coordinates {output.lower()}")

    def test_textures(self):
        for kind, scale in (("Voronoi", 2.0), ("Wave", 1.0), ("Magic", 1.0), ("Brick", 1.5), ("Checker", 1.0)):
            with self.subTest(kind=kind):
                tree, node = self.floor()
                where = add(tree, "TexCoord").outputs["Object"]
                made = add(tree, f"Tex{kind}", {"Vector": where, "Scale": scale})
                link(tree, made.outputs["Color"], node.inputs["Color"])
                # Corners of cells fall on other pixels.
                self.check(f"texture {kind.lower()}", blocks=1.5)

    def test_formulas(self):
        tree, node = self.floor()
        where = add(tree, "TexCoord").outputs["Object"]
        ramp = add(tree, "ValToRGB", {"Fac": noise(tree, Vector=where, Scale=2.0).outputs["Fac"]})
        ramp.color_ramp.elements[0].color = (0.8, 0.3, 0.1, 1.0)
        waves = add(tree, "TexWave", {"Vector": where, "Scale": 0.7})
        mix = add(tree, "MixRGB", {0: waves.outputs["Fac"], 1: ramp.outputs[0], 2: (0.2, 0.4, 0.6, 1.0)},
                  blend_type="SOFT_LIGHT")
        link(tree, mix.outputs[0], node.inputs["Color"])
        self.check("a ramp of noise mixed by waves")

    def test_numbers(self):
        room(light=False)
        made = scenes.material("Ball", "ShaderNodeBsdfPrincipled", Metallic=1.0, Base_Color=(0.9, 0.6, 0.3, 1.0))
        tree = made.node_tree
        rough = add(tree, "MapRange", {"Value": noise(tree, Scale=2.0).outputs["Fac"], "To Min": 0.1, "To Max": 0.4})
        link(tree, rough.outputs[0], shader(made).inputs["Roughness"])
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
        self.check("roughness by noise", blocks=1.5)

    def test_bumps(self):
        tree, node = self.floor()
        where = add(tree, "TexCoord").outputs["Object"]
        height = noise(tree, Vector=where, Scale=1.5, Detail=0.0).outputs["Fac"]
        bump = add(tree, "Bump", {"Height": height, "Distance": 0.3})
        link(tree, bump.outputs[0], node.inputs["Normal"])
        self.check("a bump by noise", blocks=1.5)

    def test_mixes(self):
        for parts in (("BsdfDiffuse", "BsdfTransparent"), ("BsdfDiffuse", "BsdfGlossy"), ("Emission", "BsdfDiffuse")):
            with self.subTest(parts=parts):
                room()
                made = scenes.material("Ball", f"ShaderNode{parts[0]}")
                tree = made.node_tree
                first = shader(made)
                output = first.outputs[0].links[0].to_socket
                factor = add(tree, "ValToRGB", {"Fac": noise(tree, Scale=2.0).outputs["Fac"]}).outputs[0]
                mix = add(tree, "MixShader", {0: factor, 1: first.outputs[0], 2: add(tree, parts[1]).outputs[0]})
                link(tree, mix.outputs[0], output)
                scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
                self.check(f"{' and '.join(parts)} by noise", blocks=1.5)

    def test_by_view(self):
        room()
        made = scenes.material("Ball", "ShaderNodeBsdfDiffuse")
        tree = made.node_tree
        link(tree, add(tree, "LayerWeight").outputs["Facing"], shader(made).inputs["Color"])
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
        self.check("a colour by where one looks from")

    def test_what_shines(self):
        room(light=False)
        made = scenes.material("Lamp", "ShaderNodeEmission", Strength=3.0)
        tree = made.node_tree
        link(tree, add(tree, "TexWave", {"Scale": 2.0}).outputs["Color"], shader(made).inputs["Color"])
        scenes.plane("Lamp", 1.0, (0.0, 0.5, 0.6), (1.2, 0.0, 0.0), made)
        self.check("a lamp with waves", blocks=1.5)

    def test_images_by_coordinates_of_objects(self):
        tree, node = self.floor()
        picture = bpy.data.images.new("Picture", 64, 64)
        picture.colorspace_settings.name = "Non-Color"
        y, x = np.mgrid[0:64, 0:64] * (2.0 * np.pi / 64.0)
        waves = [0.5 + 0.3 * wave for wave in (np.sin(x), np.cos(y), np.sin(x + y))]
        waves = np.stack([*waves, np.ones(x.shape)], axis=-1)
        picture.pixels.foreach_set(waves.astype(np.float32).ravel())
        picture.update()
        image = add(tree, "TexImage", {"Vector": add(tree, "TexCoord").outputs["Object"]}, image=picture)
        link(tree, image.outputs["Color"], node.inputs["Color"])
        self.check("an image by coordinates of its object")

    def test_worlds(self):
        room(light=False)
        tree = bpy.context.scene.world.node_tree
        where = add(tree, "Mapping", {"Vector": add(tree, "TexCoord").outputs["Generated"],
                                      "Rotation": scenes.degrees(30.0, 0.0, 40.0)})
        ramp = add(tree, "ValToRGB", {"Fac": noise(tree, Vector=where.outputs[0], Scale=1.0).outputs["Fac"]})
        ramp.color_ramp.elements[1].color = (0.3, 0.6, 1.0, 1.0)
        link(tree, ramp.outputs[0], scenes.background().inputs["Color"])
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), scenes.material("Ball", "ShaderNodeBsdfGlossy", Roughness=0.0))
        self.check("a world of noise")

    def test_densities(self):
        room()
        made = scenes.material("Fog", "ShaderNodeVolumeScatter", Color=(0.8, 0.8, 0.8, 1.0))
        tree = made.node_tree
        scatter = next(node for node in tree.nodes if node.type == "VOLUME_SCATTER")
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        tree.links.remove(output.inputs["Surface"].links[0])
        link(tree, scatter.outputs[0], output.inputs["Volume"])
        thick = add(tree, "Math", {0: noise(tree, Scale=2.0, Detail=0.0).outputs["Fac"], 1: 4.0}, operation="MULTIPLY")
        link(tree, thick.outputs[0], scatter.inputs["Density"])
        scenes.cube("Fog", 1.0, (0.0, 0.0, 0.6), made)
        self.check("fog of noise", tolerance=0.02, blocks=1.5)


if __name__ == "__main__":
    unittest.main()
