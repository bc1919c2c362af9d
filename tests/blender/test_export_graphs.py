"""Node trees that become texture graphs in the scene file."""

import pathlib
import tempfile
import tomllib
import unittest

import bpy
import compare
import numpy as np
import scenes
from test_export_text import exported, room


def add(tree, kind, inputs=None, **settings):
    """A node; `inputs`: by name, numbers or sockets."""
    node = tree.nodes.new(f"ShaderNode{kind}")
    for name, value in settings.items():
        setattr(node, name, value)
    for name, value in (inputs or {}).items():
        link(tree, value, node.inputs[name])
    return node


def link(tree, value, socket):
    if isinstance(value, bpy.types.NodeSocket):
        tree.links.new(value, socket)
    else:
        socket.default_value = value


class Spaces(unittest.TestCase):
    """The spaces that shapes define for their objects are those of Cycles."""

    def picture(self, kind, output):
        """What Cycles shows for an output of a node on a rotated plane, 16 x 16 over [-2, 2]^2, top row first."""
        scenes.empty()
        made = scenes.material("Shown", "ShaderNodeEmission")
        tree = made.node_tree
        shader = next(node for node in tree.nodes if node.type == "EMISSION")
        tree.links.new(add(tree, kind).outputs[output], shader.inputs["Color"])
        plane = scenes.plane("Some plane", 7.0, (0.5, -0.25, 0.125), (0.0, 0.0, 0.4), made)
        plane.scale, plane.pass_index = (1.5, 2.0, 1.0), 3
        view = scenes.camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
        view.data.type, view.data.ortho_scale = "ORTHO", 4.0
        compare.use_cycles(16, 16, 16)
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        # Not before: the call sets another view transform.
        bpy.context.scene.view_settings.view_transform = "Raw"
        return compare.with_cycles(scenes_folder(self), 2).mean, scene["shapes"][0]["space"]

    def test_coordinates_and_what_objects_have(self):
        y, x = np.mgrid[0:16, 0:16]
        world = np.stack([(x + 0.5) / 4.0 - 2.0, 2.0 - (y + 0.5) / 4.0, np.full(x.shape, 0.125), np.ones(x.shape)], -1)
        picture, space = self.picture("TexCoord", "Object")
        own = (world @ np.array(space["matrix"]).T)[..., :3]
        np.testing.assert_allclose(picture, own, atol=0.03)
        picture, space = self.picture("TexCoord", "Generated")
        low, high = np.array(space["box"])
        np.testing.assert_allclose(picture, (own - low) / (high - low), atol=0.01)
        for output, name in (("Random", "random"), ("Object Index", "index"), ("Location", "location")):
            picture, space = self.picture("ObjectInfo", output)
            np.testing.assert_allclose(picture, np.broadcast_to(space[name], (16, 16, 3)), atol=1e-5)


def scenes_folder(test):
    folder = tempfile.TemporaryDirectory()
    test.addCleanup(folder.cleanup)
    return pathlib.Path(folder.name)


def noise(tree, **inputs):
    return add(tree, "TexNoise", inputs)


