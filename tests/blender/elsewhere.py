"""Renders every .blend of a folder by Cycles and by beamfarm, and prints a table of how they differ.

    BEAMFARM=target/release/beamfarm PYTHON_WITH_BPY elsewhere.py FOLDER… [--keep OUT] [--width 320] [--time 20]

Both render as F12 does, at the file's own frame and camera, without the file's compositor and sequencer. Cycles gets
many bounces, a box filter and no clamping, as in `compare.use_cycles`. For each file it prints what the add-on left out
and noted; the ratio of the means beamfarm / Cycles by channel, with its standard error; and how far blocks of 8 x 8
pixels are apart: the median and the 90th percentile of |beamfarm - Cycles| over the mean. OUT holds the pictures side
by side, Cycles on the left, and on the right their difference: red where beamfarm is brighter, blue where Cycles is,
white at the mean of Cycles' picture.

Errors come from two independent pictures each. A file that crashes Blender does not end the rest.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import apart

RUNS = 2


def render(path: Path, arguments: argparse.Namespace, keep: Path) -> dict:
    """Renders one file in this process. Returns what to print about it."""
    import harness
    import bpy
    import compare
    import numpy as np

    harness.install()
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    harness.install()
    scene = bpy.context.scene
    said = {"version": ".".join(str(part) for part in bpy.data.version), "left_out": [], "notes": []}
    if scene.camera is None:
        return said | {"refused": "no camera"}
    render = scene.render
    width, height = render.resolution_x, render.resolution_y
    percentage = 100.0 * arguments.width / max(width, height)
    width, height = (max(1, round(size * percentage / 100.0)) for size in (width, height))
    compare.use_cycles(width, height, arguments.samples)
    render.use_compositing = render.use_sequencer = False
    scene.cycles.time_limit = 0.0
    images = {"CYCLES": [], "BEAMFARM": []}
    scene.beamfarm.passes, scene.beamfarm.time_limit = 0, arguments.time / RUNS
    with tempfile.TemporaryDirectory() as folder:
        # Ours first: what it refuses need not be rendered.
        for engine in ("BEAMFARM", "CYCLES"):
            render.engine = engine
            for seed in range(RUNS):
                scene.cycles.seed = scene.beamfarm.seed = seed + 1
                render.filepath = str(Path(folder) / f"{engine}{seed}.exr")
                try:
                    bpy.ops.render.render(write_still=True)
                except RuntimeError as error:
                    return said | {"refused": str(error).strip()}
                finally:
                    told = harness.module("told").of(scene.name)
                    if told is not None:
                        said |= {"left_out": told.left_out, "notes": told.notes}
                images[engine].append(compare.read(render.filepath))
    ours, theirs = (compare.Estimate.of(images[engine]) for engine in ("BEAMFARM", "CYCLES"))
    compared = compare.Comparison(path.stem, ours, theirs, None)
    mean = max(float(theirs.mean.mean()), 1e-12)
    off = np.abs(ours.blocks - theirs.blocks).mean(-1) / mean
    noise = float(np.median(np.hypot(ours.block_error, theirs.block_error))) / mean
    _picture(apart.beside(keep, ".png"), theirs.mean, ours.mean)
    return said | {
        "mean": theirs.mean.mean((0, 1)).tolist(),
        "ratio": compared.ratio.tolist(),
        "error": compared.ratio_error.tolist(),
        "blocks": [float(np.percentile(off, share)) for share in (50, 90)],
        "noise": noise,
    }


def _picture(path: Path, theirs, ours) -> None:
    """A PNG of both and of their difference at one exposure, for inspection."""
    import bpy
    import numpy as np

    light = max(float(np.percentile(theirs.mean(-1), 95)), 1e-6)
    difference = (ours - theirs).mean(-1) / max(float(theirs.mean()), 1e-12)
    red, blue = np.clip(difference, 0.0, 1.0), np.clip(-difference, 0.0, 1.0)
    shown = np.stack([red, np.minimum(np.abs(difference) * 0.3, 1.0), blue], -1)
    encoded = [np.clip(image / light, 0.0, 1.0) ** (1.0 / 2.2) for image in (theirs, ours)]
    pixels = np.concatenate([*encoded, shown], axis=1)[::-1]
    pixels = np.concatenate([pixels, np.ones_like(pixels[..., :1])], -1).astype(np.float32)
    image = bpy.data.images.new("side by side", pixels.shape[1], pixels.shape[0])
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()


def _line(name: str, found: dict) -> str:
    if "ratio" not in found:
        return f"{name:44} {found.get('version', ''):8} REFUSED: {found['refused']}"
    ratio = " ".join(f"{value:6.3f}" for value in found["ratio"])
    blocks = " ".join(f"{100.0 * value:5.1f} %" for value in found["blocks"])
    errors = f"+-{max(found['error']):.3f}"
    told = f"left out {len(found['left_out'])}, notes {len(found['notes'])}"
    return f"{name:44} {found['version']:8} {ratio} {errors}  {blocks} (noise {100.0 * found['noise']:.1f} %)  {told}"


def main() -> None:
    parser = apart.parser(__doc__)
    parser.add_argument("--width", type=int, default=320, help="pixels of the longer side")
    parser.add_argument("--time", type=float, default=20.0, help="seconds of beamfarm for each file")
    parser.add_argument("--samples", type=int, default=64, help="of Cycles, twice for each file")
    parser.add_argument("--patience", type=float, default=600.0, help="seconds after which a file is given up")
    arguments = parser.parse_args()
    options = ["--width", str(arguments.width), "--time", str(arguments.time), "--samples", str(arguments.samples)]
    for name, found in apart.each(arguments, render, __file__, options, arguments.patience):
        print(_line(name, found), flush=True)
        for kind in ("left_out", "notes"):
            for line in found.get(kind, ()):
                print(f"    {kind.replace('_', ' ')}: {line}", flush=True)


if __name__ == "__main__":
    main()
