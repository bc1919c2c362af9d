"""Settings of an export."""

from dataclasses import dataclass, field


@dataclass
class View:
    """A camera that is not an object: the viewport's. Lengths in scene units, angles in radians."""

    matrix_world: object
    """Camera to world, a 4 x 4 `mathutils.Matrix`; it looks along -z, +y is up."""
    fov: float = 0.8575
    """Angle of the wider side of the image; for a perspective view only."""
    ortho_scale: float = 6.0
    """Length of the wider side of the image; for an orthographic view only."""
    is_orthographic: bool = False
    lens: tuple | None = None
    """(radius of the aperture, distance of the focal plane); None for a pinhole."""
    shift: tuple = (0.0, 0.0)
    """Like `shift_x` and `shift_y` of a camera: relative to the image's wider side."""


@dataclass
class ExportSettings:
    """Size of the image, its camera, and the fields of `[render]`; None and empty values are left out of the scene
    file."""

    width: int
    height: int
    crop: tuple | None = None
    """(x, y, width, height) in pixels, (0, 0) at the top left."""
    camera: object | None = None
    """Camera object; by default that of the scene."""
    view: View | None = None
    """Used in place of a camera."""
    pixel_aspect: tuple = (1.0, 1.0)
    filter: object | None = None
    """`[image] filter`, as in the scene file."""
    bakes: bool = True
    """Whether Blender bakes what no node of the scene file can express, which takes seconds."""
    render: dict = field(default_factory=dict)
    """`[render]`: passes, seed, paths, alpha, radius, exposure and so on, as in the scene file."""
