"""The contents of scene files, and the messages about the rest. No renderer is needed."""

import math
import pathlib
import tempfile
import tomllib
import unittest
from types import SimpleNamespace

import bpy
import compare
import numpy as np
import scenes
from export import Exporter, ExportSettings, View, exporter, formulas, toml
from export.lights import spot_angles
from export.meshes import MeshArrays, ply
from export.names import Names
from export.pictures import exr
from mathutils import Matrix


def exported(bakes=True):
    result = compare.export_scene(bakes=bakes)
    return tomllib.loads(result.text), result


def room(**inputs):
    """A ball with a Principled BSDF; returns its node."""
    scenes.empty()
    compare.use_cycles()
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
    made = scenes.material("Rock", **inputs)
    scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), made, segments=8)
    return next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


class Text(unittest.TestCase):
    def test_any_text_and_number_reads_back(self):
        table = {
            'a "b"\n\\é': {"x": 0.1, "n": 3, "on": True, "many": [[0.25, -0.0]], "in": {"k ": "\x01\x7f"}},
            "list": [{"name": "one"}, {"name": "two"}],
            "tables": {"a b": {"v": float(np.float32(0.6))}, "c": {"v": 1e-30}},
        }
        read = tomllib.loads(toml.document(table))
        self.assertEqual(np.float32(read["tables"]["a b"].pop("v")), np.float32(0.6))
        table["tables"]["a b"] = {}
        self.assertEqual(read, table)
        with self.assertRaises(ValueError):
            toml.inline(math.inf)

    def test_names_are_unique_and_stay(self):
        names = Names()
        self.assertEqual([names.get(key, "a[1]") for key in (1, 2, 1)], ["a_1_", "a_1_-2", "a_1_"])
        self.assertNotEqual(names.get(3, "all"), "all")

    def test_spots_fall_off_as_in_blender(self):
        for half, blend in ((20.0, 0.15), (40.0, 0.5), (60.0, 1.0), (85.0, 0.3), (30.0, 0.0)):
            half = math.radians(half)
            theta = np.linspace(0.0, half, 20001)
            width = (1.0 - math.cos(half)) * max(blend, 1e-3)
            full, none = spot_angles(half, blend)
            self.assertLess(full, none)
            x, ours = (
                np.clip((np.cos(theta) - math.cos(half)) / width, 0.0, 1.0),
                np.clip((np.cos(theta) - math.cos(none)) / (math.cos(full) - math.cos(none)), 0.0, 1.0),
            )
            wanted, ours = (x * x * (3.0 - 2.0 * x) for x in (x, ours))
            self.assertLess(abs((ours * np.sin(theta)).sum() / (wanted * np.sin(theta)).sum() - 1.0), 2e-3)
            self.assertLess(np.abs(ours - wanted).max(), 1e-3 if blend > 0.0 else 1.0)

    def test_lights_with_a_size_are_one_each(self):
        room()
        scenes.light("SPOT", (0.5, 0.3, 2.0), 50.0, shadow_soft_size=0.25, spot_size=math.radians(60.0), spot_blend=0.5)
        scenes.light("SUN", (0.5, 0.3, 2.0), 2.0, angle=math.radians(4.0))
        scenes.light("SUN", (0.5, 0.3, 2.0), 2.0, angle=math.pi)
        spot, sun, half = exported()[0]["lights"]
        self.assertEqual((spot["radius"], spot["falloff"]), (0.25, "smooth"))
        self.assertAlmostEqual(spot["cutoff_angle"], 30.0, 4)
        self.assertAlmostEqual(sun["angle"], 4.0, 4)
        self.assertLess(half["angle"], 180.0)

    def test_pictures_read_back(self):
        values = np.random.default_rng(1).random((5, 7, 3)).astype(np.float32)
        with tempfile.TemporaryDirectory() as folder:
            for half in (False, True):
                path = pathlib.Path(folder) / "a.exr"
                path.write_bytes(exr(values, half))
                np.testing.assert_allclose(compare.read(path), values[::-1], atol=5e-4 if half else 0.0)


