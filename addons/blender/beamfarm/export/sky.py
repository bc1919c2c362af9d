"""Sky textures: radiance by direction.

Nishita's sky is sunlight that air and dust have scattered once: T. Nishita et al., Display of the Earth taking into
account atmospheric scattering, SIGGRAPH 1993. What the paper leaves open is as in Blender: the profiles of air, dust
and ozone, the dust's numbers, the rim of the sun, the fading below the horizon. Preetham's is a formula fitted to such
skies: A. J. Preetham et al., A practical analytic model for daylight, SIGGRAPH 1999.
"""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .formulas import RGB_OF_XYZ

# Metres.
EARTH, ATMOSPHERE = 6360e3, 6420e3
AIR_SCALE, DUST_SCALE = 8000.0, 1200.0
# Dust at the ground, per metre; its extinction is a little greater than its scattering.
DUST, DUST_EXTINCTION, FORWARD = 2e-5, 1.11, 0.76
STEPS, SUN_STEPS = 32, 16

WAVELENGTHS = np.linspace(380.0, 780.0, 21)
# Colour matching functions of the CIE 1931 standard observer at these wavelengths.
OBSERVER = np.array([
    (0.001368, 0.000039, 0.00645), (0.01431, 0.000396, 0.06785), (0.13438, 0.004, 0.6456), (0.34828, 0.023, 1.74706),
    (0.2908, 0.06, 1.6692), (0.09564, 0.13902, 0.81295), (0.0049, 0.323, 0.272), (0.06327, 0.71, 0.07825),
    (0.2904, 0.954, 0.0203), (0.5945, 0.995, 0.0039), (0.9163, 0.87, 0.00165), (1.0622, 0.631, 0.0008),
    (0.85445, 0.381, 0.00019), (0.4479, 0.175, 0.00002), (0.1649, 0.061, 0.0), (0.04677, 0.017, 0.0),
    (0.011359, 0.004102, 0.0), (0.002899, 0.001047, 0.0), (0.00069, 0.000249, 0.0), (0.000166, 0.00006, 0.0),
    (0.000042, 0.000015, 0.0)])
# Absorption by ozone at these wavelengths, per metre where it is densest: Blender's, rounded, as cross sections of
# 1e-25 m^2 times molecules per cubic metre.
OZONE = np.array([0.006, 0.011, 0.037, 0.136, 0.375, 0.753, 1.19, 1.8, 2.89, 3.9, 4.59, 5.1, 4.01, 2.97, 2.1, 1.37,
                  0.867, 0.617, 0.42, 0.278, 0.314]) * 1e-25 * 5.36e18


def _rayleigh():
    """Scattering by air at the ground, per metre: from its index of refraction, and molecules per cubic metre."""
    index, count = 1.0002926, 2.504e25
    return 8.0 * math.pi**3 * (index**2 - 1.0) ** 2 / (3.0 * count * (WAVELENGTHS * 1e-9) ** 4)


def _sunlight():
    """Irradiance of the sun above the atmosphere, W/(m^2 nm): a black body of 5778 K."""
    metres = WAVELENGTHS * 1e-9
    radiance = 1.191043e-16 / metres**5 / np.expm1(1.438777e-2 / (metres * 5778.0))
    return radiance * math.pi * (695.7e6 / 149.6e9) ** 2 * 1e-9


RAYLEIGH, SUNLIGHT = _rayleigh(), _sunlight()


def _densities(height):
    """Relative densities of air, dust and ozone at a height, each in the units of its coefficients."""
    ozone = np.clip(np.minimum(height - 10e3, 40e3 - height) / 15e3, 0.0, 1.0)
    return np.stack([np.exp(-height / AIR_SCALE), np.exp(-height / DUST_SCALE), ozone], axis=-1)


def _way_out(radius, cos):
    """Length of the path out of the atmosphere from a distance to the Earth's centre, by the cosine to the zenith."""
    return np.sqrt(np.maximum((radius * cos) ** 2 + ATMOSPHERE**2 - radius**2, 0.0)) - radius * cos


