"""Where the command `beamfarm` is, and whether it is one that this add-on can talk to."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

# Major and minor version of the command that the add-on is made for. Scene files and options of another one may differ.
MADE_FOR = (0, 2)

WAY_OUT = "Set its path in Preferences > Add-ons > beamfarm, or put it into a folder of PATH"

# Versions by path, time of writing and size, so that a still frame does not start the program twice.
_known: dict[tuple[str, float, int], str] = {}


class ProgramError(Exception):
    """The command cannot be used; the text says why, and what to do."""


def find(asked: str) -> Path:
    """The command at `asked`, which may begin with `~`, or where that is empty the one of PATH."""
    if asked:
        path = Path(os.path.expandvars(asked)).expanduser()
        if path.is_dir():
            path = path / ("beamfarm.exe" if os.name == "nt" else "beamfarm")
        if not path.is_file():
            raise ProgramError(f"There is no program at {path}. {WAY_OUT}")
        if not os.access(path, os.X_OK):
            raise ProgramError(f"{path} may not be executed. {WAY_OUT}")
        return path
    found = shutil.which("beamfarm")
    if found is None:
        raise ProgramError(f"The program beamfarm was not found in PATH. {WAY_OUT}")
    return Path(found)


def hidden() -> dict[str, int]:
    """What keeps Windows from opening a console for each process."""
    return {"creationflags": subprocess.CREATE_NO_WINDOW} if os.name == "nt" else {}


def version(path: Path) -> str:
    """What `beamfarm --version` says, as `0.2.0`."""
    status = path.stat()
    key = str(path), status.st_mtime, status.st_size
    if key not in _known:
        _known[key] = _ask(path)
    return _known[key]


def _ask(path: Path) -> str:
    try:
        done = subprocess.run(
            [str(path), "--version"],
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            encoding="utf-8",
            errors="replace",
            timeout=20,
            check=False,
            **hidden(),
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ProgramError(f"{path} cannot be run: {error}. {WAY_OUT}") from error
    # Below stands which bits its passes have.
    said = re.match(r"beamfarm (\d+\.\d+\.\d+\S*)\s", done.stdout)
    if said is None:
        raise ProgramError(f"{path} is not beamfarm: it does not tell its version. {WAY_OUT}")
    return said.group(1)


def usable(asked: str) -> Path:
    """The command, of a version that this add-on is made for."""
    path = find(asked)
    number = version(path)
    if tuple(int(part) for part in number.split(".")[:2]) != MADE_FOR:
        made_for = ".".join(str(part) for part in MADE_FOR)
        raise ProgramError(
            f"{path} is beamfarm {number}, but this add-on is for {made_for}: install the add-on that came with it. "
            f"{WAY_OUT} where {made_for} is"
        )
    return path
