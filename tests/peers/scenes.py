"""Five scenes as plain data, from which each writer makes the same scene for its renderer.

Metres; y is up; colours are linear RGB. Surfaces are diffuse (both sides), smooth glass or mirrors. Lamps are black
spheres of a known power, equally bright everywhere: none is so small that a path tracer cannot hit it. One homogeneous
medium fills the room, or the inside of what says so. Pictures are square.
"""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Diffuse:
    reflectance: tuple


@dataclass(frozen=True)
class Glass:
    ior: float
    filled: bool = False  # with the scene's medium; otherwise nothing is inside


@dataclass(frozen=True)
class Mirror:
    reflectance: tuple


@dataclass(frozen=True)
class Sphere:
    center: tuple
    radius: float

    def mesh(self, around=256):
        """Its triangles with smooth normals, for renderers without spheres; all poles and rims are shared."""
        up = around // 2
        theta = np.linspace(0, np.pi, up + 1)[1:-1, None]
        phi = np.linspace(0, 2 * np.pi, around, endpoint=False)
        ring = np.stack([np.sin(theta) * np.sin(phi), np.cos(theta) + 0 * phi, np.sin(theta) * np.cos(phi)], -1)
        normals = np.concatenate([[[0, 1, 0]], ring.reshape(-1, 3), [[0, -1, 0]]])
        faces, last = [], len(normals) - 1
        for j in range(around):
            k = (j + 1) % around
            faces += [(0, 1 + j, 1 + k), (last, last - around + k, last - around + j)]
            for i in range(up - 2):
                a, b = 1 + i * around, 1 + (i + 1) * around
                faces += [(a + j, b + j, b + k), (a + j, b + k, a + k)]
        return Mesh(np.array(self.center) + self.radius * normals, np.array(faces), normals)


@dataclass(frozen=True)
class Mesh:
    vertices: np.ndarray
    faces: np.ndarray
    normals: np.ndarray | None = None  # None: flat faces


@dataclass(frozen=True)
class Object:
    name: str
    shape: Sphere | Mesh
    material: str


@dataclass(frozen=True)
class Lamp:
    name: str
    center: tuple
    radius: float
    power: tuple  # W
    check_radius: float  # in the check's variant

    @property
    def radiance(self):
        return tuple(p / (4 * np.pi**2 * self.radius**2) for p in self.power)

    def mesh(self):
        """Few flat faces, of the sphere's area in all: at the sphere's radiance they emit its power."""
        ball = Sphere((0, 0, 0), 1).mesh(24)
        radius = self.radius * np.sqrt(4 * np.pi / areas(ball.vertices, ball.faces).sum())
        return Mesh(np.array(self.center) + radius * ball.vertices, ball.faces)


@dataclass(frozen=True)
class Medium:
    sigma_a: tuple
    sigma_s: tuple
    g: float = 0.0

    @property
    def sigma_t(self):
        return tuple(np.add(self.sigma_a, self.sigma_s))

    @property
    def albedo(self):
        return tuple(np.divide(self.sigma_s, self.sigma_t))


@dataclass(frozen=True)
class Scene:
    name: str
    title: str
    camera: dict  # origin, target, fov: degrees across the picture
    materials: dict
    objects: list
    lamps: list
    exposure: float  # stops, for the sheets
    crop: tuple  # x, y, side of what the sheets enlarge, as fractions of the picture
    medium: Medium | None = None
    room: tuple | None = None  # corners of what the medium fills; None: the objects whose glass is `filled`
    witness: str = "mitsuba"  # the peer that a reference is compared with
    check_without: tuple = ()  # objects that the check's variant lacks
    depth: int = 64  # bounces, where a renderer wants a limit

    def check(self):
        """A variant that is easy for all renderers: larger lamps of the same power."""
        return replace(self, lamps=[replace(lamp, radius=lamp.check_radius) for lamp in self.lamps],
                       objects=[item for item in self.objects if item.name not in self.check_without])


def areas(vertices, faces):
    a, b, c = vertices[faces].swapaxes(0, 1)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


def grey(value):
    return (value, value, value)


