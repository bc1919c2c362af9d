"""Rendering."""

from __future__ import annotations

import importlib.util
import math
import operator
import os
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Union

from . import _native
from .command import program
from .errors import ArgumentError, RenderError, RenderInterrupted, SceneNote
from .image import Image, Pass
from .scene import Scene, load

__all__ = ["Explanation", "Passes", "Progress", "explain", "pass_image", "passes", "radius_scale", "reference", "render"]

AnyScene = Union[Scene, Mapping[str, Any], str, "os.PathLike[str]"]
"""A scene, a dictionary of one, or the path of a file."""


@dataclass(frozen=True)
class Progress:
    """The progress of a render."""

    passes: int = 0
    """Completed passes."""
    limit: int | None = None
    """The total number of passes, if known."""
    fraction: float = 0.0
    """Share of the work that is done."""
    remaining: float | None = None
    """Seconds left, if known."""
    error: float | None = None
    """Relative standard error, if known yet."""


class Explanation(dict[str, Any]):
    """The plan for a scene: ``str()`` of it is what ``beamfarm explain`` prints."""

    def __str__(self) -> str:
        return str(self["text"]).rstrip("\n")

    __repr__ = __str__


def _scene(scene: AnyScene) -> Scene:
    if isinstance(scene, Scene):
        return scene
    if isinstance(scene, Mapping):
        return Scene(scene)
    if isinstance(scene, (str, os.PathLike)):
        return load(scene)
    raise ArgumentError(f"scene: expected a Scene, a dictionary or a path, found {type(scene).__name__}")


def _whole(name: str, value: Any, least: int, most: int) -> int | None:
    if value is None:
        return None
    try:
        number = operator.index(value)
    except TypeError:
        raise ArgumentError(f"{name} = {value!r}: expected a whole number") from None
    if not least <= number <= most:
        raise ArgumentError(f"{name} = {number}: expected {least} to {most}")
    return number


def _real(name: str, value: Any) -> float | None:
    if value is None:
        return None
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise ArgumentError(f"{name} = {value!r}: expected a number") from None
    if not math.isfinite(number) or number < 0.0:
        raise ArgumentError(f"{name} = {number}: expected a number, not less than 0")
    return number


def _options(
    layers: Sequence[str] = (),
    paths: int | None = None,
    seed: int | None = None,
    alpha: float | None = None,
    budget: int | None = None,
    engine: str | None = None,
    device: str | int | None = None,
    threads: int | None = None,
) -> dict[str, Any]:
    return {
        "layers": [layers] if isinstance(layers, str) else list(layers),
        "paths": _whole("paths", paths, 1, 2**32 - 1),
        "seed": _whole("seed", seed, 0, 2**64 - 1),
        "alpha": _real("alpha", alpha),
        "budget": _whole("budget", budget, 1, 2**53),
        "engine": engine,
        "device": None if device is None else str(device),
        "threads": _whole("threads", threads, 1, 65535),
    }


def _told(notes: Sequence[str], left_out: Sequence[str], known: Scene) -> None:
    """Warns of notes on a scene, except those already given when it was read."""
    said = {*known.notes, *known.left_out}
    for note in notes:
        # What a pilot chose is no warning.
        if note not in said and not note.startswith("the pilot chose ") and not note.startswith("engine "):
            warnings.warn(note, SceneNote, stacklevel=4)
    for part in left_out:
        if part not in said:
            warnings.warn(f"left out: {part}", SceneNote, stacklevel=4)


def _finished(outcome: Any, scene: Scene, what: str) -> Image:
    """The image of an outcome, or its exception. `what`: passes or samples."""
    native, (notes, left_out), interrupted, failure = outcome
    _told(notes, left_out, scene)
    notes = [*scene.notes, *notes]
    left_out = [*scene.left_out, *left_out]
    image = None if native is None else Image(native, notes=notes, left_out=left_out, interrupted=interrupted)
    if failure is not None:
        if isinstance(failure, RenderError):
            failure.image = image
        raise failure
    if image is None:
        raise RenderError(f"none of the {what} is complete")
    if interrupted:
        warnings.warn(f"interrupted after {image.passes} {what}", RenderInterrupted, stacklevel=3)
    return image


