"""Shaders that combine others, or that are written as a similar one: the scene file, and the pictures against
Cycles."""

import pathlib
import tempfile
import unittest

import bpy
import compare
import numpy as np
import scenes
from export import sheen
from test_export_graphs import add, link, noise
from test_export_materials import ball, room, shader
from test_export_text import exported


def of_two(first, second):
    """A ball with an Add Shader of two shaders."""
    made = scenes.material("Ball", "ShaderNodeAddShader")
    tree = made.node_tree
    for socket, (kind, values) in zip(shader(made).inputs, (first, second)):
        node = tree.nodes.new(f"ShaderNodeBsdf{kind}")
        scenes.set_inputs(node, values)
        tree.links.new(node.outputs[0], socket)
    return scenes.ball("Ball", 0.5, (0.0, 0.0, 0.55), made)


def bump_of_bump():
    """A floor with small bumps on large ones."""
    tree = room(world=0.0).node_tree
    where = add(tree, "TexCoord").outputs["Object"]
    large = add(tree, "Bump", {"Height": noise(tree, Vector=where, Scale=1.5).outputs["Fac"], "Distance": 0.15})
    small = add(tree, "Bump", {"Height": add(tree, "TexWave", {"Vector": where, "Scale": 2.0}).outputs["Fac"],
                               "Distance": 0.03, "Normal": large.outputs[0]})
    diffuse = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
    link(tree, small.outputs[0], diffuse.inputs["Normal"])
    return large, small


