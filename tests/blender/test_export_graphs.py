"""Node trees that become texture graphs of the scene file."""

import unittest

import bpy
import compare
import nodes
import numpy as np
import scenes
from test_export_text import exported, room


class Nodes(unittest.TestCase):
    """Every node, with its options: what is written gives the same values when it is built anew."""

    def test_graphs_are_what_they_were(self):
        cases = nodes.cases_of()
        nodes.values_of(cases)
        again = []
        for first in range(0, len(cases), 64):
            some = cases[first : first + 64]
            nodes.lay_out(some)
            scenes.camera((0.0, 0.0, 9.0), (0.0, 0.0, 0.0))
            scene, result = exported()
            self.assertEqual(result.left_out, [])
            for case, shape in zip(some, scene["shapes"]):
                table = dict(shape["emission"]["radiance"])
                if "checkerboard" in table:
                    # An attribute in the place of UV.
                    continue
                self.assertIn("texture", table, case["name"])
                again.append({**case, "texture": table, "output": None, "textures": scene["textures"]})
        nodes.values_of(again)
        self.assertGreater(len(again), 850)
        known = {case["name"]: case for case in cases}
        for after in again:
            before = known[after["name"]]
            with self.subTest(case=before["name"]):
                np.testing.assert_allclose(after["values"], before["values"], rtol=1e-4, atol=1e-4)
