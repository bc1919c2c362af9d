"""Every kind of light on a wall, against Cycles."""

import math
import os
import tomllib
import unittest

import bpy
import compare
import numpy as np
import scenes


def some(cases):
    """All cases where tests may take long, otherwise every other one."""
    return list(cases)[:: 1 if os.environ.get("BEAMFARM_LONG") else 2]


def floor():
    scenes.empty()
    # Direct light has little noise; ours has more.
    compare.use_cycles(samples=32)
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.0))
    scenes.plane(size=6.0, material=scenes.diffuse())


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Lights(unittest.TestCase):
    def setUp(self):
        floor()

    def check(self, name, **how):
        return compare.check(self, name, **how)

    def test_point(self):
        scenes.light("POINT", (0.5, 0.3, 2.0), 50.0, color=(1.0, 0.6, 0.3))
        self.check("point")

    def test_point_with_a_radius(self):
        scenes.light("POINT", (0.5, 0.3, 2.0), 50.0, shadow_soft_size=0.3, use_soft_falloff=False)
        self.check("point, radius 0.3")

    def test_point_that_is_seen(self):
        lamp = scenes.light("POINT", (0.5, 0.3, 1.0), 50.0, shadow_soft_size=0.3, use_soft_falloff=False)
        lamp.visible_camera = True
        self.check("point that is seen")

    def test_soft_falloff_far_away(self):
        scenes.light("POINT", (0.5, 0.3, 2.0), 50.0, shadow_soft_size=0.1)
        result = self.check("point, soft falloff")
        self.assertNotIn("soft_falloff", result.text)

    def test_soft_falloff(self):
        # The last ones are sunk into the floor.
        for kind, radius in some((("POINT", 0.6), ("POINT", 2.0), ("SPOT", 0.6), ("SPOT", 2.0))):
            with self.subTest(kind=kind, radius=radius):
                floor()
                scenes.ball("Ball", 0.3, (0.4, 0.0, 0.3), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
                lamp = scenes.light(kind, (0.0, 0.0, 1.5), 50.0, shadow_soft_size=radius)
                lamp.visible_camera = False
                result = self.check(f"{kind.lower()}, soft falloff of {radius}")
                self.assertIn("soft_falloff = true", result.text)
                self.assertEqual(result.notes, [])

    def test_soft_falloff_within_a_shade(self):
        # A lamp inside a bulb, and one larger than its bulb.
        for kind, size in some((("POINT", 0.25), ("POINT", 0.1))):
            with self.subTest(kind=kind, size=size):
                floor()
                scenes.light(kind, (0.0, 0.0, 1.5), 50.0, shadow_soft_size=0.2)
                bulb = scenes.material("Bulb", "ShaderNodeBsdfTranslucent")
                scenes.ball("Bulb", size, (0.0, 0.0, 1.5), material=bulb)
                self.check(f"{kind.lower()} in a bulb of {size}")

    def test_no_lamp_is_seen_through_a_tint(self):
        # A camera ray that a Transparent shader lets through is still a camera ray.
        tint = scenes.material("Shade", "ShaderNodeBsdfTransparent", Color=(0.9, 0.6, 0.3, 1.0))
        scenes.ball("Shade", 0.5, (0.0, 0.0, 1.2), material=tint)
        lamp = scenes.light("POINT", (0.0, 0.0, 1.2), 50.0, shadow_soft_size=0.2, use_soft_falloff=False)
        ball = scenes.ball("Ball", 0.2, (0.0, 0.9, 0.8), material=scenes.diffuse())
        lamp.visible_camera, ball.visible_transmission = False, False
        result = self.check("a lamp in a tinted shade")
        rules = tomllib.loads(result.text)["rules"]
        found = [(rule["on"], rule["exclude"]) for rule in rules]
        self.assertEqual(found, [(["Shade"], ["Point"]), (["all"], ["Ball"])])
        lamp.visible_camera, ball.visible_transmission = True, True
        self.check("a lamp in a tinted shade, seen")

    def test_spots(self):
        for size, blend in some(((60.0, 0.5), (120.0, 0.15), (80.0, 1.0), (60.0, 0.0))):
            with self.subTest(size=size, blend=blend):
                floor()
                scenes.light("SPOT", (0.5, 0.3, 2.0), 50.0, spot_size=math.radians(size), spot_blend=blend)
                self.check(f"spot {size:.0f}, blend {blend}")

    def test_spread(self):
        for degrees in (120.0, 40.0, 10.0):
            with self.subTest(spread=degrees):
                floor()
                scenes.light("AREA", (0.5, 0.3, 2.0), 50.0, size=1.0, spread=math.radians(degrees))
                self.check(f"area light, spread {degrees:.0f}")

    def test_ies(self):
        # Brighter on one side, so that the orientation shows. Fine, since Cycles interpolates its table cubically.
        down, around = range(0, 91, 5), range(0, 361, 15)
        rows = "\n".join(
            " ".join(f"{50.0 * math.cos(math.radians(v)) * (1.0 + 0.8 * math.cos(math.radians(h - 40.0))):.4f}"
                     for v in down) for h in around)
        angles = "\n".join(" ".join(map(str, angles)) for angles in (down, around))
        for kind in ("POINT", "SPOT"):
            with self.subTest(kind):
                floor()
                text = bpy.data.texts.new("lamp.ies")
                size = f"1 1000 2 {len(down)} {len(around)} 1 2 0 0 0"
                text.write(f"IESNA:LM-63-2002\nTILT=NONE\n{size}\n1 1 10\n{angles}\n{rows}\n")
                lamp = scenes.light(kind, (0.5, 0.3, 2.0), 5.0, shadow_soft_size=0.0).data
                lamp.use_nodes = True
                nodes = lamp.node_tree.nodes
                table = nodes.new("ShaderNodeTexIES")
                table.ies = text
                table.inputs["Strength"].default_value = 3.0
                lamp.node_tree.links.new(table.outputs["Fac"], nodes["Emission"].inputs["Strength"])
                self.check(f"{kind.lower()} with an IES file")

    def test_without_shadows(self):
        scenes.light("POINT", (0.5, 0.3, 2.0), 50.0, use_shadow=False)
        scenes.plane("Blocker", size=1.0, location=(0.2, 0.1, 1.0), material=scenes.diffuse("Black", (0.0, 0.0, 0.0)))
        result = self.check("point, no shadow")
        self.assertEqual(len(result.notes), 1)

    def test_sun(self):
        scenes.light("SUN", (0.5, 0.3, 2.0), 2.0, angle=0.0)
        self.check("sun")

    def test_wide_suns(self):
        for angle in (0.5, 2.0):
            with self.subTest(angle=angle):
                floor()
                scenes.light("SUN", (0.5, 0.3, 2.0), 2.0, angle=angle)
                self.check(f"sun, angle {angle}")

    def test_soft_shadows(self):
        spot = {"shadow_soft_size": 0.15, "spot_size": math.radians(70.0), "spot_blend": 0.3}
        cases = (
            ("SUN", 3.0, {"angle": 0.2}),
            ("SPOT", 100.0, spot),
            ("SPOT", 100.0, spot | {"use_soft_falloff": False}),
            ("SPOT", 100.0, spot | {"use_soft_falloff": False, "shadow_soft_size": 0.6}),
        )
        for kind, energy, values in some(cases):
            with self.subTest(kind, **values):
                floor()
                scenes.ball("Ball", 0.3, (0.0, 0.0, 0.8), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
                scenes.light(kind, (0.5, 0.3, 2.5), energy, **values)
                self.assertEqual(self.check(f"{kind.lower()}, soft shadows, {values}").notes, [])

    def test_areas(self):
        for shape in some(("ELLIPSE", "SQUARE", "RECTANGLE", "DISK")):
            with self.subTest(shape=shape):
                floor()
                lamp = scenes.light("AREA", (0.5, 0.3, 2.0), 20.0, shape=shape, size=1.0, size_y=0.5)
                lamp.scale = (1.0, 1.5, 1.0)
                self.check(f"area, {shape.lower()}")

    def test_area_that_is_seen(self):
        lamp = scenes.light("AREA", (0.5, 0.3, 1.0), 50.0, target=(0.0, -2.0, 2.0), size=1.0)
        lamp.visible_camera = True
        self.check("area that is seen")

    def test_lamps_do_not_block(self):
        scenes.light("AREA", (0.0, 0.0, 1.0), 50.0, size=1.0)
        scenes.light("POINT", (0.0, 0.0, 2.0), 50.0)
        self.check("a lamp before another")

    def test_not_normalized(self):
        warm = {"normalize": False, "exposure": 1.0, "use_temperature": True, "temperature": 4000.0}
        cases = {
            "POINT": {"shadow_soft_size": 0.2, "use_soft_falloff": False},
            "AREA": {"size": 0.7},
            "SUN": {"angle": 0.2},
            "SPOT": {"shadow_soft_size": 0.02},
        }
        for kind, values in some(cases.items()):
            with self.subTest(kind=kind):
                floor()
                if "normalize" not in scenes.bpy.types.Light.bl_rna.properties:
                    self.skipTest("this Blender has no such lights")
                scenes.light(kind, (0.5, 0.3, 2.0), 3.0, **values, **warm)
                self.check(f"{kind.lower()}, not normalized, 4000 K")

    def test_nodes(self):
        lamp = scenes.light("POINT", (0.5, 0.3, 2.0), 50.0, color=(1.0, 0.8, 1.0))
        lamp.data.use_nodes = True
        emission = lamp.data.node_tree.nodes["Emission"]
        emission.inputs["Color"].default_value = (1.0, 0.5, 0.2, 1.0)
        emission.inputs["Strength"].default_value = 3.0
        self.check("point with nodes")

    def test_meshes_that_shine(self):
        shining = {"node": "ShaderNodeEmission", "Strength": 3.0, "Color": (1.0, 0.6, 0.3)}
        scenes.ball("Ball", 0.4, (0.0, 0.0, 1.0), scenes.material("Glow", **shining))
        self.check("closed mesh that shines")

    @unittest.skipUnless(compare.knows("EmissionRecord", "two_sided"), "this beamfarm knows no emission to both sides")
    def test_what_shines_to_both_sides(self):
        shining = {"node": "ShaderNodeEmission", "Strength": 3.0, "Color": (1.0, 0.6, 0.3)}
        with self.subTest("open"):
            scenes.plane("Sheet", 1.0, (0.0, 0.0, 1.0), scenes.degrees(30, 0, 0), scenes.material("Glow", **shining))
            self.check("open mesh that shines")
        with self.subTest("closed, seen from inside"):
            floor()
            scenes.ball("Sky", 20.0, (0.0, 0.0, 0.0), scenes.material("Glow", **shining))
            self.check("a ball that shines around all")

    @unittest.skipUnless(compare.knows("TextureRecord", "attribute"), "this beamfarm knows no colours of vertices")
    def test_colours_of_vertices(self):
        for domain in ("POINT", "CORNER"):
            for shines in some((False, True)):
                with self.subTest(domain, shines=shines):
                    floor()
                    scenes.light("AREA", (0.5, 0.3, 2.0), 50.0, size=1.0)
                    node = {"node": "ShaderNodeEmission", "Strength": 2.0} if shines else {"Specular_IOR_Level": 0.0}
                    made = scenes.material("Colours", **node)
                    sheet = scenes.plane("Sheet", 1.0, (0.0, 0.0, 0.5), scenes.degrees(20, 0, 0), made)
                    colors = sheet.data.color_attributes.new("Paint", "FLOAT_COLOR", domain)
                    colors.data.foreach_set("color", [0.9, 0.1, 0.1, 1, 0.1, 0.9, 0.1, 1, 0.1, 0.1, 0.9, 1, 1, 1, 1, 1])
                    tree = made.node_tree
                    paint = tree.nodes.new("ShaderNodeVertexColor")
                    paint.layer_name = "Paint"
                    shader = next(node for node in tree.nodes if node.type in ("EMISSION", "BSDF_PRINCIPLED"))
                    tree.links.new(paint.outputs["Color"], shader.inputs[0])
                    self.check(f"colours of vertices, {domain.lower()}, shines: {shines}")

    @unittest.skipUnless(compare.knows("EmissionRecord", "scale"), "this beamfarm knows no textures that shine")
    def test_a_texture_that_shines(self):
        picture = bpy.data.images.new("Screen", 4, 4)
        values = np.ones((4, 4, 4), dtype=np.float32)
        values[..., 0], values[..., 1] = np.linspace(0.1, 1.0, 4), np.linspace(1.0, 0.0, 4)[:, None]
        picture.pixels.foreach_set(values.ravel())
        picture.update()
        glow = scenes.material("Glow", "ShaderNodeEmission", Strength=3.0)
        tree = glow.node_tree
        image = tree.nodes.new("ShaderNodeTexImage")
        image.image, image.interpolation = picture, "Closest"
        shader = next(node for node in tree.nodes if node.type == "EMISSION")
        tree.links.new(image.outputs["Color"], shader.inputs["Color"])
        scenes.plane("Sheet", 1.0, (0.0, 0.0, 1.0), scenes.degrees(30, 0, 0), glow)
        self.check("a texture that shines")

    def test_world(self):
        scenes.background().inputs["Color"].default_value = (0.5, 0.6, 0.7, 1.0)
        scenes.background().inputs["Strength"].default_value = 2.0
        self.check("world colour")


if __name__ == "__main__":
    unittest.main()
