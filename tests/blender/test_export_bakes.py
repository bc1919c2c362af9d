"""Baking of nodes that the scene file cannot express; with BEAMFARM_LONG=1 against Cycles."""

import math
import os
import re
import pathlib
import tempfile
import unittest
from unittest import mock

import bpy
import compare
import numpy as np
import scenes
from export import bakes
from test_export_graphs import add, link
from test_export_sky import HEIGHT, IS_NEW, around, by_cycles, irradiance
from test_export_text import exported, room

LONG = bool(os.environ.get("BEAMFARM_LONG"))


def wavelengths(node):
    """The base colour from a node that the scene file lacks."""
    color = add(node.id_data, "Wavelength", {0: 560.0})
    link(node.id_data, color.outputs[0], node.inputs["Base Color"])
    return color


class Baked(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def image(self, table):
        """Pixels of an image in the export."""
        return compare.read(self.folder / table["image"])

    def exported(self):
        import tomllib

        result = compare.export_scene(self.folder)
        return tomllib.loads(result.text), result

    def test_an_image_over_uv_of_its_own(self):
        wavelengths(room())
        scene, result = self.exported()
        self.assertEqual(result.left_out, [])
        self.assertIn("material 'Rock' on 'Ball': node 'Wavelength' is baked at 1024", result.notes)
        table = scene["materials"]["Rock on Ball"]["base_color"]
        self.assertEqual(table["vector"], {"attribute": "color"})
        # Yellowish green, everywhere that the mesh covers.
        red, green, blue = np.median(self.image(table).reshape(-1, 3), axis=0)
        self.assertGreater(green, 2.0 * abs(blue))
        self.assertGreater(red, 0.1)

    def test_the_file_stays_as_it_is(self):
        wavelengths(room())

        def state():
            lists = [sorted(each.name for each in getattr(bpy.data, kind)) for kind in
                     ("objects", "meshes", "materials", "images", "scenes", "worlds", "node_groups")]
            shown = bpy.context.selected_objects, bpy.context.object, bpy.context.scene.render.engine
            return lists, shown, [layer.name for layer in bpy.data.meshes["Ball"].uv_layers]

        before = state()
        exported()
        self.assertEqual(state(), before)

    def test_within_groups_and_negative(self):
        node = room()
        tree = node.id_data
        group = bpy.data.node_groups.new("Where", "ShaderNodeTree")
        group.interface.new_socket("Vector", in_out="OUTPUT", socket_type="NodeSocketVector")
        out, other = group.nodes.new("NodeGroupOutput"), scenes.link("Other", None)
        other.location = (3.0, 0.0, 0.0)
        where = add(group, "TexCoord")
        where.object = other
        group.links.new(where.outputs["Object"], out.inputs[0])
        placed = tree.nodes.new("ShaderNodeGroup")
        placed.node_tree = group
        link(tree, add(tree, "TexNoise", {"Vector": placed.outputs[0]}).outputs["Fac"], node.inputs["Roughness"])
        scene, result = self.exported()
        self.assertEqual(result.left_out, [])
        (noise,) = (table for table in scene["textures"].values() if table["node"] == "noise")
        # The ball is 3 to the left of the other: numbers below 0 are raised.
        self.assertEqual(noise["vector"]["operation"], "add")
        values = self.image(noise["vector"]["a"])[..., 0] + noise["vector"]["b"]
        self.assertAlmostEqual(values.min(), -3.5, delta=0.01)
        # Outside the mesh the image keeps its initial value, 0.
        self.assertAlmostEqual(values[values < -1.0].max(), -2.5, delta=0.01)

    def test_colours_of_vertices_make_room(self):
        node = room()
        tree = node.id_data
        bpy.data.objects["Ball"].data.attributes.new("Col", "FLOAT_COLOR", "POINT")
        colors = add(tree, "Attribute")
        colors.attribute_name = "Col"
        wave = wavelengths(node)
        mixed = add(tree, "MixRGB", {1: colors.outputs["Color"], 2: wave.outputs[0]})
        link(tree, mixed.outputs[0], node.inputs["Base Color"])
        _, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertEqual(sum("is baked at 1024" in line for line in result.notes), 2)

    def test_what_depends_on_the_view_is_not_baked(self):
        node = room()
        tree = node.id_data
        where = add(tree, "TexCoord")
        link(tree, where.outputs["Reflection"], node.inputs["Base Color"])
        _, result = exported()
        self.assertEqual(result.left_out, ["left out: node 'Texture Coordinate' of material 'Rock': "
                                           "reflection coordinates"])

    def test_what_cannot_be_baked_is_left_out(self):
        wavelengths(room())
        with mock.patch.object(bakes, "_command", lambda folder: ["false"]):
            scene, result = exported()
        self.assertEqual(result.left_out, ["left out: node 'Wavelength' of material 'Rock'"])
        self.assertIn("Blender ended with 1", str(result.notes))
        self.assertNotIn("attribute", str(scene["materials"]))

    def test_instances_share_what_is_alike_at_all_places(self):
        node = room()
        wavelengths(node)
        collection = bpy.data.collections.new("Balls")
        ball = bpy.data.objects["Ball"]
        bpy.context.scene.collection.objects.unlink(ball)
        collection.objects.link(ball)
        for x in (-1.0, 1.0):
            placed = scenes.link(f"Copy {x}", None)
            placed.instance_type, placed.instance_collection = "COLLECTION", collection
            placed.location.x = x
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertEqual(len(scene["shapes"]), 2)

    def test_normals_of_a_fresnel(self):
        node = room()
        tree = node.id_data
        geometry = add(tree, "NewGeometry")
        flat = add(tree, "Fresnel", {"IOR": 1.5, "Normal": geometry.outputs["Incoming"]})
        link(tree, flat.outputs[0], node.inputs["Roughness"])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertIn("dot_product", str(scene))


class Worlds(unittest.TestCase):
    def check(self, node, tolerance):
        with tempfile.TemporaryDirectory() as folder:
            result = compare.export_scene(folder)
            self.assertEqual(result.left_out, [])
            light = result.text[result.text.index('"environment"'):]
            image = pathlib.Path(folder) / re.search(r'image = "(.*?)"', light)[1]
            ours = compare.read(image)[::-1]
        side = ours.shape[0] // HEIGHT
        ours = ours.reshape(HEIGHT, side, 2 * HEIGHT, side, 3).mean(axis=(1, 3))
        ratio = irradiance(ours) / irradiance(by_cycles(256 if node.sun_disc else 16))
        print(f"sky {node.sky_type.lower()}, sun {node.sun_disc}: {ratio}", flush=True)
        np.testing.assert_allclose(ratio, 1.0, atol=tolerance)

    def room(self, **values):
        node = around(**values)
        scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
        scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))
        return node

    def test_a_sky_of_hosek_and_wilkie(self):
        sun = (math.cos(0.6), 0.0, math.sin(0.6))
        self.check(self.room(sky_type="HOSEK_WILKIE", turbidity=3.0, ground_albedo=0.3, sun_direction=sun), 0.005)

    @unittest.skipUnless(IS_NEW, "a sky of Blender 5")
    def test_a_sky_that_is_scattered_again(self):
        self.check(self.room(sky_type="MULTIPLE_SCATTERING"), 0.005)
        self.check(self.room(sky_type="MULTIPLE_SCATTERING", sun_disc=True, sun_size=0.2, sun_intensity=0.5), 0.035)

    def test_what_the_camera_sees_and_what_lights(self):
        self.room()
        tree = bpy.context.scene.world.node_tree
        path = tree.nodes.new("ShaderNodeLightPath")
        mix = tree.nodes.new("ShaderNodeMixRGB")
        mix.inputs[1].default_value, mix.inputs[2].default_value = (1.0, 0.5, 0.25, 1.0), (0.0, 0.0, 1.0, 1.0)
        tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
        tree.links.new(mix.outputs[0], scenes.background().inputs["Color"])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertEqual({tuple(light["visible"]): light["radiance"] for light in scene["lights"]}, {
            ("camera",): [0.0, 0.0, 1.0], ("reflected", "refracted", "shadow", "photon"): [1.0, 0.5, 0.25]})
        # Where all rays see the same, a single light is written.
        tree.links.new(path.outputs["Is Shadow Ray"], mix.inputs[0])
        scene, _ = exported()
        self.assertEqual(len(scene["lights"]), 1)