def _depths(radius, cos, steps=SUN_STEPS):
    """Amounts of air, dust and ozone on the path out: equivalent lengths at ground density."""
    length = _way_out(radius, cos)
    # Shorter steps at first, where most of it is.
    edges = (np.arange(steps + 1) / steps) ** 2
    total = np.zeros((*np.shape(radius), 3))
    for begin, end in zip(edges, edges[1:]):
        at = length * 0.5 * (begin + end)
        height = np.sqrt(radius**2 + at**2 + 2.0 * radius * at * cos) - EARTH
        total += _densities(height) * (length * (end - begin))[..., None]
    return total


def _color(spectrum):
    return spectrum @ OBSERVER * (WAVELENGTHS[1] - WAVELENGTHS[0])


@lru_cache(maxsize=4)
def _scattered(width, height, elevation, altitude, amounts):
    """XYZ of the upper half of the sky, first row at the horizon, `width` columns from the sun's side to the opposite
    one."""
    amounts = np.array(amounts)
    # Rows are denser at the horizon, where more changes.
    lat = 0.5 * math.pi * (np.arange(height) / (height - 1)) ** 2
    turn = math.pi * np.arange(width) / (width - 1)
    up, along = np.sin(lat)[:, None], np.cos(lat)[:, None] * np.cos(turn)[None, :]
    up = np.broadcast_to(up, along.shape)
    sun_up, sun_along = math.sin(elevation), math.cos(elevation)
    mu = up * sun_up + along * sun_along
    phases = np.stack([3.0 / (16.0 * math.pi) * (1.0 + mu**2), _cornette(mu)])
    origin = EARTH + altitude
    step = _way_out(origin, up[:, 0]) / STEPS
    passed, spectrum = np.zeros((height, 3)), np.zeros((height, width, len(WAVELENGTHS)))
    for i in range(STEPS):
        at = step * (i + 0.5)
        radius = np.sqrt(origin**2 + at**2 + 2.0 * origin * at * up[:, 0])
        density = _densities(radius - EARTH) * amounts
        passed = passed + density * step[:, None]
        # Cosine between the zenith there and the sun.
        cos = ((origin + at[:, None] * up) * sun_up + at[:, None] * along * sun_along) / radius[:, None]
        around = np.broadcast_to(radius[:, None], cos.shape)
        is_lit = (cos > 0.0) | (around**2 * (1.0 - cos**2) > EARTH**2)
        depth = passed[:, None, :] + _depths(around, cos) * amounts
        left = np.exp(-_extinction(depth)) * is_lit[..., None]
        sent = RAYLEIGH * (density[:, None, :1] * phases[0][..., None])
        sent = sent + DUST * (density[:, None, 1:2] * phases[1][..., None])
        spectrum += left * sent * step[:, None, None]
    return lat, turn, _color(spectrum * SUNLIGHT)


def _cornette(mu):
    """W. M. Cornette and J. G. Shanks, Applied Optics 31(16), 1992."""
    g = FORWARD * FORWARD
    shape = (1.0 + mu**2) / (1.0 + g - 2.0 * FORWARD * mu) ** 1.5
    return 3.0 * (1.0 - g) / (8.0 * math.pi * (2.0 + g)) * shape


def _extinction(depth):
    return depth[..., :1] * RAYLEIGH + depth[..., 1:2] * (DUST_EXTINCTION * DUST) + depth[..., 2:] * OZONE


