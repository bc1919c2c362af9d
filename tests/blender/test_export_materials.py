"""Materials and textures, against Cycles."""

import unittest

import bpy
import compare
import numpy as np
import scenes


def room(light=True, world=0.3):
    """A floor under an area light, and a faint sky."""
    scenes.empty()
    compare.use_cycles()
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
    plane = scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))
    if light:
        scenes.light("AREA", (1.0, -1.0, 4.0), 200.0, size=1.0)
    scenes.background().inputs["Color"].default_value = (world, world, world, 1.0)
    return plane.data.materials[0]


def image(name="Picture", size=(256, 256), alpha=None, space="sRGB"):
    """Waves of colour that are periodic across the edges."""
    made = bpy.data.images.new(name, *size, alpha=True)
    # Before there are pixels: Blender generates the image anew for another colour space.
    made.colorspace_settings.name = space
    y, x = np.mgrid[0 : size[1], 0 : size[0]]
    u, v = 2.0 * np.pi * x / size[0], 2.0 * np.pi * y / size[1]
    waves = [np.sin(u), np.sin(v + 1.0), np.sin(u + v + 2.0)]
    values = np.stack([0.6 + 0.3 * wave for wave in waves] + [np.ones_like(u)], axis=-1)
    if alpha is not None:
        values[..., 3] = 0.5 + alpha * np.cos(u)
    made.pixels.foreach_set(values.astype(np.float32).ravel())
    made.update()
    return made


def shader(material):
    return next(node for node in material.node_tree.nodes if node.outputs and node.outputs[0].type == "SHADER")


def texture(material, picture, socket="Color", mapping=None, **settings):
    """Links an image to an input of a material's shader."""
    tree = material.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = picture
    for key, value in settings.items():
        setattr(node, key, value)
    if mapping:
        coordinates, mapped = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
        mapped.vector_type = mapping.pop("vector_type", "POINT")
        scenes.set_inputs(mapped, mapping)
        tree.links.new(coordinates.outputs["UV"], mapped.inputs["Vector"])
        tree.links.new(mapped.outputs["Vector"], node.inputs["Vector"])
    if socket:
        tree.links.new(node.outputs["Color"], shader(material).inputs[socket])
    return node