class Trees(unittest.TestCase):
    """What material node trees become."""

    def said(self, wanted=(), bakes=True):
        scene, result = exported(bakes)
        self.assertEqual(result.left_out, [f"left out: {line}" for line in wanted])
        return scene

    def test_an_example(self):
        node = room()
        tree = node.id_data
        mapped = add(tree, "Mapping", {"Vector": add(tree, "TexCoord").outputs["Object"], "Scale": (2.0, 2.0, 2.0),
                                       "Rotation": scenes.degrees(20.0, 0.0, -35.0)})
        rough = noise(tree, Vector=mapped.outputs[0], Detail=3.5)
        ramp = add(tree, "ValToRGB", {"Fac": rough.outputs["Fac"]})
        ramp.color_ramp.elements[0].color = (0.25, 0.5, 0.75, 1.0)
        link(tree, ramp.outputs["Color"], node.inputs["Base Color"])
        link(tree, rough.outputs["Color"], node.inputs["Roughness"])
        scene = self.said()
        self.assertEqual(scene["textures"], {
            "Rock/Noise Texture": {
                "node": "noise", "detail": 3.5, "vector": {
                    "node": "mapping", "vector": {"node": "coordinates", "of": "object"}, "scale": 2.0,
                    "rotation": [20.0, 0.0, -35.0]}},
            "Rock/Color Ramp": {
                "node": "ramp", "factor": {"texture": "Rock/Noise Texture"},
                "stops": [[0.0, 0.25, 0.5, 0.75], [1.0, 1.0, 1.0, 1.0]]},
        })
        table = scene["materials"]["Rock"]
        self.assertEqual(table["base_color"], {"texture": "Rock/Color Ramp"})
        self.assertEqual(table["roughness"], {"texture": "Rock/Noise Texture", "output": "color"})
        self.assertEqual(list(scene).index("textures") + 1, list(scene).index("materials"))

    def test_groups_reroutes_and_muted_nodes(self):
        node = room()
        tree = node.id_data
        group = bpy.data.node_groups.new("Dirt", "ShaderNodeTree")
        for name, way in (("Scale", "INPUT"), ("Spots", "OUTPUT")):
            group.interface.new_socket(name, in_out=way, socket_type="NodeSocketFloat")
        into, out = (group.nodes.new(f"NodeGroup{way}") for way in ("Input", "Output"))
        spots = noise(group, Scale=into.outputs[0])
        muted = add(group, "Math", {0: spots.outputs["Fac"]}, mute=True)
        route = group.nodes.new("NodeReroute")
        group.links.new(muted.outputs[0], route.inputs[0])
        group.links.new(route.outputs[0], out.inputs[0])
        for number, name in enumerate(("Metallic", "Roughness")):
            placed = tree.nodes.new("ShaderNodeGroup")
            placed.node_tree, placed.name = group, f"Dirt {number}"
            placed.inputs[0].default_value = 3.0 + number
            link(tree, placed.outputs[0], node.inputs[name])
        scene = self.said()
        self.assertEqual({name: table["scale"] for name, table in scene["textures"].items()},
                         {"Rock/Dirt 0/Noise Texture": 3.0, "Rock/Dirt 1/Noise Texture": 4.0})
        self.assertEqual(scene["materials"]["Rock"]["metallic"], {"texture": "Rock/Dirt 0/Noise Texture"})

    def test_what_has_no_word_is_left_out(self):
        node = room(Roughness=0.25)
        tree = node.id_data
        where = add(tree, "TexCoord")
        link(tree, noise(tree, Vector=where.outputs["Window"]).outputs["Fac"], node.inputs["Roughness"])
        pointed = add(tree, "NewGeometry").outputs["Pointiness"]
        product = add(tree, "Math", {0: pointed, 1: noise(tree).outputs["Fac"]}, operation="MULTIPLY")
        product.inputs[0].default_value = 0.75
        link(tree, product.outputs[0], node.inputs["Metallic"])
        link(tree, add(tree, "AmbientOcclusion").outputs["AO"], node.inputs["Alpha"])
        scene = self.said([
            "node 'Geometry' of material 'Rock': Pointiness",
            "node 'Noise Texture' of material 'Rock': window coordinates",
            "node 'Ambient Occlusion' of material 'Rock'",
        ], bakes=False)
        table = scene["materials"]["Rock"]
        self.assertEqual((table["roughness"], table.get("opacity", 1.0)), (0.25, 1.0))
        self.assertEqual(scene["textures"]["Rock/Math"], {
            "node": "math", "operation": "multiply", "a": 0.75, "b": {"texture": "Rock/Noise Texture.001"}})

    def test_coordinates(self):
        node = room()
        tree = node.id_data
        for kind, output, wanted in (
            ("TexCoord", "Generated", {"node": "coordinates", "of": "generated"}),
            ("TexCoord", "Normal", {"node": "coordinates", "of": "normal"}),
            ("TexCoord", "UV", {"node": "coordinates", "of": "uv"}),
            ("TexCoord", "Camera", {"node": "coordinates", "of": "camera"}),
            ("UVMap", "UV", {"node": "coordinates", "of": "uv"}),
            ("NewGeometry", "Position", {"node": "geometry"}),
            ("NewGeometry", "True Normal", {"node": "geometry", "output": "true_normal"}),
            ("NewGeometry", "Backfacing", {"node": "geometry", "output": "backfacing"}),
            ("ObjectInfo", "Random", {"node": "object_info", "output": "random"}),
            ("ObjectInfo", "Object Index", {"node": "object_info", "output": "index"}),
        ):
            with self.subTest(output=output):
                link(tree, add(tree, kind).outputs[output], node.inputs["Base Color"])
                scene = self.said()
                self.assertEqual(scene["materials"]["Rock"]["base_color"], wanted)
                wants_space = wanted["node"] == "object_info" or wanted.get("of") in ("generated", "normal")
                self.assertEqual("space" in scene["shapes"][0], wants_space)

    def test_images_by_other_coordinates(self):
        node = room()
        tree = node.id_data
        picture = bpy.data.images.new("Picture", 4, 4)
        image = add(tree, "TexImage", {"Vector": add(tree, "TexCoord").outputs["Generated"]}, image=picture)
        link(tree, image.outputs["Color"], node.inputs["Base Color"])
        scene = self.said()
        self.assertEqual(scene["materials"]["Rock"]["base_color"], {"texture": "Rock/Image Texture"})
        table = scene["textures"]["Rock/Image Texture"]
        self.assertEqual(table["vector"], {"node": "coordinates", "of": "generated"})
        self.assertIn("image", table)
        image.projection = "BOX"
        self.said(["node 'Image Texture' of material 'Rock': projection box"], bakes=False)

    def test_formulas_of_images_stay_pixels_among_graphs(self):
        node = room()
        tree = node.id_data
        picture = bpy.data.images.new("Picture", 4, 4)
        image = add(tree, "TexImage", image=picture)
        less = add(tree, "Math", {0: image.outputs["Color"], 1: 0.5}, operation="SUBTRACT")
        link(tree, add(tree, "Math", {0: less.outputs[0], 1: noise(tree).outputs["Fac"]}).outputs[0],
             node.inputs["Roughness"])
        scene = self.said()
        table = scene["textures"]["Rock/Math.001"]["a"]
        # The file has nothing below 0.
        self.assertEqual((table["node"], table["operation"], table["b"]), ("math", "add", -0.5))
        self.assertTrue(table["a"]["image"].endswith(".exr"))

    def test_bumps_and_displacement(self):
        node = room()
        tree = node.id_data
        bump = add(tree, "Bump", {"Height": noise(tree).outputs["Fac"], "Strength": 0.5, "Distance": 0.25}, invert=True)
        link(tree, bump.outputs[0], node.inputs["Normal"])
        wanted = {"texture": "Rock/Noise Texture", "scale": -0.25, "strength": 0.5}
        self.assertEqual(self.said()["materials"]["Rock"]["bump"], wanted)
        link(tree, add(tree, "TexCoord").outputs["Object"], bump.inputs["Height"])
        scene = self.said()
        self.assertEqual(scene["materials"]["Rock"]["bump"], {"texture": "Rock/bump", "scale": -0.25, "strength": 0.5})
        self.assertEqual(scene["textures"]["Rock/bump"], {"node": "coordinates", "of": "object"})
        link(tree, noise(tree).outputs["Fac"], bump.inputs["Strength"])
        scene = self.said()
        self.assertEqual(scene["materials"]["Rock"]["bump"], {"texture": "Rock/bump", "scale": -0.25})
        self.assertEqual(scene["textures"]["Rock/bump"]["operation"], "multiply")

    def test_what_shines(self):
        node = room(Emission_Strength=5.0)
        tree = node.id_data
        waves = add(tree, "TexWave")
        link(tree, waves.outputs["Color"], node.inputs["Emission Color"])
        emission = self.said()["shapes"][0]["emission"]
        self.assertEqual((emission["radiance"], emission["scale"]), ({"texture": "Rock/Wave Texture"}, 5.0))
        link(tree, waves.outputs["Fac"], node.inputs["Emission Strength"])
        scene = self.said()
        self.assertEqual(scene["shapes"][0]["emission"], {"radiance": {"texture": "Rock/emission"}})
        self.assertEqual(scene["textures"]["Rock/emission"], {
            "node": "vector_math", "operation": "multiply", "a": {"texture": "Rock/Wave Texture"},
            "b": {"texture": "Rock/Wave Texture", "output": "value"}})

    def mixed(self, factor, *parts):
        """A mix of two shaders whose factor is a function of a tree."""
        node = room()
        tree = node.id_data
        output = node.outputs[0].links[0].to_socket
        shaders = [add(tree, part) for part in parts]
        mix = add(tree, "MixShader", {0: factor(tree), 1: shaders[0].outputs[0], 2: shaders[1].outputs[0]})
        link(tree, mix.outputs[0], output)
        return self.said()

    def test_weights_and_opacities(self):
        scene = self.mixed(lambda tree: noise(tree).outputs["Fac"], "BsdfDiffuse", "BsdfGlossy")
        table = scene["materials"]["Rock"]
        self.assertEqual((table["type"], table["weight"]), ("blend", {"texture": "Rock/Noise Texture"}))
        scene = self.mixed(lambda tree: add(tree, "LayerWeight").outputs["Facing"], "BsdfTransparent", "BsdfDiffuse")
        table = scene["materials"]["Rock"]
        self.assertEqual(table["opacity"], {"texture": "Rock/Layer Weight", "output": "facing"})
        scene = self.mixed(lambda tree: noise(tree).outputs["Fac"], "BsdfDiffuse", "BsdfTransparent")
        self.assertEqual(scene["materials"]["Rock"]["opacity"], {
            "node": "math", "operation": "subtract", "a": 1.0, "b": {"texture": "Rock/Noise Texture"}})
        scene = self.mixed(lambda tree: add(tree, "LightPath").outputs["Is Camera Ray"], "BsdfDiffuse", "Emission")
        self.assertEqual(scene["textures"]["Rock/emission"], {"node": "light_path"})

    def test_copies_have_their_own_coordinates(self):
        node = room()
        tree = node.id_data
        places = scenes.mesh("Places", [(2.0 * number, 0.0, 0.0) for number in range(3)], [])
        places.instance_type = "VERTS"
        bpy.data.objects["Ball"].parent = places
        self.assertEqual([shape["type"] for shape in self.said()["shapes"]], ["mesh", "instances"])
        link(tree, noise(tree).outputs["Fac"], node.inputs["Roughness"])
        shapes = self.said()["shapes"]
        self.assertEqual([shape["type"] for shape in shapes], ["mesh"] * 4)
        self.assertEqual([shape["space"]["location"][0] for shape in shapes[1:]], [0.0, 2.0, 4.0])
        self.assertEqual(len({shape["space"]["random"] for shape in shapes[1:]}), 3)

    def test_generated_coordinates_of_deformed_meshes(self):
        node = room()
        tree = node.id_data
        link(tree, noise(tree).outputs["Fac"], node.inputs["Roughness"])
        ball = bpy.data.objects["Ball"]
        ball.modifiers.new("Bend", "SIMPLE_DEFORM")
        self.assertIn("generated coordinates of 'Ball'", " ".join(exported()[1].notes))
        ball.modifiers.clear()
        self.assertNotIn("generated coordinates", " ".join(exported()[1].notes))

    def test_textures_over_time(self):
        node = room()
        tree = node.id_data
        scene = bpy.context.scene
        scene.frame_start, scene.frame_end = 1, 3
        waves = noise(tree)
        waves.noise_dimensions = "4D"
        for frame in (1, 3):
            waves.inputs["W"].default_value = float(frame)
            waves.inputs["W"].keyframe_insert("default_value", frame=frame)
        link(tree, waves.outputs["Fac"], node.inputs["Roughness"])
        result = compare.export_scene(all_frames=True)
        table = tomllib.loads(result.text)["textures"]["Rock/Noise Texture"]
        self.assertEqual([key[0] for key in table["w"]["keys"]][::2], [1, 3])
        self.assertEqual(table["scale"] if "scale" in table else 5.0, 5.0)


