#!/usr/bin/env python3
"""Renders the pictures of the gallery: python3 docs/gallery.py [NAME…]

    cargo build --release
    python3 docs/gallery.py                         # all of PICTURES, as many passes as each needs
    python3 docs/gallery.py hero street --time 10m  # two of them, ten minutes each for now

A picture's passes are kept in target/gallery/NAME.job, so hours of rendering may be cut into pieces: the same command goes
on where the last one ended. Each picture becomes scenes/gallery/NAME.webp, of at most 250 kB. Needs Pillow.

    python3 docs/gallery.py pair                    # docs/introduction.md's: a path tracer and beamfarm after equal time
"""

import argparse
import pathlib
import subprocess
import sys

from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parent.parent
BEAMFARM = ROOT / "target/release/beamfarm"
GALLERY = ROOT / "scenes/gallery"
JOBS = ROOT / "target/gallery"
LARGEST = 250_000

# Passes and pixels a row. Everything else is the scene's.
PICTURES = {
    "bumpy-sphere": (200, 1280),
    "chandelier": (400, 1280),
    "cloud": (600, 1280),
    "disco": (240, 1280),
    "hero": (160, 1280),
    "laser": (160, 1280),
    "lighthouse": (200, 1280),
    "ocean": (400, 1280),
    "pool": (400, 1280),
    "rainbow": (400, 1280),
    "street": (200, 1280),
    "wax": (1000, 1280),
    "welding": (400, 1280),
}
# Denoised: smooth where light has scattered often, so that many passes more would only take away grain.
DENOISED = {"cloud", "wax"}

# Of what the path tracer and beamfarm get the same time for, on a machine that should have nothing else to do.
PAIR = ["scenes/disco.toml", "--time", "20s", "--width", "640"]
FIGURES = ROOT / "docs/figures"


def render(name, time):
    """The picture of all passes that there are; renders more of them first."""
    passes, width = PICTURES[name]
    JOBS.mkdir(parents=True, exist_ok=True)
    output, job = JOBS / f"{name}.exr", JOBS / f"{name}.job"
    command = [BEAMFARM, "render", f"scenes/{name}.toml", "--width", str(width), "--passes", str(passes)]
    command += ["--job", job, "-o", output] + (["--time", time] if time else [])
    command += ["--denoise"] if name in DENOISED else []
    subprocess.run([str(part) for part in command], cwd=ROOT, check=True)
    picture = output.with_suffix(".denoised.png" if name in DENOISED else ".png")
    if not picture.exists():
        sys.exit(f"{name}: the time was too short for a picture; the same command goes on")
    return picture


def pair():
    """One scene after the same time, by the path tracer and by photon beams."""
    JOBS.mkdir(parents=True, exist_ok=True)
    # More passes than the time allows.
    for name, command in {"paths": ["reference"], "photons": ["render", "--passes", "100000"]}.items():
        output = JOBS / f"pair-{name}.exr"
        subprocess.run([str(part) for part in [BEAMFARM, *command, *PAIR, "-o", output]], cwd=ROOT, check=True)
        compress(output.with_suffix(".png"), FIGURES / f"pair-{name}.webp")


def compress(png, webp):
    """A WebP of the best quality that is small enough."""
    with Image.open(png) as picture:
        for quality in range(92, 40, -4):
            picture.convert("RGB").save(webp, quality=quality, method=6)
            if webp.stat().st_size <= LARGEST:
                return
    sys.exit(f"{webp}: more than {LARGEST} bytes at the lowest quality")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"which: {', '.join(PICTURES)} (default: all), pair")
    parser.add_argument("--time", help="how long for each at most, such as 10m (default: until its passes are complete)")
    arguments = parser.parse_args()
    for name in arguments.names or PICTURES:
        if name == "pair":
            pair()
            continue
        if name not in PICTURES:
            parser.error(f"{name}: expected one of {', '.join(PICTURES)}, or pair")
        compress(render(name, arguments.time), GALLERY / f"{name}.webp")


if __name__ == "__main__":
    main()