class Said(unittest.TestCase):
    def test_nodes_that_are_left_out(self):
        node = room()
        tree = node.id_data
        occlusion = tree.nodes.new("ShaderNodeAmbientOcclusion")
        tree.links.new(occlusion.outputs["AO"], node.inputs["Base Color"])
        _, result = exported()
        self.assertEqual(result.left_out, ["left out: node 'Ambient Occlusion' of material 'Rock'"])

    def test_attributes_of_objects_are_left_out(self):
        node = room()
        tree = node.id_data
        color = tree.nodes.new("ShaderNodeAttribute")
        color.attribute_type, color.attribute_name = "OBJECT", "paint"
        tree.links.new(color.outputs["Color"], node.inputs["Base Color"])
        scene, result = exported(bakes=False)
        self.assertEqual(len(result.left_out), 1, result.left_out)
        self.assertIn("attribute 'paint' of the object", result.left_out[0])
        self.assertNotIn("attribute", str(scene["materials"]))

    def test_inputs_that_are_left_out(self):
        room(Coat_Weight=0.5, Coat_Tint=(1.0, 0.5, 0.5))
        _, result = exported()
        self.assertEqual(len(result.left_out), 1)
        self.assertIn("coat's tint", result.left_out[0])

    def test_rough_bases(self):
        for more, field in (({}, "diffuse_roughness"), ({"Roughness": 0.0}, "diffuse_roughness"),
                            ({"Specular_IOR_Level": 0.0}, "roughness"), ({"Metallic": 1.0}, None)):
            with self.subTest(more=more):
                room(Diffuse_Roughness=0.3, **more)
                scene, result = exported()
                self.assertEqual(result.left_out, [])
                table = scene["materials"]["Rock"]
                if field is not None:
                    self.assertAlmostEqual(table[field], 0.3, places=6)
                self.assertEqual("diffuse_roughness" in table, field == "diffuse_roughness")

    def test_objects_that_are_left_out(self):
        room()
        curves = bpy.data.hair_curves.new("Hair")
        curves.add_curves([4])
        scenes.link("Hair", curves)
        bpy.data.objects["Ball"].is_shadow_catcher = True
        _, result = exported()
        self.assertEqual(len(result.left_out), 1, result.left_out)

    def test_light_through_a_world_of_fog(self):
        room()
        scenes.light("SUN", (0.0, 0.0, 3.0), 1.0)
        tree = bpy.context.scene.world.node_tree
        scatter = tree.nodes.new("ShaderNodeVolumeScatter")
        tree.links.new(scatter.outputs[0], tree.nodes["World Output"].inputs["Volume"])
        scene, result = exported()
        self.assertIn(scene["world"]["medium"], scene["media"])
        self.assertIn("sun", result.left_out[0])

    def test_portals_give_no_light(self):
        for is_portal in (False, True):
            room()
            scenes.light("AREA", (0.0, 0.0, 3.0), 100.0).data.cycles.is_portal = is_portal
            scene, result = exported()
            self.assertEqual(["emission" in shape for shape in scene["shapes"]].count(True), not is_portal)
            self.assertEqual(result.left_out, [])


