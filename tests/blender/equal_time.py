"""Renders .blend files by Cycles and by beamfarm for the same time, and prints how far each is from a long reference.

    BEAMFARM=target/release/beamfarm PYTHON_WITH_BPY equal_time.py FILE… [--time 30] [--reference 120] [--keep OUT]

Everything renders as F12 does, at the file's own frame and camera, on the CPU, one after the other, without the file's
compositor and sequencer. Cycles uses the file's own settings of bounces, clamping and caustics, no denoiser, and as
many samples as the time allows. The reference is Cycles as a plain path tracer (`compare.use_cycles`) in two halves of
different seeds, or with --ours beamfarm: for light that Cycles does not find.

Printed for each picture:
- the ratio of its mean to the reference's, with the standard error for independent pixels;
- the mean over channels and pixels of (x - y)^2 / (y^2 + 0.01), as in `beamfarm compare`;
- the same less the reference's own noise, and without the picture's 0.1 % brightest pixels;
- how much of that error is noise, from a second picture of another seed: the rest is what the two show differently,
  such as coincident faces, which are black in Cycles;
- the seconds that the first picture took in all.
For the reference it prints the noise, from its halves, and, since variance falls with time, the noise of a plain path
tracer in the same time as the others.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import apart

BRIGHTEST = 1e-3


def measured(picture, reference) -> dict:
    """The figures for one picture against the reference."""
    import numpy as np

    errors = ((picture - reference) ** 2 / (reference**2 + 0.01)).mean(-1).ravel()
    order = np.argsort(picture.mean(-1).ravel())
    kept = order[: len(order) - int(np.ceil(BRIGHTEST * len(order)))]
    off = (picture - reference).mean(-1)
    mean = max(float(reference.mean()), 1e-12)
    return {
        "ratio": float(picture.mean()) / mean,
        "ratio_error": float(off.std()) / off.size**0.5 / mean,
        "channels": (picture.mean((0, 1)) / np.maximum(reference.mean((0, 1)), 1e-12)).tolist(),
        "error": float(errors.mean()),
        "error_without_brightest": float(errors[kept].mean()),
    }


def noise(picture, again, reference) -> float:
    """The part of a picture's error that changes with the seed."""
    return float(((picture - again) ** 2 / (2.0 * (reference**2 + 0.01))).mean())


def render(path: Path, arguments: argparse.Namespace, keep: Path) -> dict:
    """One file, in this process."""
    import harness
    import bpy
    import compare
    import numpy as np

    harness.install()
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    harness.install()
    scene = bpy.context.scene
    if scene.camera is None:
        return {"refused": "no camera"}
    said = {"left_out": [], "notes": []}
    sizes = scene.render.resolution_x, scene.render.resolution_y
    width, height = (max(1, round(size * arguments.width / max(sizes))) for size in sizes)
    cycles, own = scene.cycles, scene.beamfarm
    names = (
        "sample_clamp_direct", "sample_clamp_indirect", "blur_glossy", "caustics_reflective", "caustics_refractive",
        "light_sampling_threshold", "max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces",
        "volume_bounces", "transparent_max_bounces", "use_adaptive_sampling", "adaptive_threshold", "use_fast_gi",
    )
    of_file = {name: getattr(cycles, name) for name in names}
    compare.use_cycles(width, height, 1 << 24)
    scene.render.use_compositing = scene.render.use_sequencer = False
    plain = {name: getattr(cycles, name) for name in names}
    own.passes = 0

    def picture(name: str, engine: str, seconds: float, seed: int, settings: dict):
        for key, value in settings.items():
            setattr(cycles, key, value)
        scene.render.engine = engine
        cycles.seed = own.seed = seed
        cycles.time_limit = own.time_limit = seconds
        scene.render.filepath = str(keep.with_name(f"{keep.name}-{name}.exr"))
        start = time.monotonic()
        bpy.ops.render.render(write_still=True)
        took = time.monotonic() - start
        told = harness.module("told").of(scene.name)
        if engine == "BEAMFARM" and told is not None:
            said.update(left_out=told.left_out, notes=told.notes)
        return compare.read(scene.render.filepath), took

    try:
        ours, our_time = picture("ours", "BEAMFARM", arguments.time, 1, {})
        again, _ = picture("ours-again", "BEAMFARM", arguments.time, 5, {})
    except RuntimeError as error:
        return {"refused": str(error).strip()}
    theirs, their_time = picture("cycles", "CYCLES", arguments.time, 1, of_file)
    theirs_again, _ = picture("cycles-again", "CYCLES", arguments.time, 5, of_file)
    engine = "BEAMFARM" if arguments.ours else "CYCLES"
    halves = [picture(f"reference{i}", engine, arguments.reference / 2.0, 2 + i, plain)[0] for i in range(2)]
    reference = np.mean(halves, 0)
    spread = measured(reference + 0.5 * (halves[0] - halves[1]), reference)
    return said | {
        "mean": float(reference.mean()),
        "beamfarm": measured(ours, reference) | {"noise": noise(ours, again, reference), "seconds": our_time},
        "Cycles": measured(theirs, reference) | {"noise": noise(theirs, theirs_again, reference), "seconds": their_time},
        "reference": spread | {"by": engine, "in_time": spread["error"] * arguments.reference / arguments.time},
    }


def _rows(name: str, found: dict) -> list[str]:
    if "mean" not in found:
        return [f"{name:40} REFUSED: {found['refused']}"]
    rows, of_reference = [], found["reference"]["error"]
    for who in ("beamfarm", "Cycles"):
        of = found[who]
        numbers = (of["error"], of["error"] - of_reference, of["error_without_brightest"], of["noise"])
        errors = " ".join(f"{number:10.2e}" for number in numbers)
        label = name if who == "beamfarm" else ""
        rows.append(f"{label:40} {who:9} {of['ratio']:7.4f} +-{of['ratio_error']:.4f} {errors} {of['seconds']:6.1f} s")
    of = found["reference"]
    rows.append(f"{'':40} reference         +-{of['ratio_error']:.4f} {of_reference:10.2e}, in the time of the others "
                f"{of['in_time']:.2e}, by {of['by']}")
    rows += [f"    {kind.replace('_', ' ')}: {line}" for kind in ("left_out", "notes") for line in found[kind]]
    return rows


def main() -> None:
    parser = apart.parser(__doc__)
    parser.add_argument("--width", type=int, default=240, help="pixels of the longer side")
    parser.add_argument("--time", type=float, default=30.0, help="seconds of each of the two")
    parser.add_argument("--reference", type=float, default=120.0, help="seconds of the reference")
    parser.add_argument("--ours", action="store_true", help="the reference is beamfarm's")
    arguments = parser.parse_args()
    options = ["--width", str(arguments.width), "--time", str(arguments.time), "--reference", str(arguments.reference)]
    options += ["--ours"] if arguments.ours else []
    header = f"{'':40} {'':9} {'ratio of means':16} {'relMSE':>10} {'less noise':>10} {'w/o 0.1 %':>10} {'noise':>10}"
    if arguments.one is None:
        print(header, flush=True)
    patience = 10.0 * (arguments.time + arguments.reference)
    for name, found in apart.each(arguments, render, __file__, options, patience):
        print("\n".join(_rows(name, found)), flush=True)


if __name__ == "__main__":
    main()
