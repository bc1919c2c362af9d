#!/usr/bin/env python3
"""Measures the package: python measure.py SCENE [--passes N] [--turns T]

Measures how long a million triangles and a million voxels take to become part of a scene, and compares `render` with
the command, in turns. The package has to be importable, and the machine should have nothing else to do.
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import beamfarm


def seconds(work: Callable[[], object]) -> float:
    begun = time.perf_counter()
    work()
    return time.perf_counter() - begun


def arrays() -> None:
    """Arrays of a million elements, until the scene is decoded and checked."""
    side = 708
    x, y = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side), indexing="ij")
    vertices = np.stack([x, y, 0.1 * np.sin(5 * x)], axis=-1).reshape(-1, 3).astype(np.float32)
    index = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    voxels = np.random.default_rng(0).random((100, 100, 100), dtype=np.float32)
    scene = beamfarm.Scene(
        {
            "image": {"width": 64, "height": 48},
            "camera": {"origin": [0, -3, 2], "target": [0, 0, 0], "fov": 40},
            "lights": [{"type": "point", "position": [2, -2, 3], "power": 100}],
        }
    )
    with_mesh, with_grid = scene.copy(), scene.copy()

    def mesh() -> None:
        with_mesh["shapes"] = [{"type": "mesh", "file": beamfarm.Mesh(vertices, faces)}]
        with_mesh.check()

    def grid() -> None:
        density = {"file": beamfarm.Grid(voxels)}
        with_grid["media"] = {"m": {"type": "heterogeneous", "sigma_t": 1.0, "albedo": 0.5, "density": density}}
        with_grid["world"] = {"medium": "m"}
        with_grid.check()

    print(f"{len(faces)} triangles: {seconds(mesh):.2f} s")
    print(f"{voxels.size} voxels: {seconds(grid):.2f} s")


def overhead(scene: Path, passes: int, turns: int) -> None:
    """Time of `render` over that of the command, in turns; both write an EXR and a PNG."""
    ratios = []
    with tempfile.TemporaryDirectory() as folder:
        image = Path(folder) / "a.exr"

        def command() -> None:
            arguments = ["render", str(scene), "--passes", str(passes), "-o", str(image), "--quiet"]
            subprocess.run([str(beamfarm.program()), *arguments], check=True, stdout=subprocess.DEVNULL)

        def package() -> None:
            rendered = beamfarm.render(scene, passes=passes, progress=False)
            rendered.save(image)
            rendered.save(image.with_suffix(".png"))

        for turn in range(turns):
            order = [command, package] if turn % 2 == 0 else [package, command]
            times = {work.__name__: seconds(work) for work in order}
            ratios.append(times["package"] / times["command"])
            print(f"command {times['command']:.2f} s, package {times['package']:.2f} s")
    error = statistics.stdev(ratios) / len(ratios) ** 0.5 if turns > 1 else float("nan")
    print(f"package over command: {statistics.mean(ratios):.4f}, standard error {error:.4f}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("--passes", type=int, default=32)
    parser.add_argument("--turns", type=int, default=8)
    given = parser.parse_args()
    arrays()
    overhead(given.scene, given.passes, given.turns)


if __name__ == "__main__":
    main()
