"""What goes wrong. All of it is a :class:`BeamfarmError`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from .image import Image

__all__ = [
    "ArgumentError",
    "BeamfarmError",
    "DeviceError",
    "FarmError",
    "Fault",
    "ImageError",
    "OutOfMemoryError",
    "RenderError",
    "RenderInterrupted",
    "SceneError",
    "SceneNote",
]


class BeamfarmError(Exception):
    """Whatever goes wrong here."""


class Fault(NamedTuple):
    """One thing that is wrong with a scene."""

    file: Path
    """The scene's file, or one that it names."""
    line: int | None
    """Line in that file, from 1, where it can be told."""
    field: str | None
    """The field, as ``materials.glass.ior``, where it is one."""
    message: str
    """What is wrong, and what was expected."""

    def __str__(self) -> str:
        place = str(self.file) if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.message}"


class SceneError(BeamfarmError, ValueError):
    """A scene that cannot be rendered. ``faults`` has all that is wrong with it."""

    def __init__(self, message: str, faults: Sequence[Fault] = ()) -> None:
        super().__init__(message)
        self.faults: list[Fault] = list(faults)


class ArgumentError(BeamfarmError, ValueError):
    """An argument, or an array, that is not what was expected: the message says what came."""


class ImageError(BeamfarmError, OSError):
    """An image that cannot be read or written."""


class RenderError(BeamfarmError, RuntimeError):
    """Passes that cannot be rendered. ``image`` has those before, if there are any."""

    image: Image | None = None


class OutOfMemoryError(RenderError, MemoryError):
    """There is not enough memory on this machine for the image or for the scene."""


class DeviceError(BeamfarmError, RuntimeError):
    """There is no device for passes here, it cannot render the scene, or it failed."""


class FarmError(BeamfarmError, ConnectionError):
    """A farm that cannot be reached, or refuses who asks."""


class SceneNote(UserWarning):
    """What of a scene may not be as its author thinks."""


class RenderInterrupted(UserWarning):
    """Ctrl-C ended a render; its image is that of the passes before."""


def scene_error(faults: Sequence[tuple[str, int | None, str | None, str]]) -> SceneError:
    """Made of what the compiled part found."""
    found = [Fault(Path(file), line, field, message) for file, line, field, message in faults]
    return SceneError("\n".join(map(str, found)), found)
