"""The reader of EXR files, against what Blender writes and against damaged files."""

from __future__ import annotations

import contextlib
import unittest

import harness
import bpy
import numpy as np

harness.install()
exr = harness.module("exr")


def written(pixels: np.ndarray, codec: str) -> bytes:
    """An EXR of these pixels, rows from the bottom, by Blender."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("of a test", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    scene = bpy.context.scene
    settings = scene.render.image_settings
    settings.file_format, settings.color_depth = "OPEN_EXR", "32"
    settings.color_mode, settings.exr_codec = "RGBA", codec
    scene.view_settings.view_transform = "Raw"
    path = harness.folder() / "a.exr"
    image.save_render(str(path), scene=scene)
    bpy.data.images.remove(image)
    return path.read_bytes()


class Exr(unittest.TestCase):
    def test_what_blender_writes_is_read(self) -> None:
        random = np.random.default_rng(3)
        for width, height in ((1, 1), (7, 16), (33, 17), (64, 48)):
            pixels = random.lognormal(0.0, 3.0, (height, width, 4)).astype(np.float32)
            # Alpha of one: nothing is multiplied by it. Rows that compress, and some that do not.
            pixels[..., 3] = 1.0
            pixels[: height // 2] = np.round(pixels[: height // 2])
            for codec in ("NONE", "ZIP", "ZIPS"):
                channels = exr.read(written(pixels, codec))
                self.assertEqual(set(channels), set("RGBA"))
                for place, name in enumerate("RGBA"):
                    np.testing.assert_array_equal(channels[name], pixels[..., place], f"{width}x{height} {codec}")

    def test_only_what_is_wanted(self) -> None:
        data = written(np.ones((3, 5, 4), np.float32), "ZIP")
        self.assertEqual(set(exr.read(data, {"G", "none"})), {"G"})
        self.assertIsNone(exr.passes(data))

    def test_damage_is_an_error(self) -> None:
        pixels = np.random.default_rng(4).random((20, 20, 4)).astype(np.float32)
        data = written(pixels, "ZIP")
        random = np.random.default_rng(5)
        for length in random.integers(0, len(data), 200):
            with self.assertRaises(exr.ExrError):
                exr.read(data[:length])
        for _ in range(500):
            harmed = bytearray(data)
            for place in random.integers(0, len(data), 3):
                harmed[place] = random.integers(256)
            with contextlib.suppress(exr.ExrError):
                exr.read(bytes(harmed))
        for other in (b"", b"PNG", data[:4] + b"\x02\x02\0\0" + data[8:]):
            with self.assertRaises(exr.ExrError):
                exr.read(other)


if __name__ == "__main__":
    unittest.main()
