"""What a caller of the export may ask for."""

from dataclasses import dataclass, field


@dataclass
class View:
    """A camera that is no object: the viewport's. Lengths in scene units, angles in radians."""

    matrix_world: object
    """Camera to world, `mathutils.Matrix` of 4 x 4; it looks along -z, +y is up."""
    fov: float = 0.8575
    """Angle of the wider side of the image; of a perspective view only."""
    ortho_scale: float = 6.0
    """Length of the wider side of the image; of an orthographic view only."""
    is_orthographic: bool = False
    lens: tuple | None = None
    """(radius of the aperture, distance of the plane in focus); None is a pinhole."""
    shift: tuple = (0.0, 0.0)
    """As `shift_x` and `shift_y` of a camera: in lengths of the image's wider side."""


@dataclass
class ExportSettings:
    """Size of the image, its camera, and what `[render]` is to hold; None and empty are left out of the scene file."""

    width: int
    height: int
    crop: tuple | None = None
    """(x, y, width, height) in pixels, (0, 0) at the top left."""
    camera: object | None = None
    """Camera object; by default that of the scene."""
    view: View | None = None
    """Counts in place of a camera."""
    pixel_aspect: tuple = (1.0, 1.0)
    filter: object | None = None
    """`[image] filter`, as in the scene file."""
    bakes: bool = True
    """Whether Blender bakes what no node of the scene file says, which takes seconds."""
    render: dict = field(default_factory=dict)
    """`[render]`: passes, seed, paths, alpha, radius, exposure and so on, as in the scene file."""
