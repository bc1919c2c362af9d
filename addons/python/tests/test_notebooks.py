"""Runs the notebooks from the first cell to the last."""

from __future__ import annotations

import importlib.util
import os
import unittest

from common import TOP

HAS_NOTEBOOKS = all(importlib.util.find_spec(name) for name in ("nbclient", "ipykernel", "matplotlib"))

# The others take a minute on two cores: with BEAMFARM_LONG in the environment they run as well.
QUICK = ("error", "first-picture", "smoke-from-numpy")


class Notebooks(unittest.TestCase):
    @unittest.skipUnless(HAS_NOTEBOOKS, "nbclient, ipykernel or matplotlib is not installed")
    def test_notebooks_run_and_are_small(self) -> None:
        import nbclient
        import nbformat

        notebooks = sorted((TOP / "docs" / "notebooks").glob("*.ipynb"))
        self.assertEqual(len(notebooks), 6)
        for path in notebooks:
            self.assertLess(path.stat().st_size, 200_000, path)
            notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call, unused-ignore]
            nbformat.validate(notebook)
            if path.stem not in QUICK and not os.environ.get("BEAMFARM_LONG"):
                continue
            client = nbclient.NotebookClient(
                notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}}
            )
            with self.subTest(path.name):
                client.execute()


if __name__ == "__main__":
    unittest.main()