@unittest.skipUnless(LONG and compare.program(), "minutes: BEAMFARM_LONG=1")
class Compared(unittest.TestCase):
    def lit(self):
        node = room()
        scenes.light("AREA", (2.0, -2.0, 3.0), 200.0, size=1.0)
        scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))
        return node

    def test_coordinates_of_another_object(self):
        node = self.lit()
        where = add(node.id_data, "TexCoord")
        where.object = scenes.link("Other", None)
        where.object.location, where.object.rotation_euler = (3.0, 0.2, 0.1), (0.3, 0.4, 0.5)
        link(node.id_data, add(node.id_data, "TexNoise", {"Vector": where.outputs["Object"]}).outputs["Color"],
             node.inputs["Base Color"])
        compare.check(self, "coordinates of another object")

    def test_pointiness(self):
        node = self.lit()
        pointed = add(node.id_data, "NewGeometry").outputs["Pointiness"]
        ramp = add(node.id_data, "ValToRGB", {"Fac": pointed})
        ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.4, 0.6
        link(node.id_data, ramp.outputs["Color"], node.inputs["Base Color"])
        scenes.cube("Box", 0.6, (0.8, 0.3, 0.3), bpy.data.materials["Rock"])
        compare.check(self, "pointiness")

    def test_normals_of_fresnel_and_layer_weight(self):
        for kind, output in (("Fresnel", "Fac"), ("LayerWeight", "Fresnel"), ("LayerWeight", "Facing")):
            with self.subTest(kind=kind, output=output):
                node = self.lit()
                bump = add(node.id_data, "Bump", {"Height": add(node.id_data, "TexNoise").outputs["Fac"]})
                by = add(node.id_data, kind, {"Normal": bump.outputs[0]})
                link(node.id_data, by.outputs[output], node.inputs["Base Color"])
                compare.check(self, f"{kind} {output} of a bump")

    def test_a_world_that_only_the_camera_sees(self):
        self.lit()
        tree = bpy.context.scene.world.node_tree
        path, mix = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMixRGB")
        mix.inputs[1].default_value, mix.inputs[2].default_value = (1.0, 0.5, 0.25, 1.0), (0.0, 0.0, 1.0, 1.0)
        tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
        tree.links.new(mix.outputs[0], scenes.background().inputs["Color"])
        scenes.ball("Mirror", 0.4, (1.0, 0.0, 0.4), scenes.material("M", "ShaderNodeBsdfGlossy", Roughness=0.0))
        scenes.ball("Glass", 0.4, (-1.0, 0.0, 0.4), scenes.material("G", "ShaderNodeBsdfGlass", Roughness=0.0))
        compare.check(self, "a world of two")


if __name__ == "__main__":
    unittest.main()