@dataclass(frozen=True)
class Nishita:
    """A single-scattering sky."""

    elevation: float
    rotation: float
    """From +y to +x."""
    altitude: float
    amounts: tuple
    """Amounts of air, dust and ozone, with 1 for the Earth's."""
    disc: float = 0.0
    """Intensity of the visible sun; 0 for none."""
    size: float = 0.009512
    """The sun's angular diameter."""

    @property
    def sun(self):
        """Unit vector towards the sun."""
        level = math.cos(self.elevation)
        return np.array([level * math.sin(self.rotation), level * math.cos(self.rotation), math.sin(self.elevation)])

    def rows(self):
        """How many rows a panorama needs."""
        wanted = ROWS if self.disc == 0.0 else 3.0 * math.pi / self.size
        return next((rows for rows in (ROWS, 2 * ROWS) if rows >= wanted), 4 * ROWS)

    def radiance(self, directions):
        """RGB for unit vectors, (..., 3)."""
        directions = np.asarray(directions, dtype=np.float64)
        up = directions[..., 2]
        latitudes, turns, table = _scattered(96, 64, self.elevation, self.altitude, self.amounts)
        turn = np.arctan2(directions[..., 0], directions[..., 1]) - self.rotation
        turn = np.abs((turn + math.pi) % (2.0 * math.pi) - math.pi)
        latitude = np.arcsin(np.clip(up, 0.0, 1.0))
        xyz = _between(table, np.sqrt(latitude / (0.5 * math.pi)) * (len(latitudes) - 1),
                       turn / math.pi * (len(turns) - 1))
        # Below the horizon it fades, as there is no ground.
        fade = np.where(up < 0.0, np.clip(1.0 + 2.5 * up, 0.0, 1.0) ** 3, 1.0)
        return np.maximum(xyz @ RGB_OF_XYZ.T, 0.0) * fade[..., None]

    def disc_radiance(self, directions):
        """RGB of the sun's disc, darker at its rim, and redder at its lower edge than at its upper one."""
        directions = np.asarray(directions, dtype=np.float64)
        half = 0.5 * self.size
        share = np.arccos(np.clip(directions @ self.sun, -1.0, 1.0)) / half
        low, high = (self._sunlight(max(self.elevation + side * half, 0.0)) for side in (-1.0, 1.0))
        over = np.clip((np.arcsin(np.clip(directions[..., 2], -1.0, 1.0)) - self.elevation) / self.size + 0.5, 0.0, 1.0)
        color = low + over[..., None] * (high - low)
        rim = 1.0 - 0.6 * (1.0 - np.sqrt(np.maximum(1.0 - share**2, 0.0)))
        is_sun = (share < 1.0) & (directions[..., 2] >= 0.0)
        return np.where(is_sun[..., None], color * rim[..., None] * self.disc, 0.0)

    def _sunlight(self, elevation):
        # As in Blender, ozone does not dim the disc.
        amounts = np.array([*self.amounts[:2], 0.0])
        depth = _depths(np.array(EARTH + self.altitude), math.sin(elevation), 128) * amounts
        solid_angle = 2.0 * math.pi * (1.0 - math.cos(0.5 * self.size))
        color = _color(np.exp(-_extinction(depth)) * SUNLIGHT / solid_angle)
        return np.maximum(color @ RGB_OF_XYZ.T, 0.0)


@dataclass(frozen=True)
class Preetham:
    """A sky from a formula."""

    sun: tuple
    turbidity: float

    def rows(self):
        return ROWS

    def radiance(self, directions):
        """RGB for unit vectors, (..., 3)."""
        directions = np.asarray(directions, dtype=np.float64)
        t = self.turbidity
        sun = np.array(self.sun)
        angle = math.acos(min(max(sun[2], -1.0), 1.0))
        chi = (4.0 / 9.0 - t / 120.0) * (math.pi - 2.0 * angle)
        # From thousands of cd/m^2 to Cycles' units.
        zenith_Y = ((4.0453 * t - 4.9710) * math.tan(chi) - 0.2155 * t + 2.4192) * 0.06
        powers = np.array([angle**3, angle**2, angle, 1.0])
        squares = np.array([t * t, t, 1.0])
        zenith = [zenith_Y, squares @ PREETHAM_X @ powers, squares @ PREETHAM_Y @ powers]
        theta = np.minimum(np.arccos(np.clip(directions[..., 2], -1.0, 1.0)), 0.5 * math.pi - 0.001)
        gamma = np.arccos(np.clip(directions @ sun, -1.0, 1.0))
        luminance, x, y = (
            value * _perez(parts, np.cos(theta), gamma) / _perez(parts, 1.0, angle)
            for value, parts in zip(zenith, PEREZ @ np.array([t, 1.0])))
        xyz = np.stack([luminance * x / y, luminance, luminance * (1.0 - x - y) / y], axis=-1)
        return np.maximum(xyz @ RGB_OF_XYZ.T, 0.0)


# By turbidity: the distribution of luminance, x and y over the sky.
PEREZ = np.array([
    [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)],
    [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)],
    [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)]])
# Chromaticity of the zenith: rows by powers of turbidity, columns by powers of the sun's zenith angle.
PREETHAM_X = np.array([(0.00166, -0.00375, 0.00209, 0.0), (-0.02903, 0.06377, -0.03202, 0.00394),
                       (0.11693, -0.21196, 0.06052, 0.25886)])
