"""Glass that encloses something and glass that does not, displacement as bumps, and Freestyle."""

import tomllib
import unittest

import bpy
import compare
import scenes

def room():
    scenes.empty()
    compare.use_cycles()
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))


def exported():
    result = compare.export_scene()
    return tomllib.loads(result.text), result


def glass(kind="Glass", name="Window", **inputs):
    return scenes.material(name, f"ShaderNodeBsdf{kind}", **inputs)


def cup(name="Cup", material=None):
    """A cube without its top."""
    corners = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
    faces = [(0, 2, 3, 1), (0, 1, 5, 4), (1, 3, 7, 5), (3, 2, 6, 7), (2, 0, 4, 6)]
    made = scenes.mesh(name, corners, faces)
    made.data.materials.append(material)
    return made


class Panes(unittest.TestCase):
    def setUp(self):
        room()

    def used(self, name="Plane"):
        """(table of the material of a shape, all tables of materials, result)"""
        scene, result = exported()
        (shape,) = [shape for shape in scene["shapes"] if shape["name"] == name]
        return scene["materials"][shape["material"]], scene["materials"], result

    def note(self, result):
        lines = [line for line in result.notes if "thin pane" in line]
        self.assertEqual(len(lines), 1, result.notes)
        return lines[0]

    def test_a_plane_of_glass_is_a_pane(self):
        scenes.plane(material=glass(Color=(0.5, 0.8, 1.0), Roughness=0.0, IOR=1.5))
        table, materials, result = self.used()
        self.assertEqual((table["type"], table["ior"]), ("thin_dielectric", 1.5))
        for found, wanted in zip(table["specular_transmittance"], (0.5, 0.8, 1.0)):
            self.assertAlmostEqual(found, wanted, 6)
        self.assertEqual(len(materials), 1)
        self.assertEqual(self.note(result), "the glass of material 'Window' is a thin pane on 'Plane': meshes that are "
                                            "not closed hold no glass; a Solidify modifier closes them")
        self.assertEqual(result.left_out, [])

    def test_refraction_and_an_index_that_is_the_other_way_round(self):
        scenes.plane(material=glass("Refraction", Roughness=0.0, IOR=0.8))
        table, _, _ = self.used()
        self.assertEqual((table["type"], table["specular_reflectance"]), ("thin_dielectric", 0.0))
        self.assertAlmostEqual(table["ior"], 1.25, 6)

    def test_rough_glass_is_a_pane_and_that_it_is_smooth_is_told(self):
        scenes.plane(material=glass(Roughness=0.4))
        table, _, result = self.used()
        self.assertEqual(table["type"], "thin_dielectric")
        self.assertNotIn("alpha", table)
        self.assertIn("as if it were smooth", self.note(result))

    def test_closed_meshes_stay_solid(self):
        scenes.cube("Plane", material=glass(Roughness=0.0))
        table, materials, result = self.used()
        self.assertEqual((table["type"], len(materials)), ("dielectric", 1))
        self.assertNotIn("thin pane", str(result.notes))

    def test_modifiers_open_and_close(self):
        plane = scenes.plane(material=glass(Roughness=0.0))
        self.assertEqual(self.used()[0]["type"], "thin_dielectric")
        plane.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.1
        self.assertEqual(self.used()[0]["type"], "dielectric")
        ball = scenes.ball("Ball", material=plane.data.materials[0], segments=8)
        cut = ball.modifiers.new("Mask", "MASK")
        ball.vertex_groups.new(name="half").add([v.index for v in ball.data.vertices if v.co.z > 0.0], 1.0, "ADD")
        cut.vertex_group = "half"
        self.assertEqual(self.used("Ball")[0]["type"], "thin_dielectric")

    def test_one_material_on_both(self):
        made = glass(Roughness=0.0)
        scenes.plane(material=made)
        scenes.cube("Block", material=made)
        cup(material=made)
        kinds = {name: self.used(name)[0]["type"] for name in ("Plane", "Block", "Cup")}
        self.assertEqual(kinds, {"Plane": "thin_dielectric", "Block": "dielectric", "Cup": "thin_dielectric"})
        self.assertIn("on 'Plane', 'Cup':", self.note(exported()[1]))

    def test_many_are_counted(self):
        made = glass(Roughness=0.0)
        for number in range(5):
            scenes.plane(f"Pane{number}", material=made)
        self.assertIn("on 'Pane0', 'Pane1', 'Pane2' and 2 more:", self.note(exported()[1]))

    def test_edges_that_are_split_are_no_border(self):
        cube = scenes.cube("Plane", material=glass(Roughness=0.0))
        cube.modifiers.new("Split", "EDGE_SPLIT").split_angle = 0.1
        self.assertEqual(self.used()[0]["type"], "dielectric")

    def test_each_part_of_a_mesh_by_itself(self):
        """A block of glass and an open floor of another material, joined; and a pane in an open wall."""
        floor = scenes.plane("Both", 8.0, material=scenes.diffuse("Floor"))
        cube = scenes.cube("Cube", material=glass(Roughness=0.0))
        bpy.ops.object.select_all(action="DESELECT")
        for object in (cube, floor):
            object.select_set(True)
        bpy.context.view_layer.objects.active = floor
        bpy.ops.object.join()
        corners = [(x, y, 3) for y in range(4) for x in range(4)]
        faces = [(4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4) for y in range(3) for x in range(3)]
        wall = scenes.mesh("Wall", corners, faces)
        for name in ("Floor", "Window"):
            wall.data.materials.append(bpy.data.materials[name])
        wall.data.polygons[4].material_index = 1
        scene, result = exported()
        kinds = {name: set() for name in ("Both", "Wall")}
        for shape in scene["shapes"]:
            kinds[shape["name"]].add(scene["materials"][shape["material"]]["type"])
        self.assertEqual(kinds, {"Both": {"diffuse", "dielectric"}, "Wall": {"diffuse", "thin_dielectric"}})
        self.assertIn("on 'Wall':", self.note(result))

    def test_glass_by_transmission(self):
        scenes.plane(material=glass("Principled", Transmission_Weight=1.0, Base_Color=(0.25, 1.0, 1.0), Roughness=0.0))
        table, _, _ = self.used()
        self.assertEqual(table["type"], "thin_dielectric")
        self.assertAlmostEqual(table["specular_transmittance"][0], 0.5, 5)

    def test_glass_by_transmission_in_part(self):
        inputs = {"Transmission_Weight": 0.75, "Metallic": 0.2, "Base_Color": (0.25, 1.0, 1.0), "IOR": 1.4}
        scenes.plane(material=glass("Principled", **inputs))
        table, materials, _ = self.used()
        self.assertEqual(table["type"], "blend")
        self.assertAlmostEqual(table["weight"], 0.6, 5)
        rest, pane = (materials[name] for name in table["materials"])
        self.assertEqual((rest["type"], rest["two_sided"], pane["type"]), ("principled", True, "thin_dielectric"))
        self.assertNotIn("spec_trans", rest)
        # 0.2 metal, 0.2 of the rest, 0.6 glass.
        self.assertAlmostEqual(rest["metallic"], 0.5, 5)
        self.assertAlmostEqual(pane["ior"], 1.4, 5)
        self.assertAlmostEqual(pane["specular_transmittance"][0], 0.5, 5)

    def test_glass_in_a_mix(self):
        made = glass(Roughness=0.0)
        tree = made.node_tree
        diffuse, mix = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeMixShader")
        shader = next(node for node in tree.nodes if node.type == "BSDF_GLASS")
        tree.links.new(shader.outputs[0], mix.inputs[1])
        tree.links.new(diffuse.outputs[0], mix.inputs[2])
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        tree.links.new(mix.outputs[0], output.inputs["Surface"])
        scenes.plane(material=made)
        scenes.cube("Block", material=made)
        for name, kind in (("Plane", "thin_dielectric"), ("Block", "dielectric")):
            table, materials, _ = self.used(name)
            self.assertEqual([materials[part]["type"] for part in table["materials"]], [kind, "diffuse"], name)

    def test_glass_with_a_volume_stays_solid(self):
        made = glass(Roughness=0.0)
        tree = made.node_tree
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        scatter = tree.nodes.new("ShaderNodeVolumeScatter")
        tree.links.new(scatter.outputs[0], output.inputs["Volume"])
        scenes.plane(material=made)
        self.assertEqual(self.used()[0]["type"], "dielectric")

    def test_what_is_no_glass_has_no_panes(self):
        for kind in ("Diffuse", "Principled", "Glossy", "Transparent"):
            room()
            scenes.plane(material=glass(kind))
            self.assertFalse(any("thin pane" in line for line in exported()[1].notes), kind)

    @unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
    def test_behind_a_pane_it_is_as_bright_from_either_side(self):
        """Under an even sky of 1 a pane shows 1: reflection adds what transmission lacks."""
        for turned in (0.0, 180.0):
            room()
            scenes.background().inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
            material = glass(Roughness=0.0, Color=(1.0, 1.0, 1.0))
            scenes.plane("Plane", 20.0, rotation=scenes.degrees(turned, 0, 0), material=material)
            with compare.tempfile.TemporaryDirectory() as folder:
                picture, _ = compare.with_beamfarm(compare.pathlib.Path(folder), 4, runs=2)
            self.assertAlmostEqual(float(picture.mean.mean()), 1.0, delta=0.02)


