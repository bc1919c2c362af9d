"""Scenes: the contents of a scene file as Python dictionaries and lists."""

from __future__ import annotations

import copy
import os
import warnings
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _native
from .arrays import Grid, Mesh, Texture
from .errors import ArgumentError, ImageError, SceneNote

if TYPE_CHECKING:
    from .rendering import Explanation

__all__ = ["Scene", "load"]

# Fields whose text is a path.
_FILES = frozenset({"file", "image", "gltf"})
# Up to this many numbers of an array are written as a list.
_LISTED = 256


def load(
    path: str | os.PathLike[str],
    *,
    parameters: Mapping[str, Any] | None = None,
    skip_unsupported: bool = False,
    spectral: bool = False,
    allow_outside: Sequence[str | os.PathLike[str]] = (),
) -> Scene:
    """Read a scene file: TOML, Mitsuba 3's XML if its name ends in ``.xml``, glTF if in ``.glb`` or ``.gltf``.

    Parameters
    ----------
    path
        The file. Paths of meshes, images and volumes in it are relative to its folder.
    parameters
        For a Mitsuba scene: values of its parameters ``$NAME``.
    skip_unsupported
        For a Mitsuba scene: leave out what is not supported; ``scene.left_out`` lists it.
    spectral
        For a Mitsuba scene: give named glasses and liquids their dispersion.
    allow_outside
        Folders outside the scene's that may hold files which the scene itself does not name, such as textures of its
        meshes.

    Raises
    ------
    SceneError
        Everything that is wrong, each fault with file, line and field.
    """
    path = Path(path)
    values = [(name, str(value)) for name, value in (parameters or {}).items()]
    folders = [Path(folder) for folder in allow_outside]
    text, made, reach, notes, left_out = _native.read_scene(path, values, skip_unsupported, spectral, folders)
    scene = Scene(text, folder=path.parent, name=path.stem)
    scene._made = made
    # Files read once may be read again, whichever file of the native scene names them.
    scene._reach = reach
    scene.notes = notes
    scene.left_out = left_out
    for note in [*notes, *(f"left out: {part}" for part in left_out)]:
        warnings.warn(note, SceneNote, stacklevel=2)
    return scene