class Worlds(unittest.TestCase):
    def world(self, color):
        room()
        tree = bpy.context.scene.world.node_tree
        background = tree.nodes["Background"]
        background.inputs["Strength"].default_value = 2.0
        link(tree, color(tree), background.inputs["Color"])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        return scene

    def test_light_of_directions(self):
        scene = self.world(lambda tree: add(tree, "TexGradient").outputs["Color"])
        (light,) = scene["lights"]
        self.assertEqual((light["type"], light["scale"]), ("environment", 2.0))
        self.assertEqual(light["texture"], {"texture": "World/Gradient Texture", "output": "color"})
        vector = scene["textures"]["World/Gradient Texture"]["vector"]
        self.assertEqual(vector, {"node": "coordinates", "of": "generated"})
        self.assertNotIn("space", str(scene["shapes"]))

    def test_normals_look_back(self):
        scene = self.world(lambda tree: add(tree, "TexCoord").outputs["Normal"])
        self.assertEqual(scene["textures"][scene["lights"][0]["texture"]["texture"]], {
            "node": "vector_math", "operation": "scale", "scale": -1.0, "a": {"node": "coordinates", "of": "generated"}
        })

    def test_images_among_graphs(self):
        def color(tree):
            picture = bpy.data.images.new("Around", 8, 4)
            image = add(tree, "TexEnvironment", image=picture)
            return add(tree, "MixRGB", {0: noise(tree).outputs["Fac"], 1: image.outputs[0]}).outputs[0]

        scene = self.world(color)
        mix = scene["textures"]["World/Mix _Legacy_"]
        self.assertEqual(mix["a"]["vector"]["node"], "combine")

        def bent(tree):
            image = add(tree, "TexEnvironment", {"Vector": noise(tree).outputs["Color"]},
                        image=bpy.data.images.new("Around", 8, 4))
            return image.outputs[0]

        scene = self.world(bent)
        image = scene["textures"]["World/Environment Texture"]
        self.assertIn("World/Noise Texture", str(image["vector"]))
        self.assertIn("image", image)


