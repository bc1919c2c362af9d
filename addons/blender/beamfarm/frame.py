"""The settings of a Blender scene that say how a frame is rendered: size, region, and options of the command."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .export import ExportSettings


@dataclass(frozen=True)
class Frame:
    """Size of the whole image and, if only a region is rendered, its window: x, y of the top left, width, height."""

    width: int
    height: int
    crop: tuple[int, int, int, int] | None = None

    @property
    def size(self) -> tuple[int, int]:
        """Size of the rendered part."""
        return (self.width, self.height) if self.crop is None else self.crop[2:]


def of_scene(scene) -> Frame:
    """Counts the pixels as Blender does, in integers and single precision."""
    render = scene.render
    width = max(1, render.resolution_x * render.resolution_percentage // 100)
    height = max(1, render.resolution_y * render.resolution_percentage // 100)
    if not render.use_border:
        return Frame(width, height)
    left, right = (_pixel(edge, width) for edge in (render.border_min_x, render.border_max_x))
    bottom, top = (_pixel(edge, height) for edge in (render.border_min_y, render.border_max_y))
    if right <= left or top <= bottom:
        return Frame(width, height)
    crop = left, height - top, right - left, top - bottom
    return Frame(width, height, None if crop == (0, 0, width, height) else crop)


def parts(time: float) -> tuple[int, float]:
    """The whole frame and the subframe of a time."""
    whole = math.floor(time)
    return whole, time - whole


def _pixel(edge: float, size: int) -> int:
    return int(np.float32(edge) * np.float32(size))


def export_settings(scene, frame: Frame) -> ExportSettings:
    """Settings that the exporter writes in addition to the scene itself."""
    own = scene.beamfarm
    render: dict[str, object] = {"seed": own.seed}
    if own.passes:
        render["passes"] = own.passes
    if own.paths:
        render["paths"] = own.paths
    if own.radius > 0.0:
        render["radius"] = own.radius
    aspect = scene.render.pixel_aspect_x, scene.render.pixel_aspect_y
    return ExportSettings(
        width=frame.width,
        height=frame.height,
        crop=frame.crop,
        pixel_aspect=aspect,
        render=render,
    )


def ends(own) -> list[str]:
    """The command's options that end a job; empty if nothing would end it."""
    options: list[str] = []
    if own.passes:
        options += ["--passes", str(own.passes)]
    if own.time_limit > 0.0:
        options += ["--time", f"{max(1, round(1000.0 * own.time_limit))}ms"]
    if own.target_error > 0.0:
        options += ["--target-error", f"{own.target_error:.6g}%"]
    return options


def verb(preferences) -> str:
    """The subcommand that renders a frame."""
    return "serve" if preferences.use_farm else "render"


def command(program: Path, preferences, scene_file: Path, output: Path, options: list[str]) -> list[str]:
    """The whole command line for a frame."""
    line = [str(program), verb(preferences), str(scene_file), "-o", str(output), *options]
    if preferences.use_farm:
        return [*line, "--listen", preferences.listen]
    if preferences.workers:
        line += ["--workers", str(preferences.workers)]
    if preferences.threads:
        line += ["--threads", str(preferences.threads)]
    return line
