"""What the renderer's tests hold texture graphs against is what this Blender makes of them. Takes no renderer."""

import json
import unittest

import compare
import nodes
import numpy as np

KEPT = compare.ROOT / "tests" / "tests" / "surfaces" / "nodes.json"


class Nodes(unittest.TestCase):
    def test_values_are_those_of_cycles(self):
        cases = nodes.cases_of()
        nodes.values_of(cases)
        kept, made = json.loads(KEPT.read_text(encoding="utf-8")), json.loads(nodes.thinned(cases))
        self.assertEqual([case["name"] for case in kept], [case["name"] for case in made])
        for ours, theirs in zip(kept, made):
            with self.subTest(case=ours["name"]):
                self.assertEqual({**ours, "values": 0}, {**theirs, "values": 0})
                np.testing.assert_allclose(_rows(ours), _rows(theirs), rtol=1e-4, atol=1e-5)


def _rows(case):
    return [row if isinstance(row, list) else [row] * 3 for row in case["values"]]


if __name__ == "__main__":
    unittest.main()
