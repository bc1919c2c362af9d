#!/usr/bin/env python3
"""Makes the figures of docs/introduction.md: python3 docs/figures.py

Needs the Python package (pip install beamfarm, or docs/python.md from the sources), numpy and Pillow. They go to
docs/figures; the pictures are the same on every machine. About two minutes on two cores.
"""

import pathlib

import beamfarm
import numpy as np
from PIL import Image

DOCS = pathlib.Path(__file__).resolve().parent
SCENE = DOCS.parent / "scenes/sphere-caustic.toml"
WIDTH, HEIGHT = 480, 360
# White between pictures that stand side by side, pixels.
GAP = 6


def scene(**render):
    """The scene in the size of a figure, with other values in its table `render`."""
    made = beamfarm.load(str(SCENE))
    made["image"].update(width=WIDTH, height=HEIGHT)
    made["render"].update(render)
    return made


def shown(radiance, exposure):
    """Pixels of 8 bits, sRGB, of a linear picture."""
    linear = np.clip(np.asarray(radiance, dtype=np.float64) * 2.0**exposure, 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return Image.fromarray((encoded * 255 + 0.5).astype(np.uint8))


def cone(picture):
    """The part of a picture with the ball and the light below it."""
    left, top = round(0.24 * WIDTH), round(0.22 * HEIGHT)
    return picture.crop((left, top, left + WIDTH // 2, top + round(0.7 * HEIGHT)))


def row(pictures):
    """Pictures of one size, side by side."""
    width, height = pictures[0].size
    joined = Image.new("RGB", ((width + GAP) * len(pictures) - GAP, height), "white")
    for number, picture in enumerate(pictures):
        joined.paste(picture, (number * (width + GAP), 0))
    return joined


def write(name, picture):
    folder = DOCS / "figures"
    folder.mkdir(exist_ok=True)
    picture.save(folder / f"{name}.webp", quality=85, method=6)


def main():
    # Few photons, spread thinly: each path can be followed by eye.
    few = beamfarm.pass_image(scene(radius=0.01, targeting="off"), 0, paths=60)
    write("beams", shown(few.beauty, 0.0))

    averages = {passes: shown(beamfarm.render(scene(), passes=passes).beauty, 1.0) for passes in (1, 10, 100)}
    write("pass", averages[1])
    write("passes", row([cone(picture) for picture in averages.values()]))

    passes = beamfarm.Passes(scene(), paths=3000)
    write("radii", row([cone(shown(passes[index].beauty, 1.0)) for index in (0, 9, 99)]))


if __name__ == "__main__":
    main()
