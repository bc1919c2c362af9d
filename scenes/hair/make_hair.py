"""Writes pompon.ply: curves of a tuft that stands out from the ball of radius 0.3 around the origin. Needs numpy.

    python3 scenes/hair/make_hair.py
"""

from pathlib import Path

import numpy as np

CURVES, POINTS = 2600, 6


def main():
    draw = np.random.default_rng(7)
    number = np.arange(CURVES) + 0.5
    # Fibonacci's lattice on the sphere.
    z = 1.0 - 2.0 * number / CURVES
    turn = number * 2.399963
    across = np.sqrt(1.0 - z * z)
    out = np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)
    # Strands of a lock lean the same way.
    locks = draw.normal(size=(60, 3))
    lock = np.argmax(out @ (locks / np.linalg.norm(locks, axis=1)[:, None]).T, axis=1)
    lean = 0.5 * draw.normal(size=(60, 3))[lock] + 0.25 * draw.normal(size=(CURVES, 3))
    points = np.empty((CURVES, POINTS, 4), dtype="<f4")
    at = 0.3 * out
    step = 0.62 / (POINTS - 1) * (0.8 + 0.2 * draw.random(CURVES))[:, None]
    for i in range(POINTS):
        along = i / (POINTS - 1)
        points[:, i, :3] = at
        points[:, i, 3] = 0.0042 * (1.0 - 0.7 * along)
        way = out + lean * along + [0.0, -0.5 * along, 0.0]
        at = at + step * way / np.linalg.norm(way, axis=1)[:, None]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {CURVES * POINTS}"]
    header += [f"property float {name}" for name in ("x", "y", "z", "radius")]
    header += [f"element curve {CURVES}", "property uchar vertices", "end_header", ""]
    counts = np.full(CURVES, POINTS, dtype="u1")
    content = "\n".join(header).encode("ascii") + points.tobytes() + counts.tobytes()
    Path(__file__).with_name("pompon.ply").write_bytes(content)


if __name__ == "__main__":
    main()