class Text(unittest.TestCase):
    def said(self, wanted=()):
        scene, result = exported()
        self.assertEqual(result.left_out, [f"left out: {line}" for line in wanted])
        return scene

    def test_bumps_of_bumps(self):
        _, small = bump_of_bump()
        bump = self.said()["materials"]["Floor"]["bump"]
        self.assertAlmostEqual(bump["scale"], 0.15)
        small.mute = True
        self.assertAlmostEqual(self.said()["materials"]["Floor"]["bump"]["scale"], 0.15)

    def test_a_flat_bump_is_what_is_below(self):
        _, small = bump_of_bump()
        tree = small.id_data
        tree.links.remove(small.inputs["Height"].links[0])
        self.assertAlmostEqual(self.said()["materials"]["Floor"]["bump"]["scale"], 0.15)

    def test_a_normal_map_below_a_bump(self):
        large, small = bump_of_bump()
        tree = small.id_data
        picture = bpy.data.images.new("Normals", 4, 4)
        picture.colorspace_settings.name = "Non-Color"
        below = add(tree, "NormalMap", {"Color": add(tree, "TexImage", image=picture).outputs[0]})
        link(tree, below.outputs[0], small.inputs["Normal"])
        floor = self.said()["materials"]["Floor"]
        self.assertIn("normal_map", floor)
        self.assertNotIn("over", floor["bump"])
        # On another bump as well.
        link(tree, below.outputs[0], large.inputs["Normal"])
        link(tree, large.outputs[0], small.inputs["Normal"])
        floor = self.said()["materials"]["Floor"]
        self.assertIn("normal_map", floor)
        self.assertAlmostEqual(floor["bump"]["over"]["scale"], 0.15)

    def test_bumps_of_a_strength(self):
        large, small = bump_of_bump()
        small.inputs["Strength"].default_value = 0.25
        bump = self.said()["materials"]["Floor"]["bump"]
        self.assertEqual((bump["strength"], "strength" in bump["over"]), (0.25, False))
        self.assertAlmostEqual(bump["scale"], 0.03)
        self.assertAlmostEqual(bump["over"]["scale"], 0.15)
        self.assertNotEqual(bump["texture"], bump["over"]["texture"])
        small.inputs["Strength"].default_value = 0.0
        self.assertNotIn("over", self.said()["materials"]["Floor"]["bump"])

    def test_sums(self):
        room()
        of_two(("Diffuse", {"Color": (0.3, 0.2, 0.1)}), ("Diffuse", {"Color": (0.1, 0.2, 0.3)}))
        reflectance = self.said()["materials"]["Ball"]["reflectance"]
        np.testing.assert_allclose(reflectance, 0.4, rtol=1e-6)
        room()
        of_two(("Diffuse", {"Color": (0.3, 0.2, 0.1)}), ("Glossy", {"Color": (0.1, 0.1, 0.1), "Roughness": 0.3}))
        scene = self.said()
        mixed = scene["materials"]["Ball"]
        self.assertEqual(mixed["type"], "blend")
        shares = (1.0 - mixed["weight"], mixed["weight"])
        for name, share, color in zip(mixed["materials"], shares, ([0.3, 0.2, 0.1], [0.1, 0.1, 0.1])):
            part = np.broadcast_to(scene["materials"][name]["reflectance"], 3)
            np.testing.assert_allclose(part * share, color, rtol=1e-5)

    def test_sums_with_sheen(self):
        room()
        of_two(("Diffuse", {"Color": (0.3, 0.2, 0.1)}), ("Sheen", {"Color": (0.5, 0.5, 0.5)}))
        scene = self.said()
        kinds = [scene["materials"][name]["type"] for name in scene["materials"]["Ball"]["materials"]]
        self.assertEqual(kinds, ["diffuse", "sheen"])

    def test_rough_diffuse(self):
        room()
        ball("ShaderNodeBsdfDiffuse", Color=(0.9, 0.5, 0.3), Roughness=0.25)
        table = self.said()["materials"]["Ball"]
        self.assertEqual((table["type"], table["roughness"]), ("diffuse", 0.25))
        # Two of them are not one.
        room()
        of_two(("Diffuse", {"Color": (0.3, 0.2, 0.1), "Roughness": 0.5}), ("Diffuse", {"Color": (0.1, 0.2, 0.3)}))
        self.assertEqual(self.said()["materials"]["Ball"]["type"], "blend")

    def test_sums_with_velvet(self):
        for color, lines in ((0.5, []), (0.9, ["node 'Add Shader' of material 'Ball': velvet of 0.90 over what is as bright "
                                               "is dimmed to 0.70"])):
            with self.subTest(color=color):
                room()
                of_two(("Diffuse", {"Color": (0.3, 0.2, 0.1)}), ("Sheen", {"Color": (color,) * 3, "Roughness": 0.4}))
                tree = bpy.data.materials["Ball"].node_tree
                next(node for node in tree.nodes if node.type == "BSDF_SHEEN").distribution = "ASHIKHMIN"
                scene = self.said(lines)
                mixed = scene["materials"]["Ball"]
                self.assertEqual(mixed["type"], "blend")
                wanted = {"diffuse": (0.3, 0.2, 0.1), "velvet": (min(color, 0.7),) * 3}
                for name, share in zip(mixed["materials"], (1.0 - mixed["weight"], mixed["weight"])):
                    part = scene["materials"][name]
                    found = np.broadcast_to(part["reflectance"], 3) * share
                    np.testing.assert_allclose(found, wanted[part["type"]], rtol=1e-5)

    def test_sheen_below_gloss(self):
        for distribution in ("ASHIKHMIN", "MICROFIBER"):
            with self.subTest(distribution):
                room()
                principled = ("Principled", {"Base Color": (0.3, 0.2, 0.1), "Roughness": 0.5})
                of_two(principled, ("Sheen", {"Color": (0.5, 0.5, 0.5), "Roughness": 0.4}))
                tree = bpy.data.materials["Ball"].node_tree
                next(node for node in tree.nodes if node.type == "BSDF_SHEEN").distribution = distribution
                scene = self.said()
                table = scene["materials"]["Ball"]
                self.assertEqual((table["type"], table["base_color"]["operation"]), ("principled", "minimum"))
                self.assertIn("{'node': 'layer_weight', 'output': 'facing'}", str(scene["textures"] | table))

    def test_sums_above_one(self):
        room()
        of_two(("Diffuse", {"Color": (0.8, 0.8, 0.8)}), ("Glossy", {"Color": (0.7, 0.7, 0.7), "Roughness": 0.3}))
        self.said(["node 'Add Shader' of material 'Ball': a sum that reflects up to 1.50 of the light is dimmed to "
                   "what arrives"])

    def test_sums_that_have_no_word(self):
        room()
        of_two(("Glass", {}), ("Diffuse", {"Color": (0.1, 0.1, 0.1)}))
        self.said(["node 'Add Shader' of material 'Ball': a sum of two shaders that both scatter light; the first "
                   "is used"])

    def test_sheen(self):
        room()
        ball("ShaderNodeBsdfSheen", Color=(0.9, 0.5, 0.3), Roughness=0.8)
        table = self.said()["materials"]["Ball"]
        self.assertEqual(table["type"], "sheen")
        self.assertAlmostEqual(table["roughness"], 0.8, places=6)
        np.testing.assert_allclose(table["reflectance"], (0.9, 0.5, 0.3), rtol=1e-6)

    def test_normals_as_numbers(self):
        room()
        tree = bpy.context.scene.world.node_tree
        node = add(tree, "Normal", {"Normal": add(tree, "TexCoord").outputs["Generated"]})
        node.outputs["Normal"].default_value = (0.0, 0.0, 2.0)
        link(tree, node.outputs["Dot"], scenes.background().inputs["Color"])
        table = self.said()["textures"]["World/Normal"]
        self.assertEqual((table["operation"], table["b"]), ("dot_product", [0.0, 0.0, 1.0]))

    def test_what_eevee_alone_has(self):
        tree = room().node_tree
        diffuse = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
        link(tree, add(tree, "ShaderToRGB").outputs["Color"], diffuse.inputs["Color"])
        table = self.said()["materials"]["Floor"]
        np.testing.assert_allclose(table["reflectance"], diffuse.inputs["Color"].default_value[:3])

    def test_lights_without_shadows(self):
        room(light=False)
        lamps = [scenes.light(kind, (0.5, 0.3, 2.0), 50.0) for kind in ("POINT", "SUN", "AREA")]
        self.assertNotIn("rules", self.said())
        for lamp in lamps[:2]:
            lamp.data.use_shadow = False
        self.assertEqual(self.said()["rules"], [{"on": ["Point", "Sun"], "rays": ["shadow"], "exclude": ["all"]}])
        # What is not in the scene has no rule.
        lamps[2].data.size, lamps[2].data.use_shadow = 0.0, False
        scene, _ = exported()
        self.assertEqual(scene["rules"][0]["on"], ["Point", "Sun"])

    def test_falloff(self):
        for output, wanted in (("Quadratic", []), ("Linear", [
                "node 'Light Falloff' of light 'Point': a falloff that is linear"])):
            room(light=False)
            lamp = scenes.light("POINT", (0.5, 0.3, 2.0), 50.0)
            lamp.data.use_nodes = True
            tree = lamp.data.node_tree
            falloff = add(tree, "LightFalloff", {"Strength": 3.0})
            link(tree, falloff.outputs[output], tree.nodes["Emission"].inputs["Strength"])
            scene = self.said(wanted)
            factor = 3.0 if output == "Quadratic" else 1.0
            (light,) = [light for light in scene["lights"] if light["type"] == "point"]
            np.testing.assert_allclose(light["intensity"], 50.0 / (4.0 * np.pi) * factor, rtol=1e-5)


class Sheen(unittest.TestCase):
    def test_as_bright_as_in_cycles(self):
        for kind in ("ASHIKHMIN", "MICROFIBER"):
            for rough in (0.3, 0.5, 1.0):
                with self.subTest(kind=kind, rough=rough):
                    scenes.empty()
                    scene = compare.use_cycles(32, 32, 512)
                    scene.cycles.max_bounces = 1
                    scenes.background().inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
                    camera = scenes.camera((0.0, 0.0, 5.0), (0.0, 0.0, 0.0))
                    camera.data.type, camera.data.ortho_scale = "ORTHO", 2.0
                    made = scenes.material("Cloth", "ShaderNodeBsdfSheen", Color=(1.0, 1.0, 1.0), Roughness=rough)
                    shader(made).distribution = kind
                    scenes.ball("Ball", 1.0, (0.0, 0.0, 0.0), made, segments=128)
                    theirs = compare.with_cycles(self.folder(), runs=2).mean[..., 0]
                    x = (np.arange(32) + 0.5) / 16.0 - 1.0
                    radius = np.hypot(x[:, None], x[None, :])
                    within = radius < 0.95
                    facing = 1.0 - np.sqrt(1.0 - radius[within] ** 2)
                    ours = np.interp(facing, np.linspace(0.0, 1.0, sheen.STOPS), sheen.reflected(kind, rough))
                    off = ours - theirs[within]
                    print(f"sheen {kind.lower()} {rough}: {ours.mean():.4f}, Cycles {theirs[within].mean():.4f}, "
                          f"at most {np.abs(off).max():.3f} off", flush=True)
                    self.assertLess(abs(off.mean()), 0.01)
                    self.assertLess(np.abs(off).max(), 0.06)

    def folder(self):
        kept = tempfile.TemporaryDirectory()
        self.addCleanup(kept.cleanup)
        return pathlib.Path(kept.name)