def quad(a, b, c, d):
    return Mesh(np.array([a, b, c, d], float), np.array([(0, 1, 2), (0, 2, 3)]))


def walls(low, high, materials, leave_out=()):
    """The inside of a box: floor, ceiling, back, front, left, right."""
    (x, y, z), (X, Y, Z) = low, high
    sides = {
        "floor": quad((x, y, Z), (X, y, Z), (X, y, z), (x, y, z)),
        "ceiling": quad((x, Y, z), (X, Y, z), (X, Y, Z), (x, Y, Z)),
        "back": quad((x, y, z), (X, y, z), (X, Y, z), (x, Y, z)),
        "front": quad((X, y, Z), (x, y, Z), (x, Y, Z), (X, Y, Z)),
        "left": quad((x, y, Z), (x, y, z), (x, Y, z), (x, Y, Z)),
        "right": quad((X, y, z), (X, y, Z), (X, Y, Z), (X, Y, z)),
    }
    return [Object(name, shape, materials[name]) for name, shape in sides.items() if name not in leave_out]


def frame(axis):
    """Two directions across an axis, and the axis, as rows."""
    axis = np.array(axis, float) / np.linalg.norm(axis)
    side = np.cross(axis, (0, 0, 1) if abs(axis[2]) < 0.9 else (1, 0, 0))
    side /= np.linalg.norm(side)
    return np.stack([side, np.cross(axis, side), axis])


def lathe(profile, rows, origin, around=96, normals=None, closed=False):
    """A surface of revolution: profile of (radius, height) along the third of `rows`, its outside to the right."""
    phi = np.linspace(0, 2 * np.pi, around, endpoint=False)
    turn = lambda p: np.stack([p[:, :1] * np.cos(phi), p[:, :1] * np.sin(phi), p[:, 1:] + 0 * phi], -1).reshape(-1, 3)
    faces, count = [], len(profile)
    for i in range(count if closed else count - 1):
        for j in range(around):
            k = (j + 1) % around
            a, b = i * around, (i + 1) % count * around
            faces += [(a + j, a + k, b + k), (a + j, b + k, b + j)]
    points = turn(np.array(profile, float)) @ rows + origin
    faces = np.array(faces)
    faces = faces[areas(points, faces) > 1e-12]
    return Mesh(points, faces, None if normals is None else turn(np.array(normals, float)) @ rows)


def lens(center, axis, aperture, curvature):
    """Two caps of spheres of the radius `curvature` that meet in a rim of the radius `aperture`."""
    angles = np.linspace(0, np.arcsin(aperture / curvature), 33)
    depth = curvature * np.cos(angles[-1])
    cap = np.stack([np.sin(angles), np.cos(angles)], -1)
    front, back = cap[::-1], cap * (1, -1)
    profile = np.concatenate([back * curvature + (0, depth), front * curvature - (0, depth)])
    return lathe(profile, frame(axis), center, normals=np.concatenate([back, front]))


def tube(origin, axis, radius, length):
    """Open at its far end."""
    return lathe([(0, 0), (radius, 0), (radius, length)], frame(axis), origin)


def ring(center, axis, radius, thickness):
    t = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    normals = np.stack([np.cos(t), np.sin(t)], -1)
    return lathe(normals * thickness + (radius, 0), frame(axis), center, 192, normals, closed=True)


