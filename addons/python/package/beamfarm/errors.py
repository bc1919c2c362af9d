"""The package's errors. Each is a :class:`BeamfarmError`."""

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
    """The base class of the package's errors."""


class Fault(NamedTuple):
    """One fault of a scene."""

    file: Path
    """The scene's file, or one that it names."""
    line: int | None
    """Line in that file, from 1, where known."""
    field: str | None
    """The field, for example ``materials.glass.ior``, if it is in one."""
    message: str
    """What is wrong, and what was expected."""

    def __str__(self) -> str:
        place = str(self.file) if self.line is None else f"{self.file}:{self.line}"
        return f"{place}: {self.message}"


class SceneError(BeamfarmError, ValueError):
    """A scene that cannot be rendered. ``faults`` lists everything that is wrong with it."""

    def __init__(self, message: str, faults: Sequence[Fault] = ()) -> None:
        super().__init__(message)
        self.faults: list[Fault] = list(faults)


class ArgumentError(BeamfarmError, ValueError):
    """An argument or array that is not as expected: the message says what it is."""


class ImageError(BeamfarmError, OSError):
    """An image that cannot be read or written."""


class RenderError(BeamfarmError, RuntimeError):
    """Passes that cannot be rendered. ``image`` holds the passes before, if there are any."""

    image: Image | None = None


class OutOfMemoryError(RenderError, MemoryError):
    """This machine has too little memory for the image or the scene."""


class DeviceError(BeamfarmError, RuntimeError):
    """There is no device for passes here, the device cannot render the scene, or it failed."""


class FarmError(BeamfarmError, ConnectionError):
    """A farm that cannot be reached, or that refuses the request."""


class SceneNote(UserWarning):
    """Something in a scene that may not be what its author intends."""


class RenderInterrupted(UserWarning):
    """Ctrl-C ended a render; its image holds the passes completed before."""


def scene_error(faults: Sequence[tuple[str, int | None, str | None, str]]) -> SceneError:
    """The exception for the faults that the compiled part found."""
    found = [Fault(Path(file), line, field, message) for file, line, field, message in faults]
    return SceneError("\n".join(map(str, found)), found)
