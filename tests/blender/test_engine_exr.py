"""The reader of EXR files, against what Blender writes and against damaged files."""

from __future__ import annotations

import contextlib
import struct
import tracemalloc
import unittest
import zlib

import harness
import bpy
import numpy as np

harness.install()
exr = harness.module("exr")


def written(pixels: np.ndarray, codec: str) -> bytes:
    """An EXR of these pixels, rows from the bottom, written by Blender."""
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
            # Alpha is one, so nothing is multiplied by it. Some rows compress, and some do not.
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

    def test_bombs_are_refused_before_they_are_unpacked(self) -> None:
        def bomb(width: int, height: int, channels: int, blocks: bytes, table: bool = True) -> bytes:
            def attribute(name: str, kind: str, value: bytes) -> bytes:
                return f"{name}\0{kind}\0".encode() + struct.pack("<i", len(value)) + value

            names = b"".join(b"%04d\0" % i + struct.pack("<i4s2i", 2, b"", 1, 1) for i in range(channels))
            head = struct.pack("<II", 20000630, 2)
            head += attribute("dataWindow", "box2i", struct.pack("<4i", 0, 0, width - 1, height - 1))
            head += attribute("compression", "compression", b"\3")
            head += attribute("channels", "chlist", names + b"\0") + b"\0"
            offsets = [len(head) + 8 * -(-height // 16)] * -(-height // 16)
            return head + struct.pack(f"<{len(offsets)}Q", *offsets) + blocks if table else head

        packed = zlib.compress(bytes(1 << 28), 9)
        block = struct.pack("<ii", 0, len(packed)) + packed
        begun = tracemalloc.start() or tracemalloc.get_traced_memory()[0]
        for data in (
            # A block that unpacks to much more data than its rows have.
            bomb(8, 8, 4, block),
            # More pixels than the file can hold.
            bomb(1 << 14, 1 << 14, 4, b""),
            bomb(1 << 14, 1 << 14, 1000, block),
        ):
            with self.assertRaises(exr.ExrError):
                exr.read(data)
        self.assertLess(tracemalloc.get_traced_memory()[1] - begun, 1 << 25)
        tracemalloc.stop()

    def test_damaged_heads_are_errors(self) -> None:
        data = written(np.ones((3, 5, 4), np.float32), "ZIP")
        for length in range(data.index(b"\0\0", 8) + 400):
            for look in (exr.passes, exr.manifests):
                with contextlib.suppress(exr.ExrError):
                    look(data[:length])

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