class Displacement(unittest.TestCase):
    def setUp(self):
        room()
        self.material = scenes.material("Rock")
        scenes.plane(material=self.material)
        self.tree = self.material.node_tree
        self.displacement = self.add("Displacement", Scale=0.3)
        output = next(node for node in self.tree.nodes if node.type == "OUTPUT_MATERIAL")
        self.tree.links.new(self.displacement.outputs[0], output.inputs["Displacement"])
        image = self.add("TexImage")
        image.image = bpy.data.images.new("height", 4, 4)
        self.tree.links.new(image.outputs["Color"], self.displacement.inputs["Height"])

    def add(self, kind, **inputs):
        node = self.tree.nodes.new(f"ShaderNode{kind}")
        scenes.set_inputs(node, inputs)
        return node

    def read(self):
        scene, result = exported()
        return scene["materials"]["Rock"], result

    def test_bumps_alone(self):
        self.material.displacement_method = "BUMP"
        table, result = self.read()
        self.assertAlmostEqual(table["bump"]["scale"], 0.3, 6)
        self.assertIn("image", table["bump"])
        self.assertEqual(result.left_out, [])

    def test_heights_grow_with_the_object(self):
        """Along the normals: those of a floor scale with its z, those of the world do not."""
        floor = bpy.data.objects["Plane"]
        for scale, space, wanted in (
            ((7.0, 7.0, 1.0), "OBJECT", 0.3), ((1.0, 1.0, 4.0), "OBJECT", 1.2), ((4.0, 4.0, 4.0), "WORLD", 0.3),
        ):
            floor.scale, self.displacement.space = scale, space
            scene, _ = exported()
            (table,) = scene["materials"].values()
            self.assertAlmostEqual(table["bump"]["scale"], wanted, 5)

    def test_two_objects_of_one_material_have_their_own_heights(self):
        scenes.plane("Large", material=self.material).scale = (2.0, 2.0, 2.0)
        scene, _ = exported()
        heights = {shape["name"]: scene["materials"][shape["material"]]["bump"]["scale"] for shape in scene["shapes"]}
        self.assertAlmostEqual(heights["Plane"], 0.3, 5)
        self.assertAlmostEqual(heights["Large"], 0.6, 5)

    def test_an_object_that_grows_keeps_its_material(self):
        floor = bpy.data.objects["Plane"]
        for frame in (1, 2):
            floor.scale = (frame,) * 3
            floor.keyframe_insert("scale", frame=frame)
        bpy.context.scene.frame_set(1)
        bpy.context.scene.render.use_motion_blur = True
        scene, result = exported()
        self.assertEqual(len(scene["materials"]), 1)
        self.assertEqual(result.notes, [line for line in result.notes if "cannot be interpolated" not in line])

    def test_true_displacement_moves_the_mesh(self):
        for method in ("DISPLACEMENT", "BOTH"):
            self.material.displacement_method = method
            scene, result = exported()
            self.assertNotIn("bump", scene["materials"]["Rock"])
            moved = scene["shapes"][0]["displacement"]
            self.assertAlmostEqual(moved["scale"], 0.3, 6)
            self.assertIn("image", moved["height"])
            self.assertEqual(result.left_out, [])

    def test_a_bump_of_its_own_adds_to_it(self):
        bump, image = self.add("Bump", Strength=1.0, Distance=0.1), self.add("TexImage")
        image.image = bpy.data.images.new("other", 4, 4)
        self.tree.links.new(image.outputs["Color"], bump.inputs["Height"])
        shader = next(node for node in self.tree.nodes if node.type == "BSDF_PRINCIPLED")
        self.tree.links.new(bump.outputs[0], shader.inputs["Normal"])
        table, result = self.read()
        self.assertAlmostEqual(table["bump"]["scale"], 0.3, 6)
        self.assertEqual(result.left_out, [])

    def test_a_normal_map_of_its_own_counts_alone(self):
        turned, image = self.add("NormalMap"), self.add("TexImage")
        image.image = bpy.data.images.new("other", 4, 4)
        self.tree.links.new(image.outputs["Color"], turned.inputs["Color"])
        shader = next(node for node in self.tree.nodes if node.type == "BSDF_PRINCIPLED")
        self.tree.links.new(turned.outputs[0], shader.inputs["Normal"])
        table, result = self.read()
        self.assertNotIn("bump", table)
        self.assertEqual(result.left_out, ["left out: displacement of material 'Rock': it has a normal map as well"])

    def test_heights_that_are_no_image_are_graphs(self):
        noise = self.add("TexNoise")
        self.tree.links.new(noise.outputs[0], self.displacement.inputs["Height"])
        table, result = self.read()
        self.assertEqual(table["bump"]["texture"], "Rock/Noise Texture")
        self.assertEqual(result.left_out, [])

    def test_heights_that_are_left_out_are_told(self):
        occlusion = self.add("AmbientOcclusion")
        self.tree.links.new(occlusion.outputs[0], self.displacement.inputs["Height"])
        table, result = self.read()
        self.assertNotIn("bump", table)
        self.assertEqual(result.left_out, ["left out: node 'Ambient Occlusion' of material 'Rock'"])

    def test_an_even_height_is_nothing(self):
        self.tree.links.remove(self.displacement.inputs["Height"].links[0])
        table, result = self.read()
        self.assertNotIn("bump", table)
        self.assertEqual(result.left_out, [])

    def test_vectors_are_told(self):
        vector = self.add("VectorDisplacement")
        output = next(node for node in self.tree.nodes if node.type == "OUTPUT_MATERIAL")
        self.tree.links.new(vector.outputs[0], output.inputs["Displacement"])
        _, result = self.read()
        self.assertEqual(len(result.left_out), 1)
        self.assertIn("Vector Displacement' of material 'Rock'", result.left_out[0])

    @unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
    def test_the_command_takes_it(self):
        scenes.light("POINT", (0.0, 0.0, 2.0), 100.0)
        with compare.tempfile.TemporaryDirectory() as folder:
            picture, _ = compare.with_beamfarm(compare.pathlib.Path(folder), 1, runs=2)
        self.assertGreater(float(picture.mean.mean()), 0.0)


class Freestyle(unittest.TestCase):
    def test_it_is_told_once_where_it_is_on(self):
        room()
        scenes.plane()
        for is_on in (False, True):
            bpy.context.scene.render.use_freestyle = is_on
            self.assertEqual(exported()[1].left_out, ["left out: the lines of Freestyle"] * is_on)
        bpy.context.view_layer.use_freestyle = False
        self.assertEqual(exported()[1].left_out, [])


if __name__ == "__main__":
    unittest.main()