def render(
    scene: AnyScene,
    *,
    passes: int | None = None,
    time: float | None = None,
    error: float | None = None,
    percentile: int | None = None,
    layers: Sequence[str] = (),
    threads: int | None = None,
    workers: int | None = None,
    engine: str | None = None,
    device: str | int | None = None,
    paths: int | None = None,
    seed: int | None = None,
    alpha: float | None = None,
    budget: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> Image:
    """Render a scene on this machine. The bits are those of the command ``beamfarm render``.

    Parameters
    ----------
    scene
        A :class:`Scene`, a dictionary, or the path of a scene file.
    passes, time, error
        When to end: after this many passes, after this many seconds with the passes that are complete by then, or when
        the relative standard error is at most this (0.01 is 1 %); whichever comes first. By default after the scene's
        passes.
    percentile
        Apply ``error`` to this share of blocks of 8 x 8 pixels, in percent, instead of the image as a whole.
    layers
        Layers to render as well: ``"depth"``, ``"normal"``, ``"albedo"``, ``"direct"``, ``"surface"``, ``"volume"``,
        ``"lights"``, ... as for the command's ``--aov``.
    threads, workers
        Threads of each worker process, and number of processes; by default all cores are used.
    engine, device
        ``"cpu"``, ``"gpu"`` or ``"auto"``, and which device.
    paths, seed, alpha, budget
        Photon paths per pass, seed of all random numbers, how quickly radii shrink, passes for which radii are chosen;
        by default the scene's values, or what a pilot finds best.
    progress
        True: a bar (tqdm's if installed); False: none; a function: it is called with a :class:`Progress` about ten
        times a second. By default a bar if the output is a terminal or a notebook.

    Returns
    -------
    Image
        Ctrl-C ends it early, with a warning, and keeps the passes that are complete.

    Raises
    ------
    SceneError
        Everything that is wrong with the scene.
    ArgumentError, DeviceError, OutOfMemoryError, RenderError
        With ``.image``, if passes were complete before.

    Other Python threads keep running, and may render as well. Separate processes render the passes: one that dies is
    replaced.
    """
    scene = _scene(scene)
    options = _options(layers, paths, seed, alpha, budget, engine, device, threads)
    with _Shown(progress, "passes") as callback:
        outcome = _native.render(
            scene._source(),
            options,
            program(),
            passes=_whole("passes", passes, 1, 2**53),
            time=_real("time", time),
            error=_real("error", error),
            percentile=_whole("percentile", percentile, 1, 100),
            workers=_whole("workers", workers, 1, 65535),
            callback=callback,
        )
    return _finished(outcome, scene, "passes")


def reference(
    scene: AnyScene,
    *,
    samples: int | None = None,
    time: float | None = None,
    max_depth: int | None = None,
    layers: Sequence[str] = (),
    threads: int | None = None,
    seed: int | None = None,
    progress: bool | Callable[[Progress], None] | None = None,
) -> Image:
    """Render a scene with a path tracer, whose only error is noise: the truth where it converges.

    It never finds caustics of point, spot, laser and directional lights, at any number of samples. See
    ``beamfarm reference --help``.

    Parameters
    ----------
    samples, time
        Samples per pixel (64), or a limit in seconds, which keeps the samples that are complete by then.
    max_depth
        Scatter paths at most this many times; 1 is direct light.
    layers
        Any of ``"direct"``, ``"surface"``, ``"volume"``, ``"lights"``.
    """
    scene = _scene(scene)
    options = _options(layers, seed=seed, threads=threads)
    with _Shown(progress, "samples") as callback:
        outcome = _native.sample(
            scene._source(),
            options,
            samples=_whole("samples", samples, 1, 2**53),
            time=_real("time", time),
            max_depth=_whole("max_depth", max_depth, 0, 2**32 - 1),
            callback=callback,
        )
    return _finished(outcome, scene, "samples")


def explain(scene: AnyScene, **options: Any) -> Explanation:
    """What a pass of the scene will do, and why: a dictionary whose ``str()`` is what ``beamfarm explain`` prints.

    It has ``scene`` (a hash), ``width``, ``height``, ``passes``, ``engine``, ``seed``, ``alpha``, ``paths``,
    ``techniques`` (None: the default ones), ``places`` (corners of each object's box in world space), ``notes``,
    ``left_out`` and ``text``.

    Parameters
    ----------
    options
        ``layers``, ``paths``, ``seed``, ``alpha``, ``budget``, ``engine``, ``device``, ``threads``, as for
        :func:`render`.
    """
    scene = _scene(scene)
    return Explanation(_native.explain(scene._source(), _options(**options)))


class Passes:
    """The passes of a scene, each of which can be rendered separately, in this process.

    Parameters
    ----------
    scene
        A :class:`Scene`, a dictionary, or the path of a scene file.
    options
        ``layers``, ``paths``, ``seed``, ``alpha``, ``budget``, ``engine``, ``device``, ``threads``, as for
        :func:`render`.

    The scene is read once; later changes to it do not change the passes.
    """

    def __init__(self, scene: AnyScene, **options: Any) -> None:
        scene = _scene(scene)
        self._native = _native.Passes(scene._source(), _options(**options))
        _told(*self._native.notes, scene)

    def radius_scale(self, index: int) -> float:
        """A pass's radius factor, which shrinks as its index grows."""
        number = _whole("index", index, 0, 2**53 - 1)
        assert number is not None
        return self._native.radius_scale(number)

    def __getitem__(self, index: int) -> Pass:
        """Render a pass."""
        number = _whole("index", index, 0, 2**53 - 1)
        assert number is not None
        return Pass(self._native.render(number))

    def __call__(self, start: int = 0) -> Iterator[Pass]:
        """Render passes one after the other, without end."""
        index = start
        while True:
            yield self[index]
            index += 1

    __iter__ = __call__


def passes(scene: AnyScene, start: int = 0, **options: Any) -> Iterator[Pass]:
    """Render passes one after the other from ``start`` on, without end: ``for p in passes(scene): ...``.

    Options are those of :class:`Passes`. :func:`average` makes an image of passes 0 to N - 1.
    """
    return Passes(scene, **options)(start)


def pass_image(scene: AnyScene, index: int, **options: Any) -> Pass:
    """Render one pass. To render several, use :class:`Passes`, which reads the scene once."""
    return Passes(scene, **options)[index]


def radius_scale(index: int, alpha: float = 2.0 / 3.0) -> float:
    """A pass's radius factor, if radii shrink once per pass: 1 at index 0.

    Parameters
    ----------
    index
        Number of the pass, from 0.
    alpha
        How quickly radii shrink, between 0 and 1. For a scene with its budget, use ``Passes(scene).radius_scale``.
    """
    number, share = _whole("index", index, 0, 2**53 - 1), _real("alpha", alpha)
    assert number is not None and share is not None
    if not 0.0 < share < 1.0:
        raise ArgumentError(f"alpha = {share}: expected a number between 0 and 1")
    return _native.radius_scale(number, share)


class _Shown:
    """A progress bar during a render."""

    def __init__(self, progress: bool | Callable[[Progress], None] | None, unit: str) -> None:
        self._asked = progress
        self._unit = unit
        self._bar: Any = None

    def __enter__(self) -> Callable[[dict[str, Any]], None] | None:
        if callable(self._asked):
            tell = self._asked
            return lambda state: tell(Progress(**state))
        if self._asked is False or (self._asked is None and not _is_watched()):
            return None
        bar = _bar_of_tqdm()
        if bar is None:
            self._bar = _Line(self._unit)
        else:
            self._bar = bar(total=1.0, bar_format="{l_bar}{bar}| {postfix}", leave=False, file=sys.stderr)
        return self._update

    def _update(self, state: dict[str, Any]) -> None:
        known = Progress(**state)
        count = f"{known.passes}/{known.limit}" if known.limit else str(known.passes)
        error = "" if known.error is None else f", error {100 * known.error:.2f} %"
        remaining = "" if known.remaining is None else f", {known.remaining:.0f} s left"
        self._bar.n = round(known.fraction, 4)
        self._bar.set_postfix_str(f"{count} {self._unit}{error}{remaining}", refresh=False)
        self._bar.refresh()

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()


class _Line:
    """A line on stderr, if tqdm is not installed."""

    def __init__(self, unit: str) -> None:
        self.n = 0.0
        self._text = unit

    def set_postfix_str(self, text: str, refresh: bool) -> None:
        self._text = text

    def refresh(self) -> None:
        sys.stderr.write(f"\r\x1b[K{int(100 * self.n)} %  {self._text}")
        sys.stderr.flush()

    def close(self) -> None:
        sys.stderr.write("\r\x1b[K")
        sys.stderr.flush()


def _bar_of_tqdm() -> Any:
    try:
        if _is_notebook():
            from tqdm.notebook import tqdm  # type: ignore[import-untyped, unused-ignore]
        else:
            from tqdm import tqdm  # type: ignore[import-untyped, unused-ignore]
    except ImportError:
        return None
    return tqdm


def _is_notebook() -> bool:
    return "ipykernel" in sys.modules


def _is_watched() -> bool:
    """Whether the output is a terminal, or a notebook that can show a bar."""
    if _is_notebook():
        return importlib.util.find_spec("ipywidgets") is not None
    try:
        return sys.stderr.isatty()
    except (AttributeError, ValueError):
        return False
