"""The lines of the documents, run as they stand there, and the notebooks."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import re
import subprocess
import sys
import tempfile
import unittest
import warnings
from pathlib import Path
from typing import Any

from common import TOP

HAS_NOTEBOOKS = all(importlib.util.find_spec(name) for name in ("nbclient", "ipykernel", "matplotlib"))


@contextlib.contextmanager
def in_folder_of_scenes() -> Any:
    """A folder that has the scenes of the repository, and may be filled."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "scenes").symlink_to(TOP / "scenes")
        os.chdir(folder)
        try:
            yield Path(folder)
        finally:
            os.chdir(before)


class Documents(unittest.TestCase):
    def test_examples_run(self) -> None:
        for page in (TOP / "docs" / "python.md", TOP / "addons" / "python" / "README.md", TOP / "README.md"):
            text = page.read_text(encoding="utf-8")
            blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
            self.assertTrue(blocks, page)
            names: dict[str, Any] = {"__name__": "example"}
            with in_folder_of_scenes(), contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                for block in blocks:
                    exec(compile(block, str(page), "exec"), names)

    def test_the_page_is_that_of_the_docstrings(self) -> None:
        done = subprocess.run(
            [sys.executable, TOP / "addons" / "python" / "reference.py", "--check"],
            capture_output=True,
            text=True,
            check=False,
        )
        self.assertEqual(done.returncode, 0, done.stderr)

    @unittest.skipUnless(HAS_NOTEBOOKS, "nbclient, ipykernel or matplotlib is not installed")
    def test_notebooks_run_and_are_small(self) -> None:
        import nbclient
        import nbformat

        notebooks = sorted((TOP / "docs" / "notebooks").glob("*.ipynb"))
        self.assertEqual(len(notebooks), 6)
        for path in notebooks:
            self.assertLess(path.stat().st_size, 200_000, path)
            notebook = nbformat.read(path, as_version=4)
            nbformat.validate(notebook)
            client = nbclient.NotebookClient(
                notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(path.parent)}}
            )
            with self.subTest(path.name):
                client.execute()


if __name__ == "__main__":
    unittest.main()
