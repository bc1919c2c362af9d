#!/usr/bin/env python3
"""Renders Mitsuba scenes with Mitsuba 3 and with beamfarm, and prints how far apart the pictures are.

    pip install mitsuba numpy
    cargo build --release
    python tests/mitsuba/compare.py                           # the scenes next to this file, against their references
    python tests/mitsuba/compare.py --seconds 60 my.xml ...   # any scenes, against Mitsuba itself
    python tests/mitsuba/compare.py --write --seconds 300     # make the references anew
    python tests/mitsuba/compare.py --points --seconds 10     # what Mitsuba reaches in that time, for bench.toml

Mitsuba needs an LLVM library for its fast variants: if it does not find one, set DRJIT_LIBLLVM_PATH.

Printed for each scene, over linear RGB:
  mean ratio   beamfarm / Mitsuba by channel, +- its standard error
  relMSE       mean of (x - ref)^2 / (ref^2 + 0.01), less the noise of both
  block        the 8 x 8 block whose mean is off by most: per cent of the reference, and standard errors

A reference is an EXR with R, G, B, the mean of many independent renders, and stderr.R, .G, .B: the standard error of
the mean of the 8 x 8 block that the pixel is in. (A pixel's own would not do: reconstruction filters correlate
neighbours.)
"""

import argparse
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
BLOCK = 8
RUNS = 8


def blocks(image):
    """Means of the 8 x 8 blocks of an image."""
    h, w = (n // BLOCK * BLOCK for n in image.shape[:2])
    return image[:h, :w].reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK, -1).mean((1, 3))


class Estimate:
    """Mean of independent images, with the standard errors of pixels, blocks and the whole."""

    def __init__(self, images):
        n = len(images)
        self.mean = np.mean(images, 0)
        error = lambda values: np.std(values, 0, ddof=1) / np.sqrt(n)
        self.pixel_error = error(images)
        self.block_error = error([blocks(i) for i in images])
        self.whole_error = error([i.mean((0, 1)) for i in images])


def with_mitsuba(xml, seconds):
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb" if "llvm_ad_rgb" in mi.variants() else "scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    scene = mi.load_file(str(xml))
    # The length of a run is chosen so that there are enough runs for a standard error.
    spp, images, begun = 16, [], time.time()
    while len(images) < 16 or time.time() - begun < seconds:
        started = time.time()
        image = np.array(mi.render(scene, spp=spp, seed=len(images) + 1), dtype=np.float64)[..., :3]
        if not np.isfinite(image).all():
            sys.exit(f"{xml}: Mitsuba's image is not finite")
        if not images and time.time() - started < seconds / 64:
            spp *= 2
            continue
        images.append(image)
    return Estimate(images)


def with_beamfarm(program, xml, passes):
    images = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(RUNS):
            file = f"{folder}/{seed}.exr"
            command = [program, "render", str(xml), "-o", file, "--quiet", "--seed", str(seed)]
            command += ["--passes", str(passes)]
            subprocess.run(command, check=True)
            images.append(read(file)[0])
    return Estimate(images)


def read(file):
    """R, G, B of an EXR, and its stderr layer if it has one."""
    import mitsuba as mi

    if not mi.variant():
        mi.set_variant("scalar_rgb")
    bitmap = mi.Bitmap(str(file))
    names = [field.name for field in bitmap.struct_()]
    values = np.array(bitmap, dtype=np.float64)
    layer = lambda prefix: [names.index(prefix + c) for c in "RGB" if prefix + c in names]
    error = values[..., layer("stderr.")]
    return values[..., layer("")], error if error.shape[-1] else None


def point_of_mitsuba(xml, seconds):
    """Mitsuba's relMSE after this many seconds of rendering, for bench.toml to compare with."""
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb" if "llvm_ad_rgb" in mi.variants() else "scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    scene = mi.load_file(str(xml))
    # Twice: the first run compiles. Short renders, so that none ends much too late.
    spp = 16
    for seed in range(2):
        begun = time.time()
        np.array(mi.render(scene, spp=spp, seed=seed))
    spp = max(1, int(spp * min(seconds / 10, 1) / (time.time() - begun)))
    total, count, begun = 0, 0, time.time()
    while time.time() - begun < seconds:
        count += 1
        total = total + np.array(mi.render(scene, spp=spp, seed=count + 1), dtype=np.float64)[..., :3]
    taken = time.time() - begun
    reference, error = read(HERE / "errors" / f"{xml.stem}.exr")
    weight = 1 / (reference**2 + 0.01)
    return taken, (((total / count - reference) ** 2 - error**2) * weight).mean()


