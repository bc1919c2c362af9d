"""Meshes, grids and images from numpy arrays, against their expected pictures."""

from __future__ import annotations

import math
import unittest
from collections.abc import Callable

import beamfarm
import numpy as np
from common import view

CORNERS = [[-1, -1, 0.5], [1, -1, 0.5], [1, 1, 0.5], [-1, 1, 0.5]]


class Arrays(unittest.TestCase):
    def test_a_mesh_lies_where_its_vertices_do(self) -> None:
        """A slanted square of 4 vertices: the depth of each pixel is linear in x."""
        corners = np.array([[-1, -1, 0], [1, -1, 2], [1, 1, 2], [-1, 1, 0]])
        for vertices, faces in (
            (corners.astype(np.float32), np.array([[0, 1, 2, 3]], np.uint8)),
            (corners, np.array([[0, 1, 2], [0, 2, 3]])),
            # A view of every second row, and integers.
            (np.repeat(corners.astype(np.int16), 2, axis=0)[::2], np.array([[0, 1, 2], [0, 2, 3]], np.int32)),
        ):
            scene = beamfarm.Scene(view())
            scene["shapes"] = [{"type": "mesh", "file": beamfarm.Mesh(vertices, faces)}]
            image = beamfarm.pass_image(scene, 0, layers=["depth"])
            x = (np.arange(32) + 0.5) / 16 - 1
            expected = np.broadcast_to(10 - (1 + x), (32, 32))
            # Rays pass anywhere within a pixel, at most half a pixel from its centre.
            np.testing.assert_allclose(image.layers["depth"], expected, atol=1 / 32 + 1e-5)
            self.assertAlmostEqual(float(image.layers["depth"].mean()), 9.0, delta=0.01)

    def test_normals_and_colours_of_vertices(self) -> None:
        tilted = np.tile(np.array([0.6, 0.0, 0.8], np.float32), (4, 1))
        colours = np.array([[0.1, 0.2, 0.3]] * 4)
        mesh = beamfarm.Mesh(CORNERS, [[0, 1, 2, 3]], normals=tilted, colors=colours)
        scene = beamfarm.Scene(view(8, 8))
        scene["materials"] = {"own": {"type": "diffuse", "reflectance": {"attribute": "color"}}}
        scene["shapes"] = [{"type": "mesh", "file": mesh, "material": "own"}]
        image = beamfarm.pass_image(scene, 0, layers=["normal", "albedo"])
        np.testing.assert_allclose(image.layers["normal"], np.broadcast_to([0.6, 0.0, 0.8], (8, 8, 3)), atol=1e-6)
        np.testing.assert_allclose(image.layers["albedo"], np.broadcast_to([0.1, 0.2, 0.3], (8, 8, 3)), atol=1e-6)

    def test_the_first_row_of_a_texture_is_on_top(self) -> None:
        pixels = np.zeros((2, 2, 3), np.float32)
        pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1] = (0.9, 0, 0), (0, 0.8, 0), (0, 0, 0.7), (0.6, 0.6, 0.6)
        scene = beamfarm.Scene(view(2, 2))
        texture = {"image": beamfarm.Texture(pixels), "filter": "nearest"}
        scene["materials"] = {"own": {"type": "diffuse", "reflectance": texture}}
        scene["shapes"] = [{"type": "rectangle", "material": "own"}]
        image = beamfarm.pass_image(scene, 0, layers=["albedo"])
        np.testing.assert_allclose(image.layers["albedo"], pixels, atol=2e-3)

    def test_a_grid_absorbs_where_its_samples_are(self) -> None:
        """A wall of radiance 1 behind a medium of 4 x 3 x 2 samples: exp(-optical depth) of it is seen."""
        values = np.zeros((2, 3, 4), np.float32)
        # Left, top, and near the camera.
        values[1, 2, 0] = 1.0
        scene = beamfarm.Scene(view(48, 48))
        scene["media"] = {
            "ink": {
                "type": "heterogeneous",
                "sigma_a": 1.0,
                "sigma_s": 0.0,
                "density": {"file": beamfarm.Grid(values)},
                "transform": [{"translate": [-0.5, -0.5, 0]}, {"scale": 2.0}],
            }
        }
        scene["world"] = {"medium": "ink"}
        scene["shapes"] = [
            {
                "type": "rectangle",
                "transform": [{"translate": [0, 0, -0.5]}],
                "emission": {"radiance": 1.0},
            }
        ]
        scene["lights"] = []
        count = 64
        passes = beamfarm.Passes(scene)
        image = beamfarm.average(passes[i] for i in range(count))
        seen = image.beauty[..., 0].astype(np.float64)
        # Samples lie at the centres of the grid's cells; the outermost ones extend to the border.
        x = np.clip(((np.arange(48) + 0.5) / 48) * 4 - 0.5, 0, 3)
        y = np.clip(((47.5 - np.arange(48)) / 48) * 3 - 0.5, 0, 2)
        across = np.clip(1 - x, 0, 1)[None, :] * np.clip(y - 1, 0, 1)[:, None]
        z = np.clip((np.arange(1000) + 0.5) / 1000 * 2 - 0.5, 0, 1)
        depth = 2.0 * across * z.mean()
        expected = np.exp(-depth)
        # Means over blocks, which noise and the position within a pixel hardly change: four standard errors of each,
        # and 0.002 for the curvature of the exponential over a pixel.
        blocks = seen.reshape(8, 6, 8, 6).mean((1, 3)), expected.reshape(8, 6, 8, 6).mean((1, 3))
        error = np.sqrt((image.stderr[..., 0].astype(np.float64) ** 2).reshape(8, 6, 8, 6).sum((1, 3))) / 36
        self.assertTrue((np.abs(blocks[0] - blocks[1]) <= 4.5 * error + 0.002).all(), np.abs(blocks[0] - blocks[1]).max())
        self.assertLess(seen[4, 4], 0.4)
        self.assertGreater(seen[4, 40], 0.999)

    def test_what_came_and_what_was_expected(self) -> None:
        triangle = [[0, 1, 2]]
        cases: list[tuple[Callable[[], object], str, str, str]] = [
            (lambda: beamfarm.Mesh(np.zeros((3, 4)), triangle), "vertices", "(N, 3)", "(3, 4) of float64"),
            (lambda: beamfarm.Mesh(np.zeros((4, 3), complex), triangle), "vertices", "real", "complex128"),
            (lambda: beamfarm.Mesh(CORNERS, [[0.0, 1.0, 2.0]]), "faces", "integers", "float64"),
            (lambda: beamfarm.Mesh(CORNERS, [[0, 1]]), "faces", "(M, 3) or (M, 4)", "(1, 2)"),
            (lambda: beamfarm.Mesh(CORNERS, [[0, 1, 4]]), "faces", "0 to 3", "0 to 4"),
            (lambda: beamfarm.Mesh(CORNERS, [[0, 1, -1]]), "faces", "0 to 3", "-1 to 1"),
            (lambda: beamfarm.Mesh(CORNERS, triangle, uvs=np.zeros((3, 2))), "uvs", "each of 4", "found 3"),
            (lambda: beamfarm.Mesh(CORNERS, triangle, normals=np.zeros((4, 2))), "normals", "(N, 3)", "(4, 2)"),
            (lambda: beamfarm.Mesh([[0, 0, math.nan]] * 3, triangle), "vertices", "finite", "NaN"),
            (lambda: beamfarm.Grid(np.zeros((4, 4))), "values", "(depth, height, width)", "(4, 4)"),
            (lambda: beamfarm.Grid(np.zeros((4, 4, 4, 2))), "values", "width, 3)", "(4, 4, 4, 2)"),
            (lambda: beamfarm.Grid(np.zeros((0, 4, 4))), "values", "shape", "(0, 4, 4)"),
            (lambda: beamfarm.Grid(np.full((2, 2, 2), np.inf)), "values", "finite", "infinity"),
            (lambda: beamfarm.Texture(np.zeros((2, 2, 4))), "pixels", "(height, width, 3)", "(2, 2, 4)"),
            (lambda: beamfarm.Texture(np.array([["a"]])), "pixels", "real", "<U1"),
        ]
        for make, *words in cases:
            with self.assertRaises(beamfarm.ArgumentError) as caught:
                make()
            for word in words:
                self.assertIn(word, str(caught.exception))


if __name__ == "__main__":
    unittest.main()