@unittest.skipUnless(compare.reads("textures"), "no beamfarm that knows texture graphs: set BEAMFARM, or build it")
class Compared(unittest.TestCase):
    def check(self, name, **how):
        result = compare.check(self, name, **how)
        self.assertEqual(result.left_out, [])

    def test_bumps_of_bumps(self):
        bump_of_bump()
        self.check("a bump of a bump", tolerance=0.015)

    def test_steep_bumps_of_little_strength(self):
        # Cycles computes slopes as differences over a pixel, here over large waves.
        large, small = bump_of_bump()
        for bump in (large, small):
            bump.inputs["Strength"].default_value, bump.inputs["Distance"].default_value = 0.3, 0.5
        self.check("steep bumps of little strength", tolerance=0.015)

    def test_lights_without_shadows(self):
        for kind, values in (("POINT", {"energy": 60.0, "shadow_soft_size": 0.1, "use_soft_falloff": False}),
                             ("SUN", {"energy": 2.0, "angle": 0.0})):
            with self.subTest(kind):
                room(light=False, world=0.1)
                # Black, so that it reflects no light.
                scenes.cube("Box", 0.6, (0.0, 0.0, 0.6), scenes.diffuse("Black", (0.0, 0.0, 0.0)))
                scenes.light(kind, (0.4, -0.3, 3.0), **values, use_shadow=False)
                self.check(f"{kind.lower()} without shadows")

    def test_sums(self):
        room()
        of_two(("Diffuse", {"Color": (0.5, 0.3, 0.2)}), ("Glossy", {"Color": (0.2, 0.2, 0.2), "Roughness": 0.2}))
        self.check("a sum of diffuse and glossy", blocks=1.5)

    def test_velvet(self):
        for rough in (0.2, 0.5, 1.0):
            with self.subTest(rough=rough):
                room()
                made = ball("ShaderNodeBsdfSheen", Color=(0.9, 0.5, 0.3), Roughness=rough)
                shader(made.data.materials[0]).distribution = "ASHIKHMIN"
                self.check(f"velvet, roughness {rough}", tolerance=0.01, blocks=2.5)

    def test_sheen(self):
        for rough in (0.2, 0.5, 0.8):
            with self.subTest(rough=rough):
                room()
                ball("ShaderNodeBsdfSheen", Color=(0.9, 0.5, 0.3), Roughness=rough)
                self.check(f"sheen of microfibers, roughness {rough}", tolerance=0.01, blocks=2.5)

    def test_sheen_over_a_principled_surface(self):
        coat = {"Coat_Weight": 0.5, "Coat_Roughness": 0.3}
        for kind, more in (("plain", {}), ("coat", coat), ("metal", {"Metallic": 1.0})):
            with self.subTest(kind):
                room()
                ball("ShaderNodeBsdfPrincipled", Base_Color=(0.5, 0.1, 0.1), Roughness=0.6, Sheen_Weight=0.8,
                     Sheen_Roughness=0.4, Sheen_Tint=(0.7, 0.9, 1.0), **more)
                self.check(f"sheen over what is principled, {kind}", tolerance=0.01, blocks=2.5)

    def test_rough_diffuse(self):
        for rough in (0.3, 1.0):
            with self.subTest(rough=rough):
                room()
                ball("ShaderNodeBsdfDiffuse", Color=(0.8, 0.5, 0.3), Roughness=rough)
                self.check(f"diffuse, roughness {rough}", tolerance=0.01, blocks=1.5)
        room()
        ball("ShaderNodeBsdfPrincipled", Base_Color=(0.8, 0.5, 0.3), Roughness=0.5, Diffuse_Roughness=1.0)
        self.check("principled of a rough base", tolerance=0.015, blocks=1.5)


if __name__ == "__main__":
    unittest.main()