class Fields(unittest.TestCase):
    def texture(self, node, socket, output="Color", separate=None):
        tree = node.id_data
        picture = bpy.data.images.new("Picture", 4, 4, alpha=True)
        picture.colorspace_settings.name = "Non-Color"
        picture.pixels.foreach_set(np.tile(np.float32([0.2, 0.4, 0.8, 0.5]), 16))
        picture.update()
        with tempfile.NamedTemporaryFile(suffix=".png") as file:
            picture.filepath_raw, picture.file_format = file.name, "PNG"
            picture.save()
            picture.pack()
        image = tree.nodes.new("ShaderNodeTexImage")
        image.image = picture
        value = image.outputs[output]
        if separate:
            apart = tree.nodes.new("ShaderNodeSeparateColor")
            tree.links.new(value, apart.inputs[0])
            value = apart.outputs[separate]
        tree.links.new(value, node.inputs[socket])

    def test_numbers_by_texture(self):
        node = room()
        self.texture(node, "Roughness", separate="Green")
        self.texture(node, "Metallic", separate="Blue")
        self.texture(node, "Alpha", output="Alpha")
        scene, result = exported()
        table = scene["materials"]["Rock"]
        self.assertEqual((table["roughness"]["channel"], table["roughness"]["raw"]), ("g", True))
        self.assertEqual(table["metallic"]["channel"], "b")
        self.assertEqual(table["opacity"]["channel"], "a")
        self.assertEqual(result.left_out, [])

    def test_what_shines_by_texture(self):
        node = room(Emission_Strength=5.0)
        self.texture(node, "Emission Color")
        scene, result = exported()
        emission = scene["shapes"][0]["emission"]
        self.assertTrue(emission["radiance"]["image"].endswith(".png"))
        self.assertTrue(emission["radiance"]["raw"])
        self.assertEqual(emission["scale"], 5.0)
        self.assertEqual(result.left_out, [])

    def test_lobes(self):
        room(Transmission_Weight=0.5, Sheen_Weight=0.3)
        scene, result = exported()
        table = scene["materials"]["Rock"]
        self.assertEqual(table["spec_trans"], 0.5)
        self.assertFalse(table["two_sided"])
        self.assertAlmostEqual(table["sheen_weight"], 0.3, places=6)
        self.assertEqual((table["sheen_roughness"], "sheen_color" in table), (0.5, False))
        self.assertEqual((result.left_out, result.notes), ([], []))
        room(Sheen_Weight=0.3, Sheen_Roughness=0.25, Sheen_Tint=(1.0, 0.5, 0.25))
        scene, result = exported()
        table = scene["materials"]["Rock"]
        self.assertEqual((table["sheen_roughness"], table["sheen_color"]), (0.25, [1.0, 0.5, 0.25]))
        self.assertEqual((result.left_out, result.notes), ([], []))

    def test_what_lies_over(self):
        over = {"Coat_Weight": 0.4, "Coat_Roughness": 0.1, "Coat_IOR": 1.6, "Thin_Film_Thickness": 300.0,
                "Thin_Film_IOR": 1.4, "Specular_Tint": (1.0, 0.5, 0.25)}
        room(IOR=2.0, **over)
        scene, result = exported()
        table = scene["materials"]["Rock"]
        found = {name: table[name] for name in ("coat_weight", "coat_roughness", "coat_ior", "thin_film_thickness",
                                                "thin_film_ior", "ior")}
        expected = {"coat_weight": 0.4, "coat_roughness": 0.1, "coat_ior": 1.6, "thin_film_thickness": 0.3,
                    "thin_film_ior": 1.4, "ior": 2.0}
        for name, value in expected.items():
            self.assertAlmostEqual(found[name], value, places=5, msg=name)
        self.assertEqual(table["specular_color"], [1.0, 0.5, 0.25])
        self.assertEqual(result.left_out, [])
        # By textures as well, if they are one number.
        node = room(**over)
        noise = node.id_data.nodes.new("ShaderNodeTexNoise")
        for name in ("Coat Weight", "Coat Roughness"):
            node.id_data.links.new(noise.outputs[0], node.inputs[name])
        scene, result = exported()
        table = scene["materials"]["Rock"]
        self.assertEqual([table[name].keys() for name in ("coat_weight", "coat_roughness")], [{"texture": 0}.keys()] * 2)
        self.assertEqual(result.left_out, [])
        # Light goes through it as well.
        room(Transmission_Weight=0.5, **over)
        scene, result = exported()
        self.assertEqual([line.split(" of ")[0] for line in result.left_out],
                         ["left out: coat", "left out: specular tint"])
        self.assertIn("thin_film_thickness", scene["materials"]["Rock"])

    def test_one_eye_of_two(self):
        room()
        bpy.context.scene.render.use_multiview = True
        _, result = exported()
        self.assertEqual(result.left_out, ["left out: stereoscopy: only the camera's own view is written"])

    def test_normals_of_coats(self):
        def bumpy(node, name, height):
            nodes, links = node.id_data.nodes, node.id_data.links
            bump, noise = nodes.new("ShaderNodeBump"), nodes.new("ShaderNodeTexNoise")
            bump.inputs["Distance"].default_value = height
            links.new(noise.outputs[0], bump.inputs["Height"])
            links.new(bump.outputs[0], node.inputs[name])
            return bump

        def made():
            scene, result = exported()
            self.assertEqual((result.left_out, result.notes), ([], []))
            table = scene["materials"]["Rock"]
            return {name: value for name, value in table.items() if "bump" in name or name == "coat_levels"}

        room(Coat_Weight=1.0)
        self.assertEqual(made(), {})
        # A bump below does not affect the coat.
        node = room(Coat_Weight=1.0)
        bump = bumpy(node, "Normal", 0.5)
        found = made()
        self.assertEqual(found.keys(), {"bump", "coat_levels"})
        self.assertTrue(found["coat_levels"])
        # The same below and above.
        node.id_data.links.new(bump.outputs[0], node.inputs["Coat Normal"])
        self.assertEqual(made().keys(), {"bump"})
        # Its own, with and without one below.
        bumpy(node, "Coat Normal", 0.25)
        found = made()
        self.assertEqual((found.keys(), found["bump"]["scale"], found["coat_bump"]["scale"]),
                         ({"bump", "coat_bump"}, 0.5, 0.25))
        self.assertNotEqual(found["bump"]["texture"], found["coat_bump"]["texture"])
        node.id_data.links.remove(node.inputs["Normal"].links[0])
        self.assertEqual(made().keys(), {"coat_bump"})

    def test_blends(self):
        node = room(Metallic=1.0)
        tree = node.id_data
        glass, mix = tree.nodes.new("ShaderNodeBsdfGlass"), tree.nodes.new("ShaderNodeMixShader")
        mix.inputs[0].default_value = 0.25
        output = node.outputs[0].links[0].to_socket
        tree.links.new(node.outputs[0], mix.inputs[1])
        tree.links.new(glass.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], output)
        scene, _ = exported()
        blend = scene["materials"]["Rock"]
        self.assertEqual((blend["type"], blend["weight"]), ("blend", 0.25))
        kinds = [scene["materials"][name]["type"] for name in blend["materials"]]
        self.assertEqual(kinds, ["principled", "dielectric"])

    def mixed(self, base, coat, index=1.45, **inputs):
        """A material of two shaders mixed by a Fresnel node, and the messages."""
        node = room()
        tree = node.id_data
        output = node.outputs[0].links[0].to_socket
        mix, fresnel = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeFresnel")
        fresnel.inputs["IOR"].default_value = index
        parts = [tree.nodes.new(f"ShaderNodeBsdf{kind}") for kind in (base, coat)]
        for part in parts:
            scenes.set_inputs(part, {name: value for name, value in inputs.items() if name in part.inputs})
        tree.links.new(fresnel.outputs[0], mix.inputs[0])
        for part, socket in zip(parts, mix.inputs[1:]):
            tree.links.new(part.outputs[0], socket)
        tree.links.new(mix.outputs[0], output)
        scene, result = exported()
        return scene["materials"]["Rock"], result

    def test_mixes_by_fresnel(self):
        glass, result = self.mixed("Refraction", "Glossy", IOR=1.45, Roughness=0.0)
        self.assertEqual(glass["type"], "dielectric")
        self.assertAlmostEqual(glass["ior"], 1.45, places=6)
        self.assertEqual((result.left_out, result.notes), ([], []))
        plastic, result = self.mixed("Diffuse", "Glossy", index=1.6, Roughness=0.2, Color=(0.5, 0.5, 0.5))
        self.assertEqual(plastic["type"], "rough_plastic")
        self.assertAlmostEqual(plastic["alpha"], 0.04, places=6)
        self.assertEqual(result.left_out, [])
        other, result = self.mixed("Diffuse", "Translucent", index=1.5)
        self.assertEqual(other["weight"], {"texture": "Rock/Fresnel"})
        self.assertEqual(result.left_out, [])

    def test_leaves_are_translucent(self):
        node = room()
        tree = node.id_data
        output = node.outputs[0].links[0].to_socket
        diffuse, through = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfTranslucent")
        diffuse.inputs["Color"].default_value = (0.1, 0.4, 0.1, 1.0)
        through.inputs["Color"].default_value = (0.2, 0.5, 0.1, 1.0)
        both = tree.nodes.new("ShaderNodeAddShader")
        tree.links.new(diffuse.outputs[0], both.inputs[0])
        tree.links.new(through.outputs[0], both.inputs[1])
        tree.links.new(both.outputs[0], output)
        scene, result = exported()
        leaf = scene["materials"]["Rock"]
        self.assertEqual(leaf["type"], "translucent")
        np.testing.assert_allclose(leaf["reflectance"], [0.1, 0.4, 0.1], rtol=1e-6)
        np.testing.assert_allclose(leaf["transmittance"], [0.2, 0.5, 0.1], rtol=1e-6)
        self.assertEqual(result.left_out, [])

    def test_light_paths_count_as_one_kind_of_ray(self):
        node = room()
        tree = node.id_data
        output = node.outputs[0].links[0].to_socket
        mix, path = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeLightPath")
        glass, clear = tree.nodes.new("ShaderNodeBsdfGlass"), tree.nodes.new("ShaderNodeBsdfTransparent")
        tree.links.new(path.outputs["Is Shadow Ray"], mix.inputs[0])
        tree.links.new(glass.outputs[0], mix.inputs[1])
        tree.links.new(clear.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], output)
        scene, result = exported()
        self.assertEqual(scene["materials"]["Rock"]["type"], "dielectric")
        self.assertEqual(result.left_out, [])
        self.assertIn("caustics are rendered here", str(result.notes))

    def test_half_metals_that_lose_light_are_mixed(self):
        node = room(Metallic=0.25)
        scene, _ = exported()
        self.assertEqual(scene["materials"]["Rock"]["type"], "principled")
        node.distribution = "GGX"
        scene, _ = exported()
        rock = scene["materials"]["Rock"]
        self.assertEqual((rock["type"], rock["weight"]), ("blend", 0.25))
        plastic, metal = (scene["materials"][name] for name in rock["materials"])
        self.assertEqual((plastic["metallic"], metal["metallic"], metal["multiple_scattering"]), (0.0, 1.0, False))

    def test_sums_with_what_lets_all_through(self):
        node = room()
        tree = node.id_data
        output = node.outputs[0].links[0].to_socket
        both = tree.nodes.new("ShaderNodeAddShader")
        clear, shine = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeBsdfGlossy")
        shine.inputs["Color"].default_value = (0.04, 0.02, 0.01, 1.0)
        tree.links.new(clear.outputs[0], both.inputs[0])
        tree.links.new(shine.outputs[0], both.inputs[1])
        tree.links.new(both.outputs[0], output)
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        rock = scene["materials"]["Rock"]
        self.assertAlmostEqual(rock["opacity"], 0.04, places=6)
        np.testing.assert_allclose(rock["reflectance"], [1.0, 0.5, 0.25], rtol=1e-6)

    def test_diffuse_added_to_principled(self):
        node = room(Base_Color=(0.5, 0.25, 0.125))
        tree = node.id_data
        output = node.outputs[0].links[0].to_socket
        both, more = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeBsdfDiffuse")
        more.inputs["Color"].default_value = (0.25, 0.25, 0.25, 1.0)
        tree.links.new(node.outputs[0], both.inputs[0])
        tree.links.new(more.outputs[0], both.inputs[1])
        tree.links.new(both.outputs[0], output)
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertEqual(scene["materials"]["Rock"]["base_color"], [0.75, 0.5, 0.375])

    def test_a_displacement_that_nothing_is_linked_to(self):
        node = room()
        tree = node.id_data
        group = bpy.data.node_groups.new("Flat", "ShaderNodeTree")
        group.interface.new_socket("Displacement", in_out="OUTPUT", socket_type="NodeSocketVector")
        group.nodes.new("NodeGroupOutput")
        placed = tree.nodes.new("ShaderNodeGroup")
        placed.node_tree = group
        tree.links.new(placed.outputs[0], node.outputs[0].links[0].to_node.inputs["Displacement"])
        bpy.data.materials["Rock"].displacement_method = "BOTH"
        _, result = exported()
        self.assertEqual(result.left_out, [])

    def test_images_that_are_not_there_are_pink(self):
        """As in Cycles: (1, 0, 1), and an alpha of 1."""
        for image in (None, "gone.png"):
            node = room()
            tree = node.id_data
            found = tree.nodes.new("ShaderNodeTexImage")
            why = "no image"
            if image is not None:
                found.image = bpy.data.images.new(image, 4, 4)
                found.image.source, found.image.filepath = "FILE", "/nowhere/gone.png"
                why = "image 'gone.png' cannot be read"
            tree.links.new(found.outputs["Alpha"], node.inputs["Alpha"])
            half = tree.nodes.new("ShaderNodeHueSaturation")
            half.inputs["Value"].default_value = 0.5
            tree.links.new(found.outputs["Color"], half.inputs["Color"])
            tree.links.new(half.outputs["Color"], node.inputs["Base Color"])
            world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
            world.use_nodes = True
            around = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
            around.image = found.image
            world.node_tree.links.new(around.outputs[0], world.node_tree.nodes["Background"].inputs["Color"])
            scene, result = exported()
            lines = [f"node 'Image Texture' of material 'Rock': {why}", f"node 'Environment Texture' of world 'Sky': {why}"]
            self.assertEqual(result.left_out, [f"left out: {line}" for line in sorted(lines)])
            self.assertEqual(scene["materials"]["Rock"]["base_color"], [0.5, 0.0, 0.5])
            self.assertNotIn("opacity", scene["materials"]["Rock"])
            (light,) = [light for light in scene["lights"] if light["type"] == "environment"]
            self.assertEqual(light["radiance"], [1.0, 0.0, 1.0])

    def volume(self, *kinds):
        """Links the sum of shaders to the Volume of the ball's material; returns the tree and its output node."""
        tree = room().id_data
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        total = None
        for kind in kinds:
            made = tree.nodes.new(kind).outputs[0]
            if total is not None:
                both = tree.nodes.new("ShaderNodeAddShader")
                tree.links.new(total, both.inputs[0])
                tree.links.new(made, both.inputs[1])
                made = both.outputs[0]
            total = made
        tree.links.new(total, output.inputs["Volume"])
        return tree, output

    def test_shaders_of_surfaces_are_no_volumes(self):
        tree, output = self.volume("ShaderNodeBsdfGlass")
        _, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertIn("'Glass BSDF' has no effect in a volume", "".join(result.notes))
        # Nor do they make the surface transparent, as volumes do where there is no other shader.
        tree.links.remove(output.inputs["Surface"].links[0])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertEqual(scene["materials"]["Rock"]["reflectance"], 0.0)
        tree, output = self.volume("ShaderNodeBsdfGlass", "ShaderNodeVolumeAbsorption")
        tree.links.remove(output.inputs["Surface"].links[0])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertEqual(scene["materials"]["Rock"]["type"], "null")
        self.assertEqual(len(scene["media"]), 1)

    def test_volumes_behind_what_is_opaque_are_not_seen(self):
        tree, output = self.volume("ShaderNodeVolumeAbsorption")
        scene, result = exported()
        self.assertEqual((result.left_out, "media" in scene), ([], False))
        self.assertIn("is not visible: its surface is opaque", "".join(result.notes))
        tree.links.new(tree.nodes.new("ShaderNodeBsdfTranslucent").outputs[0], output.inputs["Surface"])
        _, result = exported()
        self.assertEqual(len(result.left_out), 1)
        self.assertIn("the volume of material 'Rock'", result.left_out[0])

    def test_domains_without_gas_lack_nothing(self):
        for density, flame, has_gas in (([], [], False), ([0.0], [0.0], False), ([0.0, 0.5], [], True), ([], [1.0], True)):
            domain = SimpleNamespace(density_grid=density, flame_grid=flame)
            self.assertEqual(exporter.has_gas(domain), has_gas)

    def test_a_colour_in_the_place_of_a_shader_shines(self):
        node = room()
        tree = node.id_data
        colour = tree.nodes.new("ShaderNodeRGB")
        colour.outputs[0].default_value = (0.25, 0.5, 1.0, 1.0)
        tree.links.new(colour.outputs[0], node.outputs[0].links[0].to_socket)
        scene, result = exported()
        self.assertEqual(scene["shapes"][0]["emission"]["radiance"], [0.25, 0.5, 1.0])
        self.assertEqual(result.left_out, [])

    def test_black_bodies_have_blenders_colours(self):
        light = bpy.data.lights.new("Lamp", "POINT")
        if not hasattr(light, "use_temperature"):
            self.skipTest("lamps have a temperature since Blender 4.5")
        for kelvin in (2500.0, 4000.0, 6500.0, 12000.0, 20000.0):
            light.use_temperature, light.temperature = True, kelvin
            ours = formulas.blackbody(np.array([kelvin]))
            np.testing.assert_allclose(ours, light.temperature_color, rtol=0.01, atol=0.005)

    def test_an_exposure_of_the_film_is_told(self):
        room()
        bpy.context.scene.cycles.film_exposure = 2.0
        self.assertIn("the exposure of Cycles' film, 2", exported()[1].left_out[0])

    def test_a_view_in_place_of_a_camera(self):
        room()
        place = Matrix.Translation((1.0, 2.0, 3.0))
        with tempfile.TemporaryDirectory() as folder:
            exporter = Exporter(folder)
            depsgraph = bpy.context.evaluated_depsgraph_get()
            settings = ExportSettings(64, 48, view=View(place, fov=math.radians(50.0)), render={"passes": 3})
            scene = tomllib.loads(exporter.write(depsgraph, settings).scene.read_text())
        self.assertEqual(scene["camera"]["target"], [1.0, 2.0, 2.0])
        self.assertAlmostEqual(scene["camera"]["fov"], 50.0)
        self.assertEqual(scene["render"], {"passes": 3})


