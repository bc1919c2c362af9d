"""The renderer's test data for texture graphs are this Blender's values, and the add-on exports the nodes so that the
graphs stay the same. No renderer is needed."""

import json
import unittest

import bpy
import compare
import nodes
import numpy as np
import scenes
from test_export_text import exported

KEPT = compare.ROOT / "shared" / "scene" / "src" / "assemble" / "texture" / "graph"
FILE = KEPT / ("nodes.json" if bpy.app.version >= (5, 0, 0) else "nodes-4.json")


class Nodes(unittest.TestCase):
    def test_values_are_those_of_cycles(self):
        cases = nodes.cases_of()
        nodes.values_of(cases)
        kept, made = json.loads(FILE.read_text(encoding="utf-8")), json.loads(nodes.thinned(cases))
        self.assertEqual(kept["sets"], made["sets"])
        self.assertEqual([case["name"] for case in kept["cases"]], [case["name"] for case in made["cases"]])
        for ours, theirs in zip(kept["cases"], made["cases"]):
            with self.subTest(case=ours["name"]):
                self.assertEqual({**ours, "values": 0}, {**theirs, "values": 0})
                np.testing.assert_allclose(_rows(ours), _rows(theirs), rtol=1e-4, atol=2e-4)

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
                    # An attribute in place of UV.
                    continue
                self.assertIn("texture", table, case["name"])
                again.append({**case, "texture": table, "output": None, "textures": scene["textures"]})
        nodes.values_of(again)
        self.assertGreater(len(again), len(cases) - 10)
        known = {case["name"]: case for case in cases}
        for after in again:
            before = known[after["name"]]
            with self.subTest(case=before["name"]):
                np.testing.assert_allclose(after["values"], before["values"], rtol=1e-4, atol=1e-4)


def _rows(case):
    return [row if isinstance(row, list) else [row] * 3 for row in case["values"]]


if __name__ == "__main__":
    unittest.main()