PREETHAM_Y = np.array([(0.00275, -0.00610, 0.00317, 0.0), (-0.04214, 0.08970, -0.04153, 0.00516),
                       (0.15346, -0.26756, 0.06670, 0.26688)])


def _perez(parts, cos, gamma):
    a, b, c, d, e = parts
    return (1.0 + a * np.exp(b / cos)) * (1.0 + c * np.exp(d * gamma) + e * np.cos(gamma) ** 2)


def sky_of(node):
    """The sky of a Sky Texture; None for an unknown kind."""
    if node.sky_type in ("NISHITA", "SINGLE_SCATTERING", "MULTIPLE_SCATTERING"):
        dust = node.dust_density if hasattr(node, "dust_density") else node.aerosol_density
        disc = node.sun_intensity if node.sun_disc else 0.0
        return Nishita(node.sun_elevation, node.sun_rotation, min(max(node.altitude, 1.0), 59999.0),
                       (node.air_density, dust, node.ozone_density), disc, max(node.sun_size, 1e-4))
    if node.sky_type == "PREETHAM":
        sun = np.array(node.sun_direction, dtype=np.float64)
        length = float(np.linalg.norm(sun))
        return Preetham(tuple(sun / length) if length else (0.0, 0.0, 1.0), node.turbidity)
    return None


# Rows of a picture of the sky without its sun.
ROWS = 256
# Samples along each side of a pixel that the sun's rim crosses.
FINE = 8


@lru_cache(maxsize=2)
def picture(sky):
    """A panorama of the sky in Cycles' layout, +x in the middle and +y a quarter from the left: bottom row first."""
    return with_sun(sky.radiance(_pixels(ROWS)), sky)


def with_sun(values, sky):
    """Adds the sun to a picture of a sky without it."""
    height = max(sky.rows(), len(values))
    if height > len(values):
        # It is smooth apart from the sun.
        times = height // len(values)
        values = _finer(_finer(values, times, axis=0), times, axis=1)
    if getattr(sky, "disc", 0.0) > 0.0:
        reach = math.cos(min(0.5 * sky.size + 2.0 * math.pi / height, math.pi))
        rows, columns = np.nonzero(_pixels(height) @ sky.sun > reach)
        fine = (np.arange(FINE) + 0.5) / FINE
        y, x = rows[:, None, None] + fine[:, None], columns[:, None, None] + fine[None, :]
        values[rows, columns] += sky.disc_radiance(_around(y, x, height)).mean(axis=(1, 2))
    return values.astype(np.float32)


def _pixels(height):
    """Directions of all pixel centres."""
    return _around(np.arange(height)[:, None] + 0.5, np.arange(2 * height)[None, :] + 0.5, height)


def _finer(values, times, axis):
    """Multiplies the number of pixels along an axis, with linear interpolation."""
    count = values.shape[axis]
    at = np.clip((np.arange(count * times) + 0.5) / times - 0.5, 0.0, count - 1.0)
    first = np.minimum(at.astype(int), count - 2)
    share = (at - first).reshape([-1 if i == axis else 1 for i in range(values.ndim)])
    return np.take(values, first, axis) * (1.0 - share) + np.take(values, first + 1, axis) * share


def _around(y, x, height):
    latitude, turn = (y / height - 0.5) * math.pi, math.pi * (1.0 - x / height)
    level = np.cos(latitude)
    up = np.broadcast_to(np.sin(latitude), np.broadcast_shapes(np.shape(y), np.shape(x)))
    return np.stack([level * np.cos(turn), level * np.sin(turn), up], axis=-1)


def _between(table, y, x):
    """Bilinear look-up by rows and columns."""
    y, x = np.clip(y, 0.0, table.shape[0] - 1.0), np.clip(x, 0.0, table.shape[1] - 1.0)
    y0, x0 = np.minimum(y.astype(int), table.shape[0] - 2), np.minimum(x.astype(int), table.shape[1] - 2)
    fy, fx = (y - y0)[..., None], (x - x0)[..., None]
    low = table[y0, x0] * (1.0 - fx) + table[y0, x0 + 1] * fx
    high = table[y0 + 1, x0] * (1.0 - fx) + table[y0 + 1, x0 + 1] * fx
    return low * (1.0 - fy) + high * fy
