"""Sky textures: what the add-on makes of them, against Cycles."""

import math
import pathlib
import tempfile
import unittest

import bpy
import compare
import numpy as np
import scenes
from export import sky
from test_export_text import exported

HEIGHT = 64
IS_NEW = bpy.app.version >= (5, 0, 0)


def around(**values):
    """Makes a Sky Texture the world. Returns its node."""
    scenes.empty()
    tree = bpy.context.scene.world.node_tree
    node = tree.nodes.new("ShaderNodeTexSky")
    tree.links.new(node.outputs[0], scenes.background().inputs["Color"])
    node.sky_type = "SINGLE_SCATTERING" if IS_NEW else "NISHITA"
    node.sun_disc, node.altitude, node.sun_elevation = False, 0.0, 0.26
    for name, value in values.items():
        if IS_NEW:
            name = name.replace("dust_density", "aerosol_density")
        setattr(node, name, value)
    return node


def by_cycles(samples=16):
    """The world as a panorama, +x in the middle, bottom row first."""
    scene = compare.use_cycles(2 * HEIGHT, HEIGHT, samples)
    camera = scenes.camera((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    camera.data.type = "PANO"
    place = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    place.panorama_type = "EQUIRECTANGULAR"
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = str(pathlib.Path(folder) / "around.exr")
        bpy.ops.render.render(write_still=True)
        return compare.read(scene.render.filepath)[::-1]


def shrunk(values):
    """A picture reduced to the resolution of Cycles'."""
    side = values.shape[0] // HEIGHT
    return values.reshape(HEIGHT, side, 2 * HEIGHT, side, 3).mean(axis=(1, 3))


def irradiance(values):
    """The integral over all directions."""
    latitudes = ((np.arange(HEIGHT) + 0.5) / HEIGHT - 0.5) * math.pi
    return (values * np.cos(latitudes)[:, None, None]).sum((0, 1)) * (math.pi / HEIGHT) ** 2


class Skies(unittest.TestCase):
    def check(self, node, mean=0.02, median=0.01, most=0.05):
        ours, theirs = shrunk(sky.picture(sky.sky_of(node))), by_cycles()
        ratio = irradiance(ours) / irradiance(theirs)
        off = np.abs(ours - theirs).max(-1) / np.maximum(theirs.max(-1), 1e-3 * theirs.max())
        # Rows at the horizon are as fine as Cycles' table there.
        above = off[HEIGHT // 2 + 1 :]
        line = f"mean {ratio}, half within {np.median(above):.4f}, 95 % within {np.quantile(above, 0.95):.4f}"
        print(f"sky {node.sky_type.lower()}: {line}", flush=True)
        np.testing.assert_allclose(ratio, 1.0, atol=mean, err_msg=line)
        self.assertLess(np.median(above), median, line)
        self.assertLess(np.quantile(above, 0.95), most, line)

    def test_air(self):
        for values in ({}, {"sun_elevation": 0.05}, {"sun_elevation": 0.8, "sun_rotation": 0.7}, {"altitude": 4000.0},
                       {"air_density": 2.0}, {"dust_density": 3.0}, {"ozone_density": 2.0}, {"sun_elevation": 1.57}):
            with self.subTest(values):
                self.check(around(**values))

    def test_sun(self):
        for elevation in (0.26, 0.8):
            with self.subTest(elevation=elevation):
                node = around(sun_elevation=elevation, sun_size=0.2, sun_disc=True, sun_intensity=0.5)
                ours, theirs = shrunk(sky.picture(sky.sky_of(node))), by_cycles(256)
                ratio = irradiance(ours) / irradiance(theirs)
                print(f"sun at {elevation}: {ratio}", flush=True)
                np.testing.assert_allclose(ratio, 1.0, atol=0.02)

    def test_small_sun(self):
        # A disc of half a degree keeps all of its light, whatever pixels it falls on.
        wide, small = (sky.Nishita(0.6, 0.3, 1.0, (1.0, 1.0, 1.0), 1.0, size) for size in (0.1, 0.00951))
        dark = sky.Nishita(0.6, 0.3, 1.0, (1.0, 1.0, 1.0))
        sums = [irradiance(shrunk(sky.picture(each)) - shrunk(sky.picture(dark))) for each in (wide, small)]
        np.testing.assert_allclose(sums[1], sums[0], rtol=0.02)

    def test_formula_of_preetham(self):
        for turbidity, direction in ((2.2, (0.3, 0.2, 0.5)), (6.0, (-0.5, 0.3, 0.1)), (3.0, (0.0, 0.0, 1.0))):
            with self.subTest(turbidity=turbidity):
                direction = np.array(direction) / np.linalg.norm(direction)
                self.check(around(sky_type="PREETHAM", turbidity=turbidity, sun_direction=direction),
                           mean=0.002, median=0.002, most=0.01)


class Worlds(unittest.TestCase):
    def room(self, **values):
        node = around(**values)
        scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
        scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))
        return node, bpy.context.scene.world.node_tree

    def test_an_image_all_around(self):
        for disc in (False, True):
            self.room(sun_disc=disc)
            scene, result = exported()
            self.assertEqual(result.left_out, [])
            (light,) = scene["lights"]
            self.assertEqual(light["type"], "environment")
            self.assertTrue(light["image"].endswith(".exr"))

    def test_what_nodes_make_of_it(self):
        node, tree = self.room()
        mix = tree.nodes.new("ShaderNodeMixRGB")
        tree.links.new(node.outputs[0], mix.inputs[1])
        tree.links.new(mix.outputs[0], scenes.background().inputs["Color"])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertIn("image", scene["lights"][0])

    def test_looked_up_by_other_directions(self):
        node, tree = self.room()
        where, stretched = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
        stretched.inputs["Scale"].default_value = (1.0, 1.0, 2.0)
        tree.links.new(where.outputs["Generated"], stretched.inputs["Vector"])
        tree.links.new(stretched.outputs["Vector"], node.inputs["Vector"])
        scene, result = exported()
        self.assertEqual(result.left_out, [])
        self.assertIn("texture", scene["lights"][0])

    def test_what_is_left_out(self):
        self.room(sky_type="HOSEK_WILKIE")
        scene, result = exported(bakes=False)
        line = "left out: node 'Sky Texture' of world 'World': the sky of Hosek and Wilkie"
        self.assertEqual(result.left_out, [line])

    @unittest.skipUnless(IS_NEW, "a sky of Blender 5")
    def test_sky_that_is_scattered_again(self):
        self.room(sky_type="MULTIPLE_SCATTERING")
        scene, result = exported(bakes=False)
        self.assertIn("more than once", *result.left_out)
        self.assertIn("image", scene["lights"][0])


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Compared(unittest.TestCase):
    def test_floor(self):
        for disc in (False, True):
            with self.subTest(disc=disc):
                around(sun_elevation=0.8, sun_rotation=0.7, sun_disc=disc, sun_intensity=0.05)
                compare.use_cycles()
                scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
                scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))
                scenes.cube("Box", 0.8, (0.3, 0.3, 0.4), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
                result = compare.check(self, f"sky{' with its sun' if disc else ''}", tolerance=0.02, blocks=2.0)
                self.assertEqual(result.left_out, [])


if __name__ == "__main__":
    unittest.main()