class Places(unittest.TestCase):
    """Objects of the scene, and what becomes of them."""

    def test_instances_are_of_their_objects(self):
        scenes.empty()
        scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
        inside = bpy.data.collections.new("Inside")
        for number in range(6):
            data = bpy.data.meshes.new(f"mesh {number}")
            data.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, number)], [], [(0, 1, 2)])
            made = bpy.data.objects.new(f"object {number}", data)
            made.visible_camera, made.visible_glossy = number % 2 == 0, number % 3 == 0
            inside.objects.link(made)
        for number in range(2):
            placed = scenes.link(f"place {number}", None)
            placed.instance_type, placed.instance_collection = "COLLECTION", inside
            placed.location.x = 2.0 * number
            placed.visible_shadow = number == 0
        scene, _ = exported()
        found = {}
        for shape in scene["shapes"]:
            found.setdefault(shape["name"].removesuffix("-2"), []).append(shape.get("visible"))
        self.assertEqual(set(found), {f"object {number}" for number in range(6)})
        every = ["camera", "reflected", "refracted", "shadow", "photon"]
        for number in range(6):
            hidden = {"camera"} if number % 2 else set()
            hidden |= {"reflected"} if number % 3 else set()
            seen = [[ray for ray in every if ray not in gone] for gone in (hidden, hidden | {"shadow"})]
            self.assertEqual(found[f"object {number}"], [None if rays == every else rays for rays in seen])

    def test_what_becomes_a_mesh_is_there_once(self):
        scenes.empty()
        scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
        bpy.ops.object.text_add()
        bpy.ops.curve.primitive_bezier_circle_add()
        bpy.context.object.data.bevel_depth = 0.1
        bpy.ops.surface.primitive_nurbs_surface_sphere_add()
        bpy.ops.object.metaball_add()
        scene, _ = exported()
        self.assertEqual([shape["name"] for shape in scene["shapes"]], ["Text", "BézierCircle", "SurfSphere", "Mball"])

    def test_attributes_become_colours(self):
        made = scenes.plane()
        mesh = made.data
        arrays = MeshArrays(mesh)
        loops, triangles = arrays.corners.ravel(), np.arange(2)
        mesh.color_attributes.new("paint", "FLOAT_COLOR", "POINT").data.foreach_set(
            "color", np.repeat(np.arange(4) / 4.0, 4).astype(np.float32))
        mesh.attributes.new("heat", "FLOAT", "FACE").data.foreach_set("value", [0.5])
        mesh.attributes.new("place", "FLOAT_VECTOR", "CORNER").data.foreach_set("vector", np.arange(12) / 16.0)
        arrays = MeshArrays(mesh)
        vertices = arrays.vertex_of[loops]
        for name in ("paint", ""):
            np.testing.assert_allclose(arrays.colors(name, loops, triangles), np.repeat(vertices[:, None] / 4.0, 3, 1))
        self.assertTrue((arrays.colors("heat", loops, triangles) == 0.5).all())
        np.testing.assert_allclose(arrays.colors("place", loops, triangles), np.arange(12).reshape(4, 3)[loops] / 16.0)
        self.assertTrue((arrays.colors("nothing", loops, triangles) == 0.0).all())
        self.assertIn(b"property float red", ply(arrays, None, None, "paint"))

    def test_materials_take_attributes(self):
        node = room()
        tree = node.id_data
        for kind, name, socket in (("Attribute", "heat", "Base Color"), ("VertexColor", "", "Emission Color")):
            made = tree.nodes.new(f"ShaderNode{kind}")
            setattr(made, "attribute_name" if kind == "Attribute" else "layer_name", name)
            tree.links.new(made.outputs["Color"], node.inputs[socket])
        node.inputs["Emission Strength"].default_value = 3.0
        scene, result = exported()
        self.assertEqual(scene["materials"]["Rock"]["base_color"], {"attribute": "color"})
        emission = scene["shapes"][0]["emission"]
        self.assertEqual((emission["radiance"], emission["scale"]), ({"attribute": "color"}, 3.0))
        self.assertEqual(result.left_out, ["left out: attributes of material 'Rock': all are 'heat'"])

    def test_a_uv_map_without_numbers_is_none(self):
        made = scenes.plane()
        arrays = MeshArrays(made.data)
        self.assertEqual(len(arrays.uv("")), 4)
        arrays.mesh = SimpleNamespace(uv_layers=[SimpleNamespace(name="UVMap", active_render=True, uv=[])])
        self.assertIsNone(arrays.uv(""))

    def test_points_are_balls(self):
        scenes.empty()
        scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
        made = scenes.mesh("Points", [(0, 0, 0), (1, 2, 3)], [])
        made.scale = (2.0, 2.0, 2.0)
        tree = bpy.data.node_groups.new("Points", "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        points = tree.nodes.new("GeometryNodeMeshToPoints")
        points.inputs["Radius"].default_value = 0.25
        tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], points.inputs[0])
        tree.links.new(points.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
        made.modifiers.new("Points", "NODES").node_group = tree
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        (shape,) = scene["shapes"]
        self.assertEqual(shape["shape"]["type"], "sphere")
        self.assertEqual(shape["transforms"][1][0]["matrix"],
                         [[0.5, 0.0, 0.0, 2.0], [0.0, 0.5, 0.0, 4.0], [0.0, 0.0, 0.5, 6.0], [0.0, 0.0, 0.0, 1.0]])


class Updates(unittest.TestCase):
    """An exporter that is kept: what did not change is not examined again."""

    def test_only_what_changed_is_written(self):
        room()
        other = scenes.cube("Cube", 0.5, (1.0, 0.0, 0.5))
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            exporter = Exporter(folder)
            settings = ExportSettings(64, 48)
            first = exporter.write(bpy.context.evaluated_depsgraph_get(), settings).scene.read_text()
            files = {path: path.stat().st_mtime_ns for path in folder.glob("meshes/*")}
            kept = dict(exporter._geometries)
            seen = []

            def on_update(_scene, depsgraph):
                seen.append(exporter.update(depsgraph).scene.read_text())

            bpy.app.handlers.depsgraph_update_post.append(on_update)
            try:
                other.location.x = 2.0
                bpy.context.view_layer.update()
                self.assertNotEqual(seen[-1], first)
                self.assertEqual({path: path.stat().st_mtime_ns for path in folder.glob("meshes/*")}, files)
                self.assertTrue(all(exporter._geometries[key] is kept[key] for key in kept))
                other.data.vertices[0].co.x = -1.0
                other.data.update()
                bpy.context.view_layer.update()
                same = [key for key in kept if exporter._geometries.get(key) is kept[key]]
                self.assertEqual(len(same), 1)
                bpy.data.materials["Rock"].node_tree.nodes["Principled BSDF"].inputs["Metallic"].default_value = 0.7
                bpy.context.view_layer.update()
                self.assertAlmostEqual(tomllib.loads(seen[-1])["materials"]["Rock"]["metallic"], 0.7, places=6)
            finally:
                bpy.app.handlers.depsgraph_update_post.remove(on_update)
            whole = Exporter(folder / "whole").write(bpy.context.evaluated_depsgraph_get(), settings)
            self.assertEqual(whole.scene.read_text(), seen[-1])


if __name__ == "__main__":
    unittest.main()
