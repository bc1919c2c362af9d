"""The command ``beamfarm`` that comes with the package."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from .errors import BeamfarmError

__all__ = ["program"]

_NAME = "beamfarm.exe" if os.name == "nt" else "beamfarm"


def program() -> Path:
    """The command's path: the one in ``BEAMFARM_PROGRAM``, or else the package's own."""
    asked = os.environ.get("BEAMFARM_PROGRAM")
    path = Path(asked) if asked else Path(__file__).with_name("bin") / _NAME
    if not path.is_file():
        raise BeamfarmError(f"{path}: the command beamfarm is not there: was the package installed whole?")
    if not os.access(path, os.X_OK):
        try:
            path.chmod(0o755)
        except OSError as error:
            raise BeamfarmError(f"{path} may not be executed: {error}") from error
    return path


def _become(arguments: list[str]) -> None:
    try:
        path = program()
    except BeamfarmError as error:
        sys.exit(f"error: {error}")
    if os.name == "nt":
        sys.exit(subprocess.call([path, *arguments]))
    os.execv(path, [str(path), *arguments])


def main() -> None:
    """``beamfarm``"""
    _become(sys.argv[1:])


def worker() -> None:
    """``beamfarm-worker``"""
    arguments = sys.argv[1:]
    # The command answers this itself.
    is_version = arguments in (["--version"], ["-V"])
    _become(arguments if is_version else ["worker", *arguments])