class Volumes(unittest.TestCase):
    def fog(self, kind="VolumePrincipled", density=None, **inputs):
        room()
        made = scenes.material("Fog", f"ShaderNode{kind}", **inputs)
        tree = made.node_tree
        shader = next(node for node in tree.nodes if node.type != "OUTPUT_MATERIAL")
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        tree.links.remove(output.inputs["Surface"].links[0])
        link(tree, shader.outputs[0], output.inputs["Volume"])
        link(tree, density(tree), shader.inputs["Density"])
        cube = scenes.cube("Cloud", 2.0, (3.0, 0.0, 1.0), made)
        cube.scale = (1.0, 2.0, 0.5)
        return exported()

    def test_densities_are_sampled(self):
        for kind in ("VolumePrincipled", "VolumeScatter", "VolumeAbsorption"):
            with self.subTest(kind=kind):
                scene, result = self.fog(kind, lambda tree: noise(tree).outputs["Fac"])
                self.assertEqual(result.left_out, [])
                self.assertIn("sampled on a grid of 128 cells along its longest side", " ".join(result.notes))
                medium = scene["media"]["Cloud"]
                self.assertEqual(medium["type"], "heterogeneous")
                self.assertEqual(medium["density"], {
                    "texture": "Fog/Cloud/Noise Texture", "voxel": 4.0 / 128.0,
                    "min": [2.0, -2.0, 0.5], "max": [4.0, 2.0, 1.5]})
                shape = next(shape for shape in scene["shapes"] if shape["name"] == "Cloud")
                self.assertEqual(shape["interior"], "Cloud")
                vector = scene["textures"]["Fog/Cloud/Noise Texture"]["vector"]
                self.assertEqual(vector["node"], "transform")
                self.assertEqual(vector["vector"], {"node": "coordinates", "of": "world"})
                corners = np.array([[2.0, -2.0, 0.5, 1.0], [4.0, 2.0, 1.5, 1.0]]) @ np.array(vector["matrix"]).T
                np.testing.assert_allclose(corners[:, :3], [[0, 0, 0], [1, 1, 1]], atol=1e-6)

    def test_colours_are_sampled(self):
        self.fog(density=lambda tree: noise(tree).outputs["Fac"])
        tree = bpy.data.materials["Fog"].node_tree
        shader = next(node for node in tree.nodes if node.type == "PRINCIPLED_VOLUME")
        link(tree, noise(tree).outputs["Color"], shader.inputs["Color"])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertIn("the volume of material 'Fog' is sampled on a grid", " ".join(result.notes))
        medium = scene["media"]["Cloud"]
        self.assertEqual((medium["sigma_t"], set(medium["albedo"])), (1.0, {"texture", "output"}))
        self.assertNotIn("sigma_s", medium)
        # Alone as well.
        tree.links.remove(shader.inputs["Density"].links[0])
        shader.inputs["Density"].default_value = 0.7
        scene, result = exported()
        medium = scene["media"]["Cloud"]
        self.assertAlmostEqual(medium["sigma_t"], 0.7, 5)
        self.assertEqual(set(medium["density"]), {"min", "max", "voxel"})
        # The scene file cannot express a separate colour of absorption.
        shader.inputs["Absorption Color"].default_value = (0.5, 0.1, 0.1, 1.0)
        scene, result = exported()
        self.assertIn("Noise Texture", " ".join(result.left_out))

    def test_coordinates_of_the_world(self):
        scene, _ = self.fog(density=lambda tree: noise(
            tree, Vector=add(tree, "NewGeometry").outputs["Position"]).outputs["Fac"])
        self.assertEqual(scene["textures"]["Fog/Cloud/Noise Texture"]["vector"], {"node": "coordinates", "of": "world"})

    def test_what_is_around_is_not_in_it(self):
        self.fog(density=lambda tree: noise(tree).outputs["Fac"])
        tree = bpy.context.scene.world.node_tree
        link(tree, add(tree, "VolumeScatter").outputs[0], tree.nodes["World Output"].inputs["Volume"])
        scenes.ball("Stone", 0.2, (3.0, 0.0, 1.0), scenes.material("Glass", "ShaderNodeBsdfGlass"))
        scene, result = exported()
        self.assertIn("the volume of 'Cloud': the volumes around it are not added in it", result.notes)
        self.assertEqual([shape.get("interior") for shape in scene["shapes"]], [None, "Cloud", None])
        noisy = add(tree, "VolumeScatter", {"Density": noise(tree).outputs["Fac"]})
        link(tree, noisy.outputs[0], tree.nodes["World Output"].inputs["Volume"])
        scene, result = exported()
        self.assertIn("the volume of world 'World', whose density is a texture", " ".join(result.left_out))
        self.assertNotIn("world", scene)

    def test_shaders_of_one_density_add_up(self):
        self.fog("VolumeScatter", lambda tree: noise(tree).outputs["Fac"], Color=(0.5, 0.5, 0.5, 1.0))
        tree = bpy.data.materials["Fog"].node_tree
        density = next(node for node in tree.nodes if node.type == "TEX_NOISE").outputs["Fac"]
        scatter = next(node for node in tree.nodes if node.type == "VOLUME_SCATTER")
        output = scatter.outputs[0].links[0].to_socket
        absorbs = add(tree, "VolumeAbsorption", {"Density": density, "Color": (0.75, 0.75, 0.75, 1.0)})
        both = add(tree, "AddShader", {0: scatter.outputs[0], 1: absorbs.outputs[0]})
        link(tree, both.outputs[0], output)
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        medium = scene["media"]["Cloud"]
        self.assertEqual((medium["sigma_a"], medium["sigma_s"]), (0.25, 0.5))
        link(tree, noise(tree).outputs["Fac"], absorbs.inputs["Density"])
        self.assertIn("volumes of different densities", " ".join(exported()[1].left_out))

    def test_grids_of_meshes_and_colours_are_left_out(self):
        def density(tree):
            grid = add(tree, "Attribute", attribute_name="smoke")
            return add(tree, "Math", {0: grid.outputs["Fac"], 1: noise(tree).outputs["Fac"]}).outputs[0]

        scene, result = self.fog(density=density)
        self.assertNotEqual(result.left_out, [])
        self.assertNotIn("textures", scene)


if __name__ == "__main__":
    unittest.main()
