"""Serving farms and connecting to them."""

from __future__ import annotations

import time
import unittest

import beamfarm
import numpy as np
from common import FOG

PATIENCE = 120.0


class Farms(unittest.TestCase):
    def test_a_farm_that_is_served_renders_the_same_bits(self) -> None:
        expected = beamfarm.render(FOG, passes=6, progress=False)
        with beamfarm.serve(FOG, passes=6, workers=2, threads=1) as farm:
            self.assertIn("127.0.0.1", farm.url)
            pixels = farm.wait(timeout=PATIENCE)
        np.testing.assert_array_equal(pixels, expected.beauty)

    def test_a_job_is_steered(self) -> None:
        with beamfarm.serve(FOG, passes=10**6, workers=1, threads=1) as served:
            farm = beamfarm.connect(served.url, token=served.token)
            end = time.monotonic() + PATIENCE
            while farm.status()["prefix"] < 2:
                self.assertLess(time.monotonic(), end)
                time.sleep(0.02)
            self.assertEqual(farm.status()["state"], "running")
            farm.pause()
            self.assertEqual(farm.status()["state"], "paused")
            farm.resume()
            farm.extend(2 * 10**6)
            self.assertEqual(farm.status()["limit"], 2 * 10**6)
            self.assertEqual(farm.image().shape, (32, 48, 3))
            self.assertEqual(farm.exr()[:4], b"\x76\x2f\x31\x01")
            with self.assertRaises(TimeoutError):
                served.wait(timeout=0.1)
            with self.assertRaises(beamfarm.FarmError):
                beamfarm.connect(served.url, token="0" * 32).status()
            with self.assertRaises(beamfarm.FarmError):
                beamfarm.connect(served.url, token="0" * 32).exr()
            with self.assertRaises(beamfarm.ArgumentError):
                farm.extend(0)
            farm.cancel()
            self.assertEqual(served.wait(timeout=PATIENCE).shape, (32, 48, 3))

    def test_what_goes_wrong(self) -> None:
        with self.assertRaises(beamfarm.SceneError):
            beamfarm.serve({"image": {"width": 3}})
        with self.assertRaises(beamfarm.RenderError) as caught:
            beamfarm.serve(FOG, listen="192.0.2.1:1")
        self.assertIn("192.0.2.1", str(caught.exception))
        with self.assertRaises(beamfarm.FarmError):
            beamfarm.connect("http://127.0.0.1:1").status()
        with self.assertRaises(beamfarm.ArgumentError):
            beamfarm.connect("ftp://example.org").status()


if __name__ == "__main__":
    unittest.main()
