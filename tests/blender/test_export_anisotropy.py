"""Anisotropic microfacets: what is written to the scene file, and the pictures against Cycles."""

import os
import unittest

import bpy
import compare
import scenes
from test_export_graphs import add, link
from test_export_materials import room, shader
from test_export_text import exported

METAL = {"Base_Color": (0.9, 0.7, 0.5), "Metallic": 1.0, "Roughness": 0.3}


def brushed(node="Principled", tangent=None, plate=True, **inputs):
    """A ball, and perhaps a plate behind it, of one material. `tangent`: settings of a Tangent node."""
    room()
    values = METAL if node == "Principled" else {"Color": (0.9, 0.7, 0.5), "Roughness": 0.3}
    kind = f"ShaderNodeBsdf{node}"
    made = scenes.material("Brushed", kind, **values | inputs)
    if tangent is not None:
        node = add(made.node_tree, "Tangent")
        for name, value in tangent.items():
            setattr(node, name, value)
        link(made.node_tree, node.outputs[0], shader(made).inputs["Tangent"])
    scenes.ball("Ball", 0.5, (-0.55, 0.0, 0.55), made)
    if plate:
        scenes.plane("Plate", 1.4, (0.7, 0.5, 0.7), scenes.degrees(70.0, 0.0, -10.0), made)
    return made


class Text(unittest.TestCase):
    def told(self):
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        return scene["materials"]["Brushed"], scene, result

    def test_principled(self):
        brushed(Anisotropic=0.5, Anisotropic_Rotation=1.25)
        table, scene, _ = self.told()
        self.assertEqual(table["type"], "principled")
        self.assertAlmostEqual(table["anisotropic"], 0.5)
        self.assertAlmostEqual(table["anisotropic_rotation"], 0.25)
        self.assertEqual(table["tangent"], "around_z")
        # The object whose axis and box are meant.
        self.assertTrue(all("space" in shape for shape in scene["shapes"] if shape["material"] == "Brushed"))
        brushed(Anisotropic=0.0, Anisotropic_Rotation=0.25)
        table, scene, _ = self.told()
        self.assertFalse({"anisotropic", "anisotropic_rotation", "tangent"} & set(table))
        self.assertNotIn("space", str(scene["shapes"]))

    def test_glossy_is_the_other_way_round(self):
        for anisotropy, u, v in ((0.5, 0.045, 0.18), (-0.5, 0.18, 0.045)):
            brushed("Glossy", Anisotropy=anisotropy)
            table, _, _ = self.told()
            self.assertNotIn("alpha", table)
            self.assertAlmostEqual(table["alpha_u"], u, 5)
            self.assertAlmostEqual(table["alpha_v"], v, 5)

    def test_tangents(self):
        for settings, wanted in (
            ({"direction_type": "RADIAL", "axis": "X"}, "around_x"),
            ({"direction_type": "RADIAL", "axis": "Y"}, "around_y"),
            ({"direction_type": "UV_MAP"}, None),
        ):
            brushed(tangent=settings, Anisotropic=0.5)
            table, _, _ = self.told()
            self.assertEqual(table.get("tangent"), wanted)

    def test_another_uv_map(self):
        made = brushed(tangent={"direction_type": "UV_MAP", "uv_map": "Other"}, Anisotropic=0.5)
        for name in ("Ball", "Plate"):
            bpy.data.objects[name].data.uv_layers.new(name="Other")
        self.told()
        tree = made.node_tree
        vector = add(tree, "CombineXYZ")
        link(tree, vector.outputs[0], shader(made).inputs["Tangent"])
        scene, result = exported()
        self.assertIn("as a tangent", str(result.left_out))
        self.assertEqual(scene["materials"]["Brushed"]["tangent"], "around_z")

    def test_glass_is_even_and_what_is_partly_glass_is_told_of(self):
        brushed(Metallic=0.0, Transmission_Weight=1.0, Anisotropic=0.5)
        table, _, _ = self.told()
        self.assertEqual(table["type"], "rough_dielectric")
        brushed(Metallic=0.0, Transmission_Weight=0.5, Anisotropic=0.5)
        table, _, result = self.told()
        self.assertIn("anisotropic", table)
        self.assertIn("transmitted light is anisotropic", str(result.notes))

    def test_by_texture(self):
        made = brushed(Anisotropic=0.5)
        tree = made.node_tree
        checkers = add(tree, "TexChecker", {"Color1": (0.2, 0.2, 0.2, 1.0), "Color2": (0.8, 0.8, 0.8, 1.0)})
        link(tree, checkers.outputs["Color"], shader(made).inputs["Anisotropic"])
        table, _, _ = self.told()
        self.assertIsInstance(table["anisotropic"], dict)


@unittest.skipUnless(os.environ.get("BEAMFARM_LONG"), "minutes: BEAMFARM_LONG=1")
@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Compared(unittest.TestCase):
    def check(self, name, **how):
        result = compare.check(self, name, tolerance=0.015, **how)
        self.assertEqual(result.left_out, [])

    def test_principled(self):
        for amount in (0.5, 0.8):
            for rotation in (0.0, 0.25):
                with self.subTest(amount=amount, rotation=rotation):
                    brushed(Anisotropic=amount, Anisotropic_Rotation=rotation)
                    self.check(f"principled {amount} {rotation}")

    def test_glossy(self):
        for amount, rotation in ((0.5, 0.0), (0.5, 0.25), (-0.6, 0.0)):
            with self.subTest(amount=amount, rotation=rotation):
                brushed("Glossy", Anisotropy=amount, Rotation=rotation)
                self.check(f"glossy {amount} {rotation}")

    def test_tangents(self):
        for settings in ({"axis": "X"}, {"axis": "Y"}, {"direction_type": "UV_MAP"}):
            with self.subTest(**settings):
                # Circles around x are perpendicular to a plate without height.
                brushed(tangent=settings, plate="axis" not in settings, Anisotropic=0.8, Anisotropic_Rotation=0.1)
                self.check(f"tangent {settings.get('axis', 'uv')}")

    def test_coated_plastic(self):
        brushed(Metallic=0.0, Roughness=0.4, Anisotropic=0.8)
        self.check("plastic 0.8")


if __name__ == "__main__":
    unittest.main()