def water(half, level, bottom, cells=128):
    """A block of water with waves on it, closed: its sides and bottom are to lie behind walls."""
    x = np.linspace(-half, half, cells + 1)
    x, z = np.meshgrid(x, x)
    y, dx, dz = np.full_like(x, level), np.zeros_like(x), np.zeros_like(x)
    for height, kx, kz, phase in [(0.020, 5.1, 2.3, 0.4), (0.014, -3.7, 7.9, 1.9), (0.009, 11.3, 4.1, 3.3),
                                  (0.006, 6.1, -14.9, 5.0)]:
        y += height * np.sin(kx * x + kz * z + phase)
        dx += height * kx * np.cos(kx * x + kz * z + phase)
        dz += height * kz * np.cos(kx * x + kz * z + phase)
    points = np.stack([x, y, z], -1)
    normals = np.stack([-dx, np.ones_like(dx), -dz], -1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    vertices, faces, n = [points.reshape(-1, 3)], [], cells + 1
    for i in range(cells):
        for j in range(cells):
            a = i * n + j
            faces += [(a, a + n, a + n + 1), (a, a + n + 1, a + 1)]
    # Sides, each between an edge of the surface and its copy at the bottom, with flat normals of their own.
    edges = [(points[0], (0, 0, -1)), (points[-1, ::-1], (0, 0, 1)), (points[::-1, 0], (-1, 0, 0)),
             (points[:, -1], (1, 0, 0))]
    for edge, normal in edges:
        start = sum(map(len, vertices))
        vertices += [edge, edge * (1, 0, 1) + (0, bottom, 0)]
        normals = np.concatenate([normals, np.tile(normal, (2 * n, 1))])
        for j in range(cells):
            a, b = start + j, start + n + j
            faces += [(a, a + 1, b + 1), (a, b + 1, b)]
    # The bottom is a fan to its middle, so that each of its edges is one of a side.
    for edge, _ in edges:
        start = sum(map(len, vertices))
        vertices += [edge * (1, 0, 1) + (0, bottom, 0), np.array([[0, bottom, 0]])]
        normals = np.concatenate([normals, np.tile((0, -1, 0), (n + 1, 1))])
        faces += [(start + j, start + j + 1, start + n) for j in range(cells)]
    return Mesh(np.concatenate(vertices), np.array(faces), normals)


def brilliant(center, axis, radius):
    """A cut stone of flat facets: table, stars, kites, girdle, pavilion. It lies on y = 0, tipped over."""
    circle = lambda n, r, y, shift=0.0: [
        (r * np.cos(2 * np.pi * (i + shift) / n), r * np.sin(2 * np.pi * (i + shift) / n), y) for i in range(n)]
    points = circle(8, 0.56, 0.34) + circle(8, 0.76, 0.22, 0.5) + circle(16, 1, 0.04) + circle(16, 1, 0)
    points += [(0, 0, 0.34), (0, 0, -0.86)]
    table, star, upper, lower = 0, 8, 16, 32
    faces = []
    for i in range(8):
        j, a, b, c = (i + 1) % 8, upper + 2 * i, upper + 2 * i + 1, upper + (2 * i + 2) % 16
        faces += [(48, table + i, table + j), (table + i, star + i, table + j), (star + i, a, b), (star + i, b, c),
                  (table + i, a, star + i), (table + j, star + i, c)]
    for i in range(16):
        j = (i + 1) % 16
        faces += [(upper + i, lower + i, lower + j), (upper + i, lower + j, upper + j), (lower + i, 49, lower + j)]
    vertices = np.array(points) * radius @ frame(axis)
    vertices += (center[0], 0.001 - vertices[:, 1].min(), center[1])
    return Mesh(vertices, np.array(faces))


def box(name, title, medium):
    materials = {"grey": Diffuse(grey(0.5)), "red": Diffuse((0.5, 0.1, 0.1)), "green": Diffuse((0.1, 0.5, 0.1)),
                 "glass": Glass(1.5)}
    sides = dict(floor="grey", ceiling="grey", back="grey", front="grey", left="red", right="green")
    low, high = (-1, 0, -1), (1, 2, 3)
    return Scene(
        name, title, dict(origin=(0, 1, 2.9), target=(0, 1, 0), fov=50), materials,
        walls(low, high, sides) + [Object("ball", Sphere((-0.15, 1, 0), 0.35), "glass")],
        [Lamp("lamp", (0.35, 1.8, 0.15), 0.03, (20, 16, 10), 0.19)], 2.0, (0.15, 0.4, 0.4), medium, (low, high))


def pool():
    materials = {"tiles": Diffuse((0.55, 0.6, 0.6)), "walls": Diffuse((0.5, 0.45, 0.4)),
                 "ball": Diffuse((0.6, 0.2, 0.1)), "water": Glass(1.33, filled=True)}
    low, high = (-1.5, 0, -1.5), (1.5, 2.8, 1.5)
    sides = dict.fromkeys(("back", "front", "left", "right"), "walls") | {"floor": "tiles"}
    return Scene(
        "pool", "A lamp over wavy water, its floor seen through the surface",
        dict(origin=(0, 2.5, 1.35), target=(0, 0.45, -0.25), fov=60), materials,
        walls(low, high, sides, leave_out=("ceiling",)) + [
            Object("ball", Sphere((-0.5, 0.25, -0.4), 0.25), "ball"),
            Object("water", water(1.6, 0.9, -0.1), "water")],
        [Lamp("lamp", (0.5, 2.4, -0.7), 0.03, (60, 56, 48), 0.35)], 1.0, (0.3, 0.3, 0.4),
        Medium((0.3, 0.08, 0.05), (0.12, 0.15, 0.18)), witness="luxcore")


def lantern():
    materials = {"floor": Diffuse(grey(0.4)), "walls": Diffuse(grey(0.2)), "metal": Diffuse(grey(0.05)),
                 "glass": Glass(1.5), "mirror": Mirror(grey(0.9))}
    low, high = (-3, 0, -3), (3, 4, 3)
    sides = dict.fromkeys(("ceiling", "back", "front", "left", "right"), "walls") | {"floor": "floor"}
    at, aim = np.array((-1.7, 3.1, -0.6)), np.array((0.7, 0.4, -0.2))
    axis = (aim - at) / np.linalg.norm(aim - at)
    return Scene(
        "lantern", "A lamp behind a glass lens shines at a mirror ball through fog",
        dict(origin=(0, 1.6, 2.95), target=(-0.2, 1.5, 0), fov=62), materials,
        walls(low, high, sides) + [
            Object("housing", tube(at, axis, 0.26, 0.56), "metal"),
            Object("lens", lens(at + 0.5 * axis, axis, 0.25, 0.5), "glass"),
            Object("ball", Sphere((0.7, 0.4, -0.2), 0.4), "mirror")],
        [Lamp("lamp", tuple(at + 0.12 * axis), 0.025, (200, 180, 140), 0.3)], 2.0, (0.2, 0.1, 0.45),
        Medium(grey(0.01), grey(0.09)), (low, high), witness="luxcore", check_without=("housing",))


def gem():
    materials = {"table": Diffuse(grey(0.6)), "wall": Diffuse((0.3, 0.35, 0.4)), "gem": Glass(2.42),
                 "gold": Mirror((0.95, 0.75, 0.4))}
    return Scene(
        "gem", "A cut stone and a golden ring beside a small lamp, no medium",
        dict(origin=(0, 1.5, 2.2), target=(0.05, 0.1, 0), fov=36), materials,
        walls((-3, 0, -1.5), (3, 3, 3), {"floor": "table", "back": "wall"},
              leave_out=("ceiling", "front", "left", "right")) + [
            Object("gem", brilliant((-0.3, 0.1), (0.75, 0.6, 0.35), 0.32), "gem"),
            Object("ring", ring((0.45, 0.06, 0.05), (0, 1, 0), 0.28, 0.05), "gold")],
        [Lamp("lamp", (0.9, 1.3, -0.9), 0.02, (14, 13, 12), 0.3)], 2.0, (0.1, 0.3, 0.45))


SCENES = {scene.name: scene for scene in [
    box("box-iso", "A glass ball in isotropic fog, a small lamp", Medium(grey(0.1), grey(0.4))),
    box("box-hg", "The same, in fog that scatters forward (g = 0.7)", Medium(grey(0.1), grey(0.4), 0.7)),
    pool(), lantern(), gem()]}


def write_ply(file, mesh):
    """Binary PLY, with normals where the mesh has them."""
    columns = [mesh.vertices] if mesh.normals is None else [mesh.vertices, mesh.normals]
    names = ["x", "y", "z", "nx", "ny", "nz"][:3 * len(columns)]
    head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(mesh.vertices)}"]
    head += [f"property float {name}" for name in names]
    head += [f"element face {len(mesh.faces)}", "property list uchar int vertex_indices", "end_header"]
    faces = np.zeros(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, mesh.faces
    with open(file, "wb") as out:
        out.write(("\n".join(head) + "\n").encode())
        out.write(np.concatenate(columns, 1).astype("<f4").tobytes() + faces.tobytes())
