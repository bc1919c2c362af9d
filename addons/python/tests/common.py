"""Scenes for the tests."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import beamfarm

TOP = Path(__file__).resolve().parents[3]

# A glass ball in fog, lit by a small lamp: photons, beams and paths.
FOG: dict[str, Any] = {
    "image": {"width": 48, "height": 32},
    "render": {"passes": 4, "paths": 2000},
    "camera": {"origin": [0, 1, 4], "target": [0, 0.5, 0], "fov": 40},
    "media": {"fog": {"type": "homogeneous", "sigma_s": 0.1, "sigma_a": 0.0}},
    "world": {"medium": "fog"},
    "materials": {
        "glass": {"type": "dielectric", "ior": 1.5},
        "floor": {"type": "diffuse", "reflectance": [0.6, 0.5, 0.4]},
    },
    "shapes": [
        {"name": "ball", "type": "sphere", "center": [0, 0.5, 0], "radius": 0.5, "material": "glass"},
        {
            "name": "ground",
            "type": "rectangle",
            "material": "floor",
            "transform": [{"rotate": {"axis": [1, 0, 0], "angle": -90}}, {"scale": 4.0}],
        },
    ],
    "lights": [{"name": "lamp", "type": "point", "position": [1, 3, 1], "power": 50.0}],
}


def view(width: int = 32, height: int = 32) -> dict[str, Any]:
    """The square [-1, 1] x [-1, 1] of the xy plane, seen along z from above, without perspective."""
    return {
        "image": {"width": width, "height": height},
        "render": {"paths": 1},
        "camera": {
            "projection": "orthographic",
            "origin": [0, 0, 10],
            "target": [0, 0, 0],
            "up": [0, 1, 0],
            "view_width": 2.0,
        },
        "lights": [{"type": "point", "position": [0, 0, 9], "power": 1.0}],
        "materials": {},
        "shapes": [],
    }


def command(*arguments: Any) -> str:
    """The output of the command, which has to succeed."""
    done = subprocess.run(
        [beamfarm.program(), *map(str, arguments)], capture_output=True, text=True, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout
