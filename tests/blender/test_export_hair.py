"""Hair as exported; with BEAMFARM_LONG=1 against Cycles."""

import math
import os
import unittest

import bpy
import compare
import numpy as np
import scenes

LONG = bool(os.environ.get("BEAMFARM_LONG"))


def lock(count=150, points=8, radius=0.012, material=None):
    """A curves object: a lock that stands on the ground and bends over."""
    data = bpy.data.hair_curves.new("Lock")
    data.add_curves([points] * count)
    i, t = np.arange(count)[:, None], np.linspace(0.0, 1.0, points)[None]
    turn, across = i * 2.399963, 0.35 * np.sqrt((i + 0.5) / count)
    x = across * np.cos(turn) + 0.5 * t * t
    y = across * np.sin(turn) + 0.1 * np.sin(9.0 * t + i)
    places = np.stack(np.broadcast_arrays(x, y, 1.2 * t), axis=2).astype(np.float32)
    data.attributes["position"].data.foreach_set("vector", places.ravel())
    radii = np.broadcast_to(radius * (1.0 - 0.7 * t), (count, points)).astype(np.float32)
    attribute = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    attribute.data.foreach_set("value", radii.ravel())
    if material is not None:
        data.materials.append(material)
    return scenes.link("Lock", data)


def hair_material(parametrization="MELANIN", **inputs):
    made = scenes.material("Hair", "ShaderNodeBsdfHairPrincipled")
    node = next(node for node in made.node_tree.nodes if node.type == "BSDF_HAIR_PRINCIPLED")
    node.model, node.parametrization = "CHIANG", parametrization
    for name in ("Random Roughness", "Random Color"):
        if name in node.inputs:
            node.inputs[name].default_value = 0.0
    scenes.set_inputs(node, inputs)
    return made


def stage():
    scene = scenes.empty()
    scenes.camera((0.0, -4.0, 1.2), (0.25, 0.0, 0.55), 50.0)
    scene.cycles_curves.shape = "THICK"
    return scene


class Exports(unittest.TestCase):
    def setUp(self):
        stage()
        scenes.light("POINT", (2.0, -2.0, 3.0), 300.0)

    def test_curves(self):
        lock(material=hair_material(Melanin=0.4, Roughness=0.25))
        result = compare.export_scene()
        self.assertEqual(result.left_out, [])
        for part in ('type = "curves"', 'basis = "catmull_rom"', 'type = "hair"', "beta_m = 0.25", "tilt = -2.0"):
            self.assertIn(part, result.text)

    def test_particles(self):
        ball = scenes.ball("Head", 0.5, material=scenes.diffuse())
        bpy.context.view_layer.objects.active = ball
        ball.modifiers.new("Fur", "PARTICLE_SYSTEM")
        settings = ball.particle_systems[0].settings
        settings.type, settings.count, settings.hair_length = "HAIR", 50, 0.3
        result = compare.export_scene()
        self.assertEqual(result.left_out, [])
        self.assertIn('name = "Head/hair"', result.text)
        self.assertIn('name = "Head"', result.text)

    def test_glass_is_left_out(self):
        lock(material=scenes.material("Glass", "ShaderNodeBsdfGlass"))
        result = compare.export_scene()
        self.assertTrue('type = "thin_dielectric"' in result.text or "glass" in " ".join(result.left_out), result.text)


@unittest.skipUnless(LONG, "minutes")
class BesideCycles(unittest.TestCase):
    def look(self, name, material, sun=False):
        stage()
        scenes.background().inputs["Color"].default_value = (0.3, 0.3, 0.3, 1.0)
        if sun:
            scenes.background().inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
            scenes.light("AREA", (0.0, 3.0, 3.0), 200.0, (0.2, 0.0, 0.5), size=1.0)
        scenes.plane("Floor", 8.0, material=scenes.diffuse())
        lock(material=material())
        compare.use_cycles(48, 48, 128)
        compare.check(self, name, tolerance=0.02, blocks=1.5)

    def test_even_light(self):
        self.look("melanin", lambda: hair_material(Melanin=0.5, Melanin_Redness=0.7))

    def test_light_from_behind(self):
        how = {"Color": (0.6, 0.3, 0.15), "Roughness": 0.2, "Radial_Roughness": 0.4, "Offset": math.radians(10.0)}
        self.look("colour, from behind", lambda: hair_material("COLOR", **how), sun=True)

    def test_diffuse(self):
        self.look("diffuse", scenes.diffuse)


if __name__ == "__main__":
    unittest.main()