class Scene(MutableMapping[str, Any]):
    """A scene. ``scene["lights"][0]["radiance"] = 3.0`` changes it, and so does ``scene.set("camera.fov", 40)``.

    Parameters
    ----------
    source
        A dictionary with the contents of a scene file, or its text (TOML). In place of a file's name it may have a
        :class:`~beamfarm.Mesh`, :class:`~beamfarm.Grid` or :class:`~beamfarm.Texture`. A dictionary is copied.
    folder
        The folder of the files that it names; by default the current folder.
    name
        Its name in errors and images.
    allow_outside
        As for :func:`load`.

    Nothing is checked before the scene is used: see :meth:`check`. Errors of a scene that was made or changed in Python
    refer to lines of :meth:`to_toml`, with ``<NAME>`` in place of a file.
    """

    def __init__(
        self,
        source: Mapping[str, Any] | str,
        *,
        folder: str | os.PathLike[str] = ".",
        name: str = "scene",
        allow_outside: Sequence[str | os.PathLike[str]] = (),
    ) -> None:
        self.folder = Path(folder)
        self.name = name
        self._reach = _native.Reach(self._path(), [Path(folder) for folder in allow_outside])
        self.notes: list[str] = []
        self.left_out: list[str] = []
        self._made: dict[str, bytes] = {}
        self._written: tuple[str, str] | None = None
        if isinstance(source, str):
            if "\n" not in source and source.endswith((".toml", ".xml", ".glb", ".gltf")):
                raise ArgumentError(f"{source!r} is the name of a file: beamfarm.load reads it")
            self.data: dict[str, Any] = _native.loads(source, self._path())
            # A scene as its author wrote it keeps its lines, for errors.
            self._written = _native.dumps(self.data), source
        elif isinstance(source, Mapping):
            self.data = copy.deepcopy(dict(source))
        else:
            raise ArgumentError(f"source: expected a dictionary or TOML, found {type(source).__name__}")

    def _path(self) -> Path:
        return self.folder / f"{self.name}.toml"

    def __getitem__(self, key: str) -> Any:
        return self.data[key]

    def __setitem__(self, key: str, value: Any) -> None:
        self.data[key] = value

    def __delitem__(self, key: str) -> None:
        del self.data[key]

    def __iter__(self) -> Iterator[str]:
        return iter(self.data)

    def __len__(self) -> int:
        return len(self.data)

    def __repr__(self) -> str:
        image = self.data.get("image")
        size = f"{image.get('width')} x {image.get('height')}, " if isinstance(image, Mapping) else ""
        counts = (
            f"{len(self.data.get(key) or ())} {key if len(self.data.get(key) or ()) != 1 else key[:-1]}"
            for key in ("shapes", "lights")
        )
        return f"<Scene {self.name!r}: {size}{', '.join(counts)}>"

    def copy(self) -> Scene:
        """A copy of the scene."""
        other = copy.copy(self)
        other.data = copy.deepcopy(self.data)
        other.notes = list(self.notes)
        other.left_out = list(self.left_out)
        return other

    def get_path(self, path: str) -> Any:
        """The value at a path, for example ``lights.0.power``.

        Raises
        ------
        KeyError
            There is no such field.
        """
        value: Any = self.data
        for part in path.split("."):
            value = _child(value, part, path)
        return value

    def set(self, path: str, value: Any) -> Scene:
        """Set the field at a path, for example ``camera.fov`` or ``lights.0.power``, and return the scene itself.

        Raises
        ------
        KeyError
            There is no table or list that could have such a field.
        """
        *parts, last = path.split(".")
        table: Any = self.data
        for part in parts:
            table = _child(table, part, path)
        if isinstance(table, MutableMapping):
            table[last] = value
        elif isinstance(table, list) and last.isdigit() and int(last) < len(table):
            table[int(last)] = value
        else:
            raise KeyError(f"{path}: there is no table or list that could have {last!r}")
        return self

    def _parts(self) -> tuple[str, dict[str, bytes]]:
        """Its text, and files that exist only in memory."""
        made = dict(self._made)
        plain = _plain(self.data, "", "", made)
        text = _native.dumps(plain)
        if self._written is not None and self._written[0] == text:
            text = self._written[1]
        return text, made

    def _source(self) -> _native.Source:
        text, made = self._parts()
        is_written = self._written is not None and self._written[1] == text
        # If it has changed since it was read, lines of errors are those of to_toml(), and no file is named.
        path = self._path() if is_written else self.folder / f"<{self.name}>"
        return _native.Source(path, text, made, self._reach)

    def to_toml(self) -> str:
        """The text of a scene file. Arrays have the names of the files that :meth:`save` would write."""
        return self._parts()[0]

    def check(self) -> None:
        """Read everything that the scene names, and check whether it can be rendered.

        Raises
        ------
        SceneError
            Everything that is wrong.
        """
        self._source().check()

    def explain(self, **options: Any) -> Explanation:
        """What a pass of the scene will do, and why: see :func:`beamfarm.explain`."""
        # Imported here because it imports this module.
        from .rendering import explain

        return explain(self, **options)

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write a scene file, and arrays as files into the folder ``arrays`` next to it. Returns its path.

        Files that the scene names stay where they are; their paths are changed to fit the new place.
        """
        path = Path(path)
        if path.suffix != ".toml":
            raise ArgumentError(f"{path}: expected a name that ends in .toml")
        made = dict(self._made)
        data = _plain(self.data, "", "", made)
        if not _is_same(path.parent, self.folder):
            data = _moved(data, self.folder, path.parent, made)
            text = _native.dumps(data)
        else:
            text, made = self._parts()
        try:
            for name, content in made.items():
                place = path.parent / name
                place.parent.mkdir(parents=True, exist_ok=True)
                _write(place, content)
            _write(path, text.encode())
        except OSError as error:
            raise ImageError(f"{path}: the scene cannot be written: {error}") from error
        return path


def _write(path: Path, content: bytes) -> None:
    """Writes the whole file, or nothing."""
    leftover = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with leftover.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        leftover.replace(path)
    finally:
        leftover.unlink(missing_ok=True)


def _is_same(one: Path, other: Path) -> bool:
    return one.resolve() == other.resolve()


def _child(value: Any, part: str, path: str) -> Any:
    if isinstance(value, Mapping) and part in value:
        return value[part]
    if isinstance(value, list):
        if part.isdigit() and int(part) < len(value):
            return value[int(part)]
        raise KeyError(f"{path}: there are {len(value)}, so that {part!r} is none of them")
    raise KeyError(f"{path}: there is no {part!r}")


def _plain(value: Any, key: str, path: str, made: dict[str, bytes]) -> Any:
    """A value that TOML can hold, with arrays as names of files."""
    if isinstance(value, (Mesh, Grid, Texture)):
        name, content = value.encoded()
        made[name] = content
        return name
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, np.ndarray):
        if value.size > _LISTED:
            raise ArgumentError(
                f"{path}: an array of shape {value.shape}; expected beamfarm.Mesh, Grid or Texture of it where a file "
                "is named"
            )
        value = value.tolist()
    if isinstance(value, os.PathLike):
        return Path(value).as_posix()
    if isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, Mapping):
        return {
            str(name): _plain(inner, str(name), f"{path}.{name}" if path else str(name), made)
            for name, inner in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [_plain(inner, key, f"{path}.{i}", made) for i, inner in enumerate(value)]
    raise ArgumentError(f"{path}: a scene cannot hold a {type(value).__name__}")


def _moved(value: Any, old: Path, new: Path, made: Mapping[str, bytes]) -> Any:
    """The same data for a scene file in another folder."""
    if isinstance(value, dict):
        return {
            name: _rebased(inner, old, new)
            if name in _FILES and isinstance(inner, str) and inner not in made
            else _moved(inner, old, new, made)
            for name, inner in value.items()
        }
    if isinstance(value, list):
        return [_moved(inner, old, new, made) for inner in value]
    return value


def _rebased(name: str, old: Path, new: Path) -> str:
    if Path(name).is_absolute():
        return name
    return Path(os.path.relpath(old.resolve() / name, new.resolve())).as_posix()