def ball(node, radius=0.5, **inputs):
    return scenes.ball("Ball", radius, (0.0, 0.0, radius + 0.05), scenes.material("Ball", node, **inputs))


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Materials(unittest.TestCase):
    def check(self, name, **how):
        return compare.check(self, name, **how)

    def test_no_material(self):
        room()
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55))
        self.check("no material")

    def test_smooth_and_flat(self):
        for smooth in (True, False):
            with self.subTest(smooth=smooth):
                room()
                red = scenes.diffuse("Red", (0.8, 0.3, 0.2))
                scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), red, smooth=smooth, segments=16)
                self.check("smooth normals" if smooth else "flat normals")

    def test_glossy(self):
        for rough, tolerance, blocks in ((0.0, 0.01, 1.0), (0.3, 0.01, 1.5), (0.6, 0.01, 1.5), (1.0, 0.01, 1.5)):
            with self.subTest(rough=rough):
                room(light=False)
                ball("ShaderNodeBsdfGlossy", Roughness=rough, Color=(0.9, 0.6, 0.3))
                self.check(f"glossy, roughness {rough}", tolerance=tolerance, blocks=blocks)

    def test_metal(self):
        for rough, tolerance, blocks in ((0.1, 0.01, 1.5), (0.3, 0.01, 1.5), (0.6, 0.01, 1.5), (1.0, 0.01, 1.5)):
            with self.subTest(rough=rough):
                room(light=False)
                ball("ShaderNodeBsdfPrincipled", Roughness=rough, Metallic=1.0, Base_Color=(0.9, 0.6, 0.3))
                self.check(f"principled, metal, roughness {rough}", tolerance=tolerance, blocks=blocks)

    def test_half_metal(self):
        for rough, distribution in ((1.0, "GGX"), (0.5, "GGX"), (1.0, "MULTI_GGX")):
            with self.subTest(rough=rough, distribution=distribution):
                room(light=False)
                made = ball("ShaderNodeBsdfPrincipled", Roughness=rough, Metallic=0.5, Base_Color=(0.9, 0.8, 0.7))
                tree = made.data.materials[0].node_tree
                next(each for each in tree.nodes if each.type == "BSDF_PRINCIPLED").distribution = distribution
                self.check(f"principled, half metal by {distribution}, roughness {rough}", tolerance=0.015, blocks=1.5)

    def test_plastic(self):
        for rough in (0.3, 0.5, 1.0):
            with self.subTest(rough=rough):
                room()
                ball("ShaderNodeBsdfPrincipled", Roughness=rough, Base_Color=(0.8, 0.4, 0.2))
                self.check(f"principled, plastic, roughness {rough}")

    def test_shiny_plastic(self):
        for rough in (0.0, 0.1, 0.2):
            with self.subTest(rough=rough):
                room()
                ball("ShaderNodeBsdfPrincipled", Roughness=rough, Base_Color=(0.8, 0.4, 0.2))
                self.check(f"principled, plastic, roughness {rough}")

    def test_coats(self):
        cases = (
            ("plastic", 0.03, {"Roughness": 0.5}),
            ("plastic", 0.4, {"Roughness": 0.5, "Coat_IOR": 1.8}),
            ("plastic, half", 0.2, {"Roughness": 0.8, "Coat_Weight": 0.5}),
            ("metal", 0.1, {"Roughness": 0.3, "Metallic": 1.0}),
        )
        for kind, rough, inputs in cases:
            with self.subTest(kind=kind, rough=rough):
                room()
                coat = {"Coat_Weight": 1.0, "Coat_Roughness": rough}
                ball("ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.4, 0.2), **(coat | inputs))
                self.check(f"coat, {kind}, roughness {rough}", tolerance=0.015, blocks=3.0)

    def test_normals_of_coats(self):
        for name, rough in (("Normal", 0.3), ("Coat Normal", 0.4)):
            with self.subTest(name=name):
                room()
                made = ball("ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.4, 0.2), Roughness=0.4, Coat_Weight=1.0,
                            Coat_Roughness=rough)
                tree = made.data.materials[0].node_tree
                nodes, links = tree.nodes, tree.links
                node = next(each for each in nodes if each.type == "BSDF_PRINCIPLED")
                bump, noise = nodes.new("ShaderNodeBump"), nodes.new("ShaderNodeTexNoise")
                noise.inputs["Scale"].default_value = 8.0
                noise.inputs["Detail"].default_value = 0.0
                bump.inputs["Distance"].default_value = 0.1
                links.new(noise.outputs[0], bump.inputs["Height"])
                links.new(bump.outputs[0], node.inputs[name])
                result = self.check(f"coat, bumps of {name}", tolerance=0.015, blocks=3.0)
                self.assertEqual(result.left_out, [])

    def test_specular_tint(self):
        for rough in (0.2, 0.7):
            with self.subTest(rough=rough):
                room()
                ball("ShaderNodeBsdfPrincipled", Base_Color=(0.05, 0.05, 0.05), Roughness=rough,
                     Specular_Tint=(1.0, 0.4, 0.1), Specular_IOR_Level=1.0)
                self.check(f"specular tint, roughness {rough}")

    def test_thin_films(self):
        for nanometres, ior in ((250.0, 1.33), (550.0, 1.8)):
            with self.subTest(nanometres=nanometres):
                room()
                ball("ShaderNodeBsdfPrincipled", Base_Color=(0.02, 0.02, 0.02), Roughness=0.2,
                     Thin_Film_Thickness=nanometres, Thin_Film_IOR=ior)
                self.check(f"thin film, {nanometres} nm", blocks=3.0)

    def test_thin_films_on_glass(self):
        for nanometres, ior, rough in ((300.0, 1.33, 0.05), (500.0, 1.9, 0.4)):
            with self.subTest(nanometres=nanometres):
                room()
                ball("ShaderNodeBsdfPrincipled", Base_Color=(1.0, 1.0, 1.0), Roughness=rough, Transmission_Weight=1.0,
                     Thin_Film_Thickness=nanometres, Thin_Film_IOR=ior)
                result = self.check(f"thin film on glass, {nanometres} nm", passes=32, blocks=3.0)
                self.assertEqual(result.left_out, [])

    def test_principled_without_specular(self):
        room()
        ball("ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.4, 0.2), Specular_IOR_Level=0.0)
        self.check("principled, no specular")

    def test_glass(self):
        for node, more in (("ShaderNodeBsdfGlass", {}), ("ShaderNodeBsdfPrincipled", {"Transmission_Weight": 1.0})):
            for rough in (0.0, 0.3, 0.6, 0.9):
                with self.subTest(node=node, rough=rough):
                    room()
                    color = "Color" if not more else "Base_Color"
                    ball(node, Roughness=rough, **{color: (0.9, 0.6, 0.3)}, **more)
                    name = "principled, glass" if more else "glass"
                    self.check(f"{name}, roughness {rough}", passes=32, blocks=2.0)

    def test_mixes_by_fresnel(self):
        # Plastic applies Fresnel's law where light enters, too: a few per cent on the ball.
        for base, blocks, inputs in (("Refraction", 2.0, {"IOR": 1.45, "Roughness": 0.0}), ("Diffuse", 3.0, {})):
            with self.subTest(base):
                room()
                made = scenes.material("Ball", "ShaderNodeMixShader")
                tree = made.node_tree
                mix, fresnel = shader(made), tree.nodes.new("ShaderNodeFresnel")
                fresnel.inputs["IOR"].default_value = 1.45
                below, above = (tree.nodes.new(f"ShaderNodeBsdf{kind}") for kind in (base, "Glossy"))
                scenes.set_inputs(below, {"Color": (0.8, 0.5, 0.3)} | inputs)
                scenes.set_inputs(above, {"Color": (0.9, 0.9, 0.9), "Roughness": 0.0 if inputs else 0.2})
                tree.links.new(fresnel.outputs[0], mix.inputs[0])
                tree.links.new(below.outputs[0], mix.inputs[1])
                tree.links.new(above.outputs[0], mix.inputs[2])
                scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
                result = self.check(f"{base.lower()} and glossy by Fresnel", passes=32, blocks=blocks)
                self.assertEqual(result.left_out, [])

    def test_refraction(self):
        # What Fresnel's law reflects is lost: 4 % of the light through the ball.
        room()
        ball("ShaderNodeBsdfRefraction", Roughness=0.0, Color=(0.9, 0.6, 0.3))
        result = self.check("refraction", blocks=2.0)
        self.assertEqual(len(result.notes), 1)

    def test_transparent(self):
        room()
        ball("ShaderNodeBsdfTransparent", Color=(0.9, 0.6, 0.3))
        self.check("transparent, coloured")

    def test_alpha(self):
        room()
        ball("ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.4, 0.2), Alpha=0.4, Specular_IOR_Level=0.0)
        self.check("alpha")

    def test_mix_with_transparent_and_emission(self):
        for second, more in (("ShaderNodeBsdfTransparent", {}), ("ShaderNodeEmission", {"Strength": 2.0})):
            with self.subTest(second=second):
                room()
                made = scenes.diffuse("Ball", (0.8, 0.3, 0.2))
                tree = made.node_tree
                other, mix = tree.nodes.new(second), tree.nodes.new("ShaderNodeMixShader")
                scenes.set_inputs(other, more)
                first = shader(made)
                output = first.outputs[0].links[0].to_socket
                mix.inputs[0].default_value = 0.3
                tree.links.new(first.outputs[0], mix.inputs[1])
                tree.links.new(other.outputs[0], mix.inputs[2])
                tree.links.new(mix.outputs[0], output)
                scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
                self.check(f"diffuse mixed with {other.bl_label.lower()}")

    def test_emission_and_principled_in_a_group(self):
        room()
        made = scenes.material("Ball", "ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.4, 0.2), Specular_IOR_Level=0.0)
        scenes.set_inputs(shader(made), {"Emission_Color": (0.2, 1.0, 0.5), "Emission_Strength": 1.5})
        group = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
        group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
        socket = group.interface.new_socket("Factor", in_out="INPUT", socket_type="NodeSocketFloat")
        socket.default_value = 0.1
        start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
        mix = group.nodes.new("ShaderNodeMix")
        mix.data_type = "RGBA"
        mix.inputs[6].default_value, mix.inputs[7].default_value = (0.9, 0.1, 0.1, 1.0), (0.1, 0.1, 0.9, 1.0)
        group.links.new(start.outputs["Factor"], mix.inputs[0])
        group.links.new(mix.outputs[2], end.inputs["Out"])
        node = made.node_tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        node.inputs["Factor"].default_value = 0.7
        made.node_tree.links.new(node.outputs["Out"], shader(made).inputs["Base Color"])
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)
        self.assertEqual(self.check("principled with emission, group").left_out, [])


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Textures(unittest.TestCase):
    def check(self, name, **how):
        result = compare.check(self, name, **how)
        self.assertEqual(result.left_out, [])
        return result

    def test_mapping(self):
        turned = {"Rotation": (0.0, 0.0, 0.5), "Scale": (2.0, 3.0, 1.0)}
        moved = turned | {"Location": (0.1, 0.2, 0.0)}
        cases = {
            "plain": {},
            "point": {"mapping": dict(moved)},
            "texture": {"mapping": dict(moved, vector_type="TEXTURE", Scale=(0.5, 0.3, 1.0))},
            "vector": {"mapping": dict(turned, vector_type="VECTOR")},
            "extend": {"mapping": {"Scale": (2.0, 3.0, 1.0)}, "extension": "EXTEND"},
            "mirror, closest": {
                "mapping": {"Scale": (2.0, 3.0, 1.0)},
                "extension": "MIRROR",
                "interpolation": "Closest",
            },
        }
        for name, how in cases.items():
            with self.subTest(name):
                texture(room(), image(), **how)
                self.check(f"texture, {name}")

    def test_colour_spaces_and_alpha(self):
        for name in ("sRGB", "Non-Color"):
            for alpha in (None, 0.4):
                with self.subTest(name, alpha=alpha):
                    made = room()
                    texture(made, image(alpha=alpha, space=name))
                    self.check(f"texture, {name}, alpha {alpha}")

    def test_formula(self):
        made = room()
        tree = made.node_tree
        node = texture(made, image(), socket=None)
        mix = tree.nodes.new("ShaderNodeMix")
        mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
        mix.inputs[0].default_value, mix.inputs[7].default_value = 0.7, (0.3, 0.8, 0.9, 1.0)
        hue, gamma = tree.nodes.new("ShaderNodeHueSaturation"), tree.nodes.new("ShaderNodeGamma")
        scenes.set_inputs(hue, {"Hue": 0.6, "Saturation": 0.7})
        scenes.set_inputs(gamma, {"Gamma": 0.7})
        tree.links.new(node.outputs["Color"], mix.inputs[6])
        tree.links.new(mix.outputs[2], hue.inputs["Color"])
        tree.links.new(hue.outputs["Color"], gamma.inputs["Color"])
        tree.links.new(gamma.outputs["Color"], shader(made).inputs["Color"])
        self.check("texture through mix, hue, gamma")

    def test_ramp(self):
        made = room()
        tree = made.node_tree
        node, ramp = texture(made, image(), socket=None), tree.nodes.new("ShaderNodeValToRGB")
        ramp.color_ramp.elements[0].color = (1.0, 0.1, 0.1, 1.0)
        ramp.color_ramp.elements.new(0.4).color = (0.1, 0.9, 0.2, 1.0)
        tree.links.new(node.outputs["Color"], ramp.inputs["Fac"])
        tree.links.new(ramp.outputs["Color"], shader(made).inputs["Color"])
        self.check("texture through a ramp")

    def test_checker(self):
        made = room()
        tree = made.node_tree
        node, coordinates = tree.nodes.new("ShaderNodeTexChecker"), tree.nodes.new("ShaderNodeTexCoord")
        scenes.set_inputs(node, {"Color1": (0.8, 0.1, 0.1), "Color2": (0.1, 0.8, 0.3), "Scale": 6.0})
        tree.links.new(coordinates.outputs["UV"], node.inputs["Vector"])
        tree.links.new(node.outputs["Color"], shader(made).inputs["Color"])
        self.check("checker")

    def test_bump(self):
        made = room()
        tree = made.node_tree
        picture = image(space="Non-Color")
        node, bump = texture(made, picture, socket=None), tree.nodes.new("ShaderNodeBump")
        scenes.set_inputs(bump, {"Strength": 1.0, "Distance": 1.0})
        tree.links.new(node.outputs["Color"], bump.inputs["Height"])
        tree.links.new(bump.outputs["Normal"], shader(made).inputs["Normal"])
        self.check("bump", tolerance=0.02, blocks=3.0)

    def test_displacement_as_bumps(self):
        made = room()
        tree = made.node_tree
        node = texture(made, image(space="Non-Color"), socket=None)
        displacement = tree.nodes.new("ShaderNodeDisplacement")
        scenes.set_inputs(displacement, {"Scale": 0.7, "Midlevel": 0.3})
        tree.links.new(node.outputs["Color"], displacement.inputs["Height"])
        output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
        tree.links.new(displacement.outputs[0], output.inputs["Displacement"])
        made.displacement_method = "BUMP"
        self.check("displacement as bumps", tolerance=0.02, blocks=3.0)
        floor = bpy.data.objects["Floor"]
        for corner in floor.data.vertices:
            corner.co.xy /= 2.0
        floor.scale = (2.0, 2.0, 3.0)
        for space in ("OBJECT", "WORLD"):
            displacement.space = space
            self.check(f"displacement as bumps of a scaled floor, {space.lower()}", tolerance=0.02, blocks=3.0)

    def test_normal_map(self):
        for strength in (1.0, 0.5):
            with self.subTest(strength=strength):
                made = room()
                tree = made.node_tree
                picture = image(space="Non-Color")
                y, x = np.mgrid[0:256, 0:256]
                a, b = 0.4 * np.sin(2.0 * np.pi * x / 256), 0.3 * np.cos(2.0 * np.pi * y / 256)
                values = np.stack([a, b, np.sqrt(1.0 - a * a - b * b), np.ones_like(a)], axis=-1)
                values[..., :3] = 0.5 + 0.5 * values[..., :3]
                picture.pixels.foreach_set(values.astype(np.float32).ravel())
                picture.update()
                node, turned = texture(made, picture, socket=None), tree.nodes.new("ShaderNodeNormalMap")
                turned.inputs["Strength"].default_value = strength
                tree.links.new(node.outputs["Color"], turned.inputs["Color"])
                tree.links.new(turned.outputs["Normal"], shader(made).inputs["Normal"])
                self.check(f"normal map, strength {strength}", tolerance=0.02, blocks=3.0)

    def test_opacity_by_texture(self):
        made = room()
        scenes.plane("Above", 3.0, (0.0, 0.0, 0.6), material=scenes.material("Above", Specular_IOR_Level=0.0))
        above = bpy.data.materials["Above"]
        node = texture(above, image(alpha=0.4), "Base Color")
        above.node_tree.links.new(node.outputs["Alpha"], shader(above).inputs["Alpha"])
        self.check("alpha by texture")
        self.assertTrue(made)


if __name__ == "__main__":
    unittest.main()
