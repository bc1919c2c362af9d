"""Draws a picture in a viewport. Blender manages colour: what is drawn here is linear."""

from __future__ import annotations

import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from .live import Frame


class Canvas:
    """Keeps the texture of the last picture drawn."""

    def __init__(self) -> None:
        self._frame: Frame | None = None
        self._texture: gpu.types.GPUTexture | None = None

    def draw(self, engine, scene, region, frame: Frame) -> None:
        """Fills the region with a picture."""
        if frame is not self._frame:
            self._frame, self._texture = frame, _texture(frame.pixels)
        gpu.state.blend_set("ALPHA_PREMULT")
        engine.bind_display_space_shader(scene)
        draw_texture_2d(self._texture, (0, 0), region.width, region.height)
        engine.unbind_display_space_shader()
        gpu.state.blend_set("NONE")


def _texture(pixels: np.ndarray) -> gpu.types.GPUTexture:
    height, width = pixels.shape[:2]
    # Textures start at the bottom, and have an alpha.
    data = np.ones((height, width, 4), np.float32)
    data[..., :3] = pixels[::-1]
    buffer = gpu.types.Buffer("FLOAT", width * height * 4, data.ravel())
    return gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
