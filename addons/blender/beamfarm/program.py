"""Finds the command `beamfarm`, and checks whether this add-on can use it.

It is the one in the preferences, or that of the Python package `beamfarm`, which the add-on's zip may contain as a
wheel, or the one on PATH.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import stat
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

# Major and minor version of the command that the add-on is made for. Scene files and options of others may differ.
MADE_FOR = (0, 2)

NAME = "beamfarm.exe" if os.name == "nt" else "beamfarm"

WAY_OUT = "Set its path in Preferences > Add-ons > beamfarm, or put it into a folder on PATH"

# By path, modification time and size: versions, so that a still frame does not start the program twice, and copies.
_Key = tuple[str, float, int]
_known: dict[_Key, str] = {}
_copies: dict[_Key, Path] = {}


class ProgramError(Exception):
    """The command cannot be used; the message says why, and what to do."""


def find(asked: str) -> tuple[Path, str]:
    """The command at `asked`, which may begin with `~`, or, if that is empty, one that is found; and its origin."""
    if asked:
        path = Path(os.path.expandvars(asked)).expanduser()
        if path.is_dir():
            path = path / NAME
        if not path.is_file():
            raise ProgramError(f"There is no program at {path}. {WAY_OUT}")
        if not os.access(path, os.X_OK):
            raise ProgramError(f"{path} may not be executed. {WAY_OUT}")
        return path, "as set above"
    for path in _of_packages():
        return _executable(path), "of the Python package"
    found = shutil.which("beamfarm")
    if found is None:
        raise ProgramError(f"The program beamfarm was not found in PATH. {WAY_OUT}")
    return Path(found), "of PATH"


def _of_packages() -> Iterator[Path]:
    """The commands of the packages `beamfarm` that Python would find. They are not imported: this add-on may have the
    same name, and a package that cannot be imported here still has its command."""
    for folder in sys.path:
        path = Path(folder or ".", "beamfarm", "bin", NAME)
        if path.is_file():
            yield path.absolute()


def _executable(path: Path) -> Path:
    """The command, or a copy: Blender unpacks wheels without execute permission."""
    if os.access(path, os.X_OK):
        return path
    try:
        path.chmod(path.stat().st_mode | stat.S_IXUSR | stat.S_IXGRP | stat.S_IXOTH)
    except OSError:
        # Someone else's file, or a read-only disk.
        pass
    # A disk may also forbid execution.
    if os.access(path, os.X_OK):
        return path
    key = _key(path)
    if key not in _copies or not os.access(_copies[key], os.X_OK):
        try:
            _copies[key] = _copy(path)
        except OSError as error:
            raise ProgramError(f"{path} may not be executed, nor be copied: {error}. {WAY_OUT}") from error
    return _copies[key]


def _copy(path: Path) -> Path:
    """An executable copy in the user's cache, made once for each version and content."""
    digest = _digest(path)
    # The package's metadata lie next to it.
    told = [folder.name for folder in path.parents[2].glob("beamfarm-*.dist-info")]
    number = told[0].removeprefix("beamfarm-").removesuffix(".dist-info") if told else "unknown"
    folder = cache() / "programs" / f"{number}-{digest[:16]}"
    copy = folder / NAME
    if copy.is_file() and os.access(copy, os.X_OK) and _digest(copy) == digest:
        return copy
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    # Another Blender may do the same at the same time.
    handle, part = tempfile.mkstemp(dir=folder, suffix=".part")
    try:
        with open(handle, "wb") as to, path.open("rb") as source:
            shutil.copyfileobj(source, to, 1 << 20)
        os.chmod(part, 0o700)
        os.replace(part, copy)
    except BaseException:
        Path(part).unlink(missing_ok=True)
        raise
    return copy


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def cache() -> Path:
    """The command's folder for what may be deleted at any time."""
    for variable, inner in (("XDG_CACHE_HOME", ""), ("LOCALAPPDATA", ""), ("HOME", ".cache")):
        if os.environ.get(variable):
            return Path(os.environ[variable], inner, "beamfarm")
    return Path(tempfile.gettempdir(), "beamfarm")


def _key(path: Path) -> _Key:
    status = path.stat()
    return str(path), status.st_mtime, status.st_size


def hidden() -> dict[str, int]:
    """Keeps Windows from opening a console for each process."""
    return {"creationflags": subprocess.CREATE_NO_WINDOW} if os.name == "nt" else {}


def version(path: Path) -> str:
    """The version from `beamfarm --version`, for example `0.2.0`."""
    key = _key(path)
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
    # The version of its passes' bits is printed below.
    said = re.match(r"beamfarm (\d+\.\d+\.\d+\S*)\s", done.stdout)
    if said is None:
        raise ProgramError(f"{path} is not beamfarm: it does not print its version. {WAY_OUT}")
    return said.group(1)


def usable(asked: str) -> tuple[Path, str]:
    """The command, if its version is one that this add-on is made for; and its origin."""
    path, whose = find(asked)
    number = version(path)
    if tuple(int(part) for part in number.split(".")[:2]) != MADE_FOR:
        made_for = ".".join(str(part) for part in MADE_FOR)
        raise ProgramError(
            f"{path} is beamfarm {number}, but this add-on is for {made_for}: install the add-on that came with it. "
            f"{WAY_OUT} where {made_for} is"
        )
    return path, whose