def write_reference(file, estimate):
    import mitsuba as mi

    error = np.kron(estimate.block_error, np.ones((BLOCK, BLOCK, 1)))
    planes = np.concatenate([estimate.mean, error], -1).astype(np.float32)
    names = ["R", "G", "B", "stderr.R", "stderr.G", "stderr.B"]
    mi.Bitmap(planes, mi.Bitmap.PixelFormat.MultiChannel, names).write(str(file))


class Reference:
    """A reference that write_reference wrote."""

    def __init__(self, file):
        self.mean, error = read(file)
        self.block_error = blocks(error)
        count = np.prod(self.block_error.shape[:2])
        self.whole_error = np.sqrt((self.block_error**2).sum((0, 1))) / count
        # As for independent pixels: the least that is consistent with the blocks' errors.
        self.pixel_error = error * BLOCK


def report(name, ours, reference):
    x, ref = ours.mean, reference.mean
    if x.shape != ref.shape:
        print(f"{name}: {x.shape} and {ref.shape} pixels")
        return
    ratio = x.mean((0, 1)) / ref.mean((0, 1))
    error = np.hypot(ours.whole_error, reference.whole_error) / ref.mean((0, 1))
    noise = ours.pixel_error**2 + reference.pixel_error**2
    relative = (((x - ref) ** 2 - noise) / (ref**2 + 0.01)).mean()
    difference = blocks(x) - blocks(ref)
    sigma = np.hypot(ours.block_error, reference.block_error)
    z = difference / np.maximum(sigma, 1e-5 * np.abs(ref).mean())
    worst = np.unravel_index(np.abs(z).argmax(), z.shape)
    per_cent = 100 * difference[worst] / max(blocks(ref)[worst], 1e-3 * ref.mean())
    ratios = ", ".join(f"{r:.4f} +- {e:.4f}" for r, e in zip(ratio, error))
    print(f"{name:<14} mean ratio {ratios}; relMSE {relative:.1e}; "
          f"block {per_cent:+.1f} % ({z[worst]:+.1f} standard errors) at ({worst[1] * BLOCK}, {worst[0] * BLOCK}), "
          f"rms {np.sqrt((z**2).mean()):.2f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", help="XML files [default: those beside this program]")
    parser.add_argument("--seconds", type=float, help="render with Mitsuba for so long, and not compare with references")
    parser.add_argument("--write", action="store_true", help="write what Mitsuba renders as references")
    parser.add_argument("--points", action="store_true", help="print what Mitsuba reaches in --seconds")
    parser.add_argument("--passes", type=int, default=32, help=f"beamfarm's passes, in each of {RUNS} renders")
    program = HERE.parent.parent / "target" / "release" / "beamfarm"
    parser.add_argument("--beamfarm", default=str(program), help="the program")
    arguments = parser.parse_args()
    own = sorted(f for f in (HERE / "scenes").glob("*.xml") if f.stem != "walls")
    for xml in [pathlib.Path(s) for s in arguments.scenes] or own:
        reference_file = HERE / "references" / f"{xml.stem}.exr"
        if arguments.points:
            seconds, error = point_of_mitsuba(xml, arguments.seconds or 10)
            print(f"{xml.stem}: [[{seconds:.1f}, {error:.2e}]]", flush=True)
            continue
        if arguments.write or arguments.seconds:
            reference = with_mitsuba(xml, arguments.seconds or 60)
        else:
            reference = Reference(reference_file)
        if arguments.write:
            write_reference(reference_file, reference)
            error = (reference.whole_error / reference.mean.mean((0, 1))).max()
            print(f"{xml.stem}: standard error of the mean {100 * error:.3f} %", flush=True)
        else:
            report(xml.stem, with_beamfarm(arguments.beamfarm, xml, arguments.passes), reference)


if __name__ == "__main__":
    main()
