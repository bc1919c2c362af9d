"""Writes the images of the example scenes into its own folder: `python3 make_images.py`. Needs only Python.

sky.png, a clear evening sky in latitude and longitude whose bottom half is ground; three paintings of colours and
shapes; slit-upright.png, white, twenty times as tall as it is wide.
"""
import math
import pathlib
import random
import struct
import zlib

FOLDER = pathlib.Path(__file__).resolve().parent


def write(name, width, height, colour):
    """Writes an sRGB PNG of `colour(x, y)`: linear, from 0 to 1, at pixel centres; y is 0 at the top and 1 at the
    bottom."""

    def byte(value):
        value = min(max(value, 0.0), 1.0)
        return round(255 * (12.92 * value if value < 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055))

    rows = b""
    for row in range(height):
        # Every pixel as its difference from the one to the left.
        pixels = [[byte(c) for c in colour((column + 0.5) / width, (row + 0.5) / height)] for column in range(width)]
        left = [[0, 0, 0], *pixels[:-1]]
        rows += b"\x01" + bytes((a - b) % 256 for p, q in zip(pixels, left) for a, b in zip(p, q))

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
    (FOLDER / name).write_bytes(b"\x89PNG\r\n\x1a\n" + data)


def mix(a, b, t):
    t = min(max(t, 0.0), 1.0)
    return [p + (q - p) * t for p, q in zip(a, b)]


def sky(x, y):
    """Lighter and warmer near the horizon and near the sun, which stands at x = 0.75 but is not in the image."""
    elevation = 90 * (1 - 2 * y)
    if elevation < -8:
        return [0.10, 0.11, 0.08]
    warm = (0.5 + 0.5 * math.cos(2 * math.pi * (x - 0.75))) ** 2
    horizon = mix([0.50, 0.56, 0.66], [1.0, 0.72, 0.44], warm)
    return mix(horizon, [0.13, 0.25, 0.52], 1 - math.exp(-max(elevation, 0) / (12 + 8 * warm)))


def evening(x, y):
    colour = mix([0.02, 0.05, 0.18], [0.95, 0.42, 0.08], (y / 0.62) ** 2)
    if y > 0.62 + 0.02 * math.sin(9 * x):
        colour = mix([0.25, 0.10, 0.06], [0.02, 0.03, 0.07], (y - 0.62) / 0.3)
    if math.hypot(1.4 * (x - 0.62), y - 0.52) < 0.11 and y < 0.61:
        colour = [1.0, 0.78, 0.30]
    if y > 0.8 + 0.1 * math.sin(4 * x + 2):
        colour = [0.01, 0.015, 0.02]
    return colour


def leaves(x, y):
    colour = mix([0.75, 0.70, 0.55], [0.62, 0.55, 0.40], y)
    dice = random.Random(3)
    for _ in range(46):
        cx, cy, turn, size = dice.random(), dice.random(), dice.random() * math.pi, 0.07 + 0.1 * dice.random()
        tint = mix([0.05, 0.20, 0.06], [0.55, 0.45, 0.05], dice.random())
        u = (x - cx) * math.cos(turn) + (y - cy) * math.sin(turn)
        v = (y - cy) * math.cos(turn) - (x - cx) * math.sin(turn)
        if abs(u) < size and abs(v) < 0.35 * size * (1 - (u / size) ** 2):
            colour = [c * (0.75 if v > 0 else 1.0) for c in tint]
    return colour


def squares(x, y):
    colour = [0.80, 0.76, 0.68]
    for left, top, right, bottom, tint in [
        (0.06, 0.08, 0.55, 0.47, [0.62, 0.06, 0.03]),
        (0.40, 0.36, 0.93, 0.72, [0.03, 0.10, 0.36]),
        (0.14, 0.60, 0.48, 0.93, [0.85, 0.50, 0.03]),
        (0.66, 0.12, 0.84, 0.30, [0.03, 0.03, 0.03]),
        (0.62, 0.80, 0.93, 0.90, [0.10, 0.35, 0.22]),
    ]:
        if left < x < right and top < y < bottom:
            colour = tint
    return colour


write("sky.png", 64, 64, sky)
write("evening.png", 96, 72, evening)
write("leaves.png", 72, 96, leaves)
write("squares.png", 96, 72, squares)
write("slit-upright.png", 2, 40, lambda x, y: [1.0] * 3)
