"""F12: the render result is what the command renders, pixel by pixel."""

from __future__ import annotations

import unittest
from pathlib import Path

import harness
import bpy
import numpy as np


def saved(scene: bpy.types.Scene) -> dict[str, np.ndarray]:
    """Channels of Blender's file, by pass and channel; rows from the bottom."""
    data = Path(scene.render.filepath).read_bytes()
    channels = harness.module("exr").read(data)
    return {name.partition(".")[2]: pixels for name, pixels in channels.items()}


def rendered(scene: bpy.types.Scene) -> dict[str, np.ndarray]:
    """Renders a still."""
    bpy.ops.render.render(write_still=True)
    return saved(scene)


def by_blender(path: Path) -> np.ndarray:
    """R, G, B of an EXR without layers, as Blender itself reads it: rows from the bottom."""
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(height, width, image.channels)[..., :3]


def combined(channels: dict[str, np.ndarray]) -> np.ndarray:
    return np.stack([channels[f"Combined.{name}"] for name in "RGB"], axis=-1)


class Render(unittest.TestCase):
    def test_the_picture_is_that_of_the_command(self) -> None:
        scene = harness.lit_floor()
        ours = rendered(scene)
        folder = harness.folder()
        bpy.ops.export_scene.beamfarm(directory=str(folder))
        harness.command("render", folder / "scene.toml", "-o", folder / "a.exr", "--quiet")
        theirs = by_blender(folder / "a.exr")
        np.testing.assert_array_equal(combined(ours), theirs)
        self.assertTrue((ours["Combined.A"] == 1.0).all())
        # The lamp is at the upper left: rows are counted from the bottom.
        self.assertGreater(theirs[:, :, 1].max(), 0.0)
        top, left = np.unravel_index(theirs[:, :, 1].argmax(), theirs.shape[:2])
        self.assertGreater(top, 24)
        self.assertLess(left, 32)

    def test_what_is_in_edit_mode_is_in_the_picture(self) -> None:
        scene = harness.lit_floor()
        bpy.ops.mesh.primitive_cube_add(size=1.0)
        pictures = []
        for mode in ("OBJECT", "EDIT"):
            bpy.ops.object.mode_set(mode=mode)
            pictures.append(combined(rendered(scene)))
        np.testing.assert_array_equal(*pictures)
        self.assertEqual(harness.module("told").of(scene.name).left_out, [])

    def test_what_no_node_says_is_baked(self) -> None:
        scene = harness.lit_floor()
        floor = bpy.data.objects["floor"]
        made = bpy.data.materials.new("Wavelength")
        made.use_nodes = True
        tree = made.node_tree
        node = tree.nodes.new("ShaderNodeWavelength")
        # Green.
        node.inputs[0].default_value = 530.0
        tree.links.new(node.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
        floor.data.materials.append(made)
        channels = rendered(scene)
        told = harness.module("told").of(scene.name)
        self.assertEqual(told.left_out, [])
        self.assertTrue(any("is baked at" in line for line in told.notes), told.notes)
        self.assertGreater(channels["Combined.G"].mean(), 2.0 * channels["Combined.R"].mean())
        self.assertEqual(scene.render.engine, "BEAMFARM")

    def test_passes_hold_the_layers(self) -> None:
        scene = harness.lit_floor()
        view_layer = bpy.context.view_layer
        view_layer.use_pass_z = view_layer.use_pass_normal = True
        for name in ("denoising", "direct", "indirect", "volume", "standard_error"):
            setattr(view_layer.beamfarm, f"use_{name}", True)
        channels = rendered(scene)
        expected = {
            *(f"Combined.{name}" for name in "RGBA"),
            "Depth.Z",
            *(f"{name}.{channel}" for name in ("Normal", "Denoising Normal") for channel in "XYZ"),
            *(
                f"{name}.{channel}"
                for name in ("Denoising Albedo", "Direct", "Indirect", "Volume", "Standard Error")
                for channel in "RGB"
            ),
        }
        self.assertEqual(set(channels), expected)
        # The camera is 6 above the floor and looks straight down on it.
        np.testing.assert_allclose(channels["Depth.Z"], 6.0, rtol=1e-5)
        np.testing.assert_allclose(channels["Normal.Z"], 1.0, rtol=1e-5)
        # A sum of three in single precision.
        parts = sum(channels[f"{name}.G"] for name in ("Direct", "Indirect", "Volume"))
        np.testing.assert_allclose(channels["Combined.G"], parts, rtol=1e-5, atol=1e-7)
        self.assertGreater(channels["Standard Error.G"].max(), 0.0)

    def test_alpha_is_what_covers_the_pixel(self) -> None:
        scene = harness.lit_floor()
        scene.render.film_transparent = True
        scene.camera.location.z = 20.0
        channels = rendered(scene)
        alpha = channels["Combined.A"]
        # A floor of 8 x 8 from 20 above: 0.4 of 36 mm with a lens of 50 mm, on 64 pixels.
        self.assertAlmostEqual(alpha.sum(), (64 * 0.4 * 50.0 / 36.0) ** 2, delta=8.0)
        self.assertEqual((alpha.min(), alpha.max()), (0.0, 1.0))
        self.assertEqual(channels["Combined.G"][alpha == 0.0].max(), 0.0)

    def test_cryptomattes_are_masks_in_the_compositor(self) -> None:
        scene = harness.lit_floor()
        scene.camera.location.z = 20.0
        view_layer = bpy.context.view_layer
        view_layer.use_pass_cryptomatte_object = view_layer.use_pass_cryptomatte_material = True
        view_layer.pass_cryptomatte_depth = 4
        channels = rendered(scene)
        crypto = {name.partition(".")[0] for name in channels if name.startswith("Crypto")}
        self.assertEqual(crypto, {f"Crypto{kind}0{number}" for kind in ("Object", "Material") for number in (0, 1)})
        coverage = channels["CryptoObject00.G"]
        self.assertAlmostEqual(coverage.sum(), (64 * 0.4 * 50.0 / 36.0) ** 2, delta=8.0)
        if hasattr(scene, "compositing_node_group"):
            self.skipTest("the compositor of Blender 5.0 and later has other sockets")
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        matte = tree.nodes.new("CompositorNodeCryptomatteV2")
        matte.scene, matte.source = scene, "RENDER"
        matte.layer_name = "ViewLayer.CryptoObject"
        matte.matte_id = "floor"
        output = tree.nodes.new("CompositorNodeComposite")
        tree.links.new(matte.outputs["Matte"], output.inputs["Image"])
        bpy.ops.render.render(write_still=True)
        masked = harness.module("exr").read(Path(scene.render.filepath).read_bytes())["Composite.Combined.R"]
        np.testing.assert_allclose(masked, coverage, atol=1e-3)

    def test_passes_have_sockets_in_the_compositor(self) -> None:
        scene = harness.lit_floor()
        bpy.context.view_layer.beamfarm.use_volume = True
        if hasattr(scene, "compositing_node_group"):
            # Blender 5.0 and later.
            tree = scene.compositing_node_group = bpy.data.node_groups.new("tree", "CompositorNodeTree")
        else:
            scene.use_nodes = True
            tree = scene.node_tree
        node = tree.nodes.new("CompositorNodeRLayers")
        rendered(scene)
        enabled = {socket.name for socket in node.outputs if socket.enabled}
        self.assertLessEqual({"Image", "Volume"}, enabled)

    def test_a_light_group_is_what_its_lights_give(self) -> None:
        scene = harness.lit_floor()
        view_layer = bpy.context.view_layer
        bpy.ops.object.light_add(type="POINT", location=(1.5, -1.0, 1.0))
        for name, object_name in (("key light!", "lamp"), ("fill", bpy.context.object.name)):
            view_layer.lightgroups.add(name=name)
            bpy.data.objects[object_name].lightgroup = name
        view_layer.lightgroups.add(name="nobody")
        channels = rendered(scene)
        groups = [channels[f"Combined_{name}.G"] for name in ("key light!", "fill", "nobody")]
        self.assertGreater(groups[0].max(), 0.0)
        self.assertGreater(groups[1].max(), 0.0)
        self.assertEqual(groups[2].max(), 0.0)
        np.testing.assert_allclose(channels["Combined.G"], groups[0] + groups[1], rtol=1e-5, atol=1e-7)

    def test_a_region_has_the_pixels_of_the_whole(self) -> None:
        scene = harness.lit_floor((50, 30))
        whole = combined(rendered(scene))
        render = scene.render
        render.use_border = True
        render.border_min_x, render.border_max_x = 0.1, 0.62
        render.border_min_y, render.border_max_y = 0.3, 0.9
        inside = combined(rendered(scene))
        self.assertEqual(inside.shape, whole.shape)
        window = np.zeros(whole.shape[:2], bool)
        window[9:27, 5:31] = True
        self.assertEqual(abs(inside[~window]).max(), 0.0)
        render.use_crop_to_border = True
        cropped = combined(rendered(scene))
        np.testing.assert_array_equal(cropped, inside[9:27, 5:31])
        # The window has its own random numbers: it is the right one if no other window is as near.
        far = {
            (x, y): np.square(cropped - whole[9 + y : 27 + y, 5 + x : 31 + x]).mean()
            for x in (-1, 0, 1)
            for y in (-1, 0, 1)
        }
        self.assertEqual(min(far, key=far.get), (0, 0))
        np.testing.assert_allclose(cropped, whole[9:27, 5:31], rtol=0.1)

    def test_percentages_are_of_the_size(self) -> None:
        scene = harness.lit_floor((65, 33))
        scene.render.resolution_percentage = 50
        self.assertEqual(combined(rendered(scene)).shape, (16, 32, 3))

    def test_any_region_has_the_size_that_blender_gives_it(self) -> None:
        scene = harness.lit_floor((97, 61))
        scene.beamfarm.passes, scene.beamfarm.paths = 1, 10
        scene.render.use_border = scene.render.use_crop_to_border = True
        random = np.random.default_rng(1)
        for _ in range(6):
            x, y = sorted(random.random(2)), sorted(random.random(2))
            scene.render.border_min_x, scene.render.border_max_x = x
            scene.render.border_min_y, scene.render.border_max_y = y
            width, height = harness.module("frame").of_scene(scene).size
            self.assertEqual(combined(rendered(scene)).shape, (height, width, 3))

    def test_every_view_layer_is_rendered(self) -> None:
        scene = harness.lit_floor()
        other = scene.view_layers.new("other")
        other.use_pass_z = True
        bpy.context.view_layer.use_pass_z = False
        bpy.ops.render.render(write_still=True)
        names = harness.module("exr").read(Path(scene.render.filepath).read_bytes()).keys()
        self.assertIn("ViewLayer.Combined.R", names)
        self.assertIn("other.Combined.R", names)
        self.assertIn("other.Depth.Z", names)
        self.assertNotIn("ViewLayer.Depth.Z", names)

    def test_an_animation_moves(self) -> None:
        scene = harness.lit_floor((32, 24))
        scene.frame_start, scene.frame_end = 1, 2
        lamp = bpy.data.objects["lamp"]
        lamp.keyframe_insert("location", frame=1)
        lamp.location.x = 1.2
        lamp.keyframe_insert("location", frame=2)
        folder = harness.folder()
        scene.render.filepath = str(folder / "frame_")
        bpy.ops.render.render(animation=True)
        files = sorted(folder.iterdir())
        self.assertEqual([file.name for file in files], ["frame_0001.exr", "frame_0002.exr"])
        frames = [harness.module("exr").read(file.read_bytes())["ViewLayer.Combined.G"] for file in files]
        columns = [int(pixels.sum(axis=0).argmax()) for pixels in frames]
        self.assertLess(columns[0], 16)
        self.assertGreater(columns[1], 16)

    def test_an_animation_has_motion_blur(self) -> None:
        scene = harness.lit_floor((32, 24))
        scene.frame_start, scene.frame_end = 1, 3
        lamp = bpy.data.objects["lamp"]
        lamp.keyframe_insert("location", frame=1)
        lamp.location.x = 1.2
        lamp.keyframe_insert("location", frame=3)
        folder = harness.folder()
        scene.render.filepath = str(folder / "sharp_")
        bpy.ops.render.render(animation=True)
        scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, 0.8
        scene.render.filepath = str(folder / "blurred_")
        bpy.ops.render.render(animation=True)
        self.assertEqual(len(list(folder.iterdir())), 6)

        def picture(name: str, number: int) -> np.ndarray:
            channels = harness.module("exr").read((folder / f"{name}_{number:04}.exr").read_bytes())
            return np.stack([channels[f"ViewLayer.Combined.{channel}"] for channel in "RGB"], axis=-1)

        for number in (1, 2, 3):
            scene.frame_set(number)
            bpy.ops.export_scene.beamfarm(directory=str(folder / "scene"))
            self.assertEqual(scene.frame_current_final, number)
            text = (folder / "scene" / "scene.toml").read_text()
            self.assertIn(f"frame = {number}\n", text)
            output = folder / "scene" / "a.exr"
            harness.command("render", folder / "scene" / "scene.toml", "-o", output, "--quiet")
            np.testing.assert_array_equal(picture("blurred", number), by_blender(output))
            self.assertGreater(abs(picture("blurred", number) - picture("sharp", number)).max(), 0.0)
        bpy.ops.export_scene.beamfarm(directory=str(folder / "all"), all_frames=True)
        self.assertIn("frames = [1, 3]", (folder / "all" / "scene.toml").read_text())

    def test_what_moves_the_camera_counts(self) -> None:
        scene = harness.lit_floor((32, 24))
        bpy.context.view_layer.use_pass_z = True
        bpy.ops.object.empty_add()
        scene.camera.parent = bpy.context.object
        bpy.context.object.keyframe_insert("location", frame=1)
        bpy.context.object.location.z = 3.0
        bpy.context.object.keyframe_insert("location", frame=2)
        scene.beamfarm.keyframe_insert("passes", frame=1)
        scene.beamfarm.passes = 2
        scene.beamfarm.keyframe_insert("passes", frame=2)
        scene.frame_start, scene.frame_end = 1, 2
        folder = harness.folder()
        scene.render.filepath = str(folder / "frame_")
        bpy.ops.render.render(animation=True)
        for number, depth in ((1, 6.0), (2, 9.0)):
            data = (folder / f"frame_{number:04}.exr").read_bytes()
            np.testing.assert_allclose(harness.module("exr").read(data)["ViewLayer.Depth.Z"], depth, rtol=1e-5)

    def test_stereoscopy_is_refused(self) -> None:
        harness.lit_floor().render.use_multiview = True
        with self.assertRaisesRegex(RuntimeError, "Stereoscopy"):
            bpy.ops.render.render()


if __name__ == "__main__":
    unittest.main()
