"""Light in fog, smoke and water, and caustics, by progressive photon beams.

>>> import beamfarm
>>> image = beamfarm.render("scene.toml", passes=16)   # doctest: +SKIP
>>> image.beauty.mean(), image.error                   # doctest: +SKIP
>>> image.save("scene.png")                            # doctest: +SKIP

Arrays of pixels are (height, width, 3) float32, linear sRGB, the first row on top. Lengths are scene units, radiance is
in W/(m² sr), times are seconds, errors are fractions.
"""

from __future__ import annotations

from . import _native
from .arrays import Grid, Mesh, Texture
from .command import program
from .errors import (
    ArgumentError,
    BeamfarmError,
    DeviceError,
    FarmError,
    Fault,
    ImageError,
    OutOfMemoryError,
    RenderError,
    RenderInterrupted,
    SceneError,
    SceneNote,
)
from .farm import Farm, Served, connect, serve
from .image import Bias, Block, Comparison, Image, Layers, Pass, average, compare, read
from .rendering import Explanation, Passes, Progress, explain, pass_image, passes, radius_scale, reference, render
from .scene import Scene, load

__version__: str = _native.version

__all__ = [
    "ArgumentError",
    "BeamfarmError",
    "Bias",
    "Block",
    "Comparison",
    "DeviceError",
    "Explanation",
    "Farm",
    "FarmError",
    "Fault",
    "Grid",
    "Image",
    "ImageError",
    "Layers",
    "Mesh",
    "OutOfMemoryError",
    "Pass",
    "Passes",
    "Progress",
    "RenderError",
    "RenderInterrupted",
    "Scene",
    "SceneError",
    "SceneNote",
    "Served",
    "Texture",
    "__version__",
    "average",
    "compare",
    "connect",
    "explain",
    "load",
    "pass_image",
    "passes",
    "program",
    "radius_scale",
    "read",
    "reference",
    "render",
    "serve",
]
