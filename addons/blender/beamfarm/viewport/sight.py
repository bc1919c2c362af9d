"""The camera of a viewport, from Blender's drawing matrices."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mathutils import Matrix, Vector

from ..export import View, lens_of

# An orthographic viewport has only a direction: its picture starts this many view distances before its centre.
_BEFORE = 8.0
# Significant digits when comparing: Blender's matrices are single precision.
_DIGITS = 6


@dataclass(frozen=True)
class Sight:
    """A viewport's camera, lens, and picture size in pixels."""

    width: int
    height: int
    matrix: tuple[float, ...]
    fov: float
    ortho_scale: float
    is_orthographic: bool
    shift: tuple[float, float]
    lens: tuple[float, float] | None = None

    @property
    def matrix_world(self) -> Matrix:
        """Camera to world."""
        return Matrix([self.matrix[4 * row : 4 * row + 4] for row in range(4)])

    def view(self) -> View:
        """In the export's form."""
        return View(self.matrix_world, self.fov, self.ortho_scale, self.is_orthographic, self.lens, self.shift)

    def differs_in_place_alone(self, other: Sight) -> bool:
        """Whether the two have the same lens and size."""
        return _lens(self) == _lens(other)

    def message(self) -> dict[str, object]:
        """Its place in the live view's form."""
        turn = self.matrix_world.to_3x3()
        origin = self.matrix_world.translation
        target = origin + (turn @ Vector((0.0, 0.0, -1.0))).normalized()
        up = (turn @ Vector((0.0, 1.0, 0.0))).normalized()
        return {"origin": list(origin), "target": list(target), "up": list(up)}


def _lens(sight: Sight) -> tuple[object, ...]:
    numbers = sight.fov, sight.ortho_scale, *sight.shift, *(sight.lens or ())
    return sight.width, sight.height, sight.is_orthographic, *(round(number, _DIGITS) for number in numbers)


def of_matrices(
    view: Matrix,
    window: Matrix,
    size: tuple[int, int],
    distance: float | None,
    lens: tuple[float, float] | None = None,
) -> Sight:
    """From the matrices to camera space and to the picture. `distance`: of the view from its centre, without a camera;
    `lens`: the camera's."""
    width, height = size
    # Relative to the wider side: of half a picture at distance one, or absolute.
    wider = max(width, height)
    along = 0 if width >= height else 1
    is_orthographic = window[3][3] == 1.0
    column = 3 if is_orthographic else 2
    sign = -0.5 if is_orthographic else 0.5
    shift = sign * window[0][column] * width / wider, sign * window[1][column] * height / wider
    place = view.inverted()
    if is_orthographic and distance is not None:
        place = place @ Matrix.Translation((0.0, 0.0, _BEFORE * distance))
    half = 1.0 / window[along][along]
    return Sight(
        width,
        height,
        tuple(number for row in place for number in row),
        2.0 * math.atan(half),
        2.0 * half,
        is_orthographic,
        shift,
        lens,
    )


def of_context(context, depsgraph) -> Sight:
    """For the viewport that is being drawn."""
    region, view = context.region, context.region_data
    pixel = context.scene.render.preview_pixel_size
    step = 1 if pixel == "AUTO" else int(pixel)
    size = max(1, region.width // step), max(1, region.height // step)
    if view.view_perspective != "CAMERA":
        return of_matrices(view.view_matrix, view.window_matrix, size, view.view_distance)
    camera = context.space_data.camera if context.space_data.use_local_camera else context.scene.camera
    is_one = camera is not None and camera.type == "CAMERA"
    lens = lens_of(camera.evaluated_get(depsgraph), depsgraph) if is_one else None
    return of_matrices(view.view_matrix, view.window_matrix, size, None, lens)
