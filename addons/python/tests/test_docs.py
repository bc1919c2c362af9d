"""Runs the code of the documents as it stands."""

from __future__ import annotations

import contextlib
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

@contextlib.contextmanager
def in_folder_of_scenes() -> Any:
    """A writable folder with the scenes of the repository."""
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


if __name__ == "__main__":
    unittest.main()
