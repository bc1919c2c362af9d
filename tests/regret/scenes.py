#!/usr/bin/env python3
"""Writes the suite that measures the program's own choices: SUITE.toml and its scenes, into a folder.

    cargo build --release && cargo build -p beamfarm-tests --example random_scene
    python3 tests/regret/scenes.py out/regret
    target/release/beamfarm bench --suite out/regret/suite.toml --regret --seconds 10 -o out/regret/found

The example scenes and those of tests/mitsuba, reduced where they are large, forty random ones, and those below: typical
rooms, each with variants that differ in a size, a lamp or a material.
"""

import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
RANDOM = 40

GREY = '[materials.grey]\ntype = "diffuse"\nreflectance = {}\ntwo_sided = true\n'
GLASS = '[materials.glass]\ntype = "dielectric"\nior = 1.5\n'
AIR = '[materials.air]\ntype = "null"\n'


def image(width=96, height=64):
    # Jobs as long as typical ones: a pilot takes a share of them.
    return f"[image]\nwidth = {width}\nheight = {height}\n[render]\npasses = 2000\n"


def camera(origin, target, fov=45, more=""):
    return f"[camera]\norigin = {list(origin)}\ntarget = {list(target)}\nfov = {fov}\n{more}\n"


def shape(kind, material, more="", *steps):
    transform = f"transform = [{', '.join(steps)}]\n" if steps else ""
    return f'[[shapes]]\ntype = "{kind}"\nmaterial = "{material}"\n{more}{transform}\n'


def scale(*by):
    return f"{{ scale = {list(by) if len(by) > 1 else by[0]} }}"


def move(*by):
    return f"{{ translate = {list(by)} }}"


def turn(axis, angle):
    return f"{{ rotate = {{ axis = {list(axis)}, angle = {angle} }} }}"


FLAT = turn((1, 0, 0), -90)
DOWN = turn((1, 0, 0), 90)


def lamp(side, x, y, z, radiance):
    return shape("rectangle", "grey", f"emission = {{ radiance = {radiance} }}\n", scale(side), DOWN, move(x, y, z))


def spot(position, target, intensity, angle=20):
    return (
        f'[[lights]]\ntype = "spot"\nposition = {list(position)}\ntarget = {list(target)}\n'
        f"intensity = {intensity}\ncutoff_angle = {angle}\nbeam_width = {0.8 * angle}\n\n"
    )


def ball(x, y, z, radius, material="glass", more=""):
    return f'[[shapes]]\ntype = "sphere"\ncenter = [{x}, {y}, {z}]\nradius = {radius}\nmaterial = "{material}"\n{more}\n'


def sky(radiance):
    return f'[[lights]]\ntype = "environment"\nradiance = {radiance}\n\n'


def sun(direction, irradiance):
    return f'[[lights]]\ntype = "directional"\ndirection = {list(direction)}\nirradiance = {irradiance}\n\n'


def floor(size=10):
    return shape("rectangle", "grey", "", FLAT, scale(size))


def fog(sigma_s, sigma_a=0.02, g=0.4):
    phase = f'phase = {{ type = "hg", g = {g} }}\n' if g else ""
    return f'[media.fog]\ntype = "homogeneous"\nsigma_a = {sigma_a}\nsigma_s = {sigma_s}\n{phase}\n'


def room(width, height, depth):
    """A room that is closed except for a window of a fifth of the wall at -x."""
    w, h, d = width / 2, height / 2, depth / 2
    walls = [
        shape("rectangle", "grey", "", scale(w, d, 1), FLAT),
        shape("rectangle", "grey", "", scale(w, d, 1), DOWN, move(0, height, 0)),
        shape("rectangle", "grey", "", scale(w, h, 1), move(0, h, -d)),
        shape("rectangle", "grey", "", scale(w, h, 1), move(0, h, d)),
        shape("rectangle", "grey", "", scale(d, h, 1), turn((0, 1, 0), 90), move(w, h, 0)),
    ]
    # Around the window: below, above, and on both sides.
    side = lambda y0, y1, z0, z1: shape(
        "cube", "grey", "", scale(0.05, (y1 - y0) / 2, (z1 - z0) / 2), move(-w, (y0 + y1) / 2, (z0 + z1) / 2)
    )
    low, high, half = 0.3 * height, 0.8 * height, 0.2 * depth
    walls += [side(0, low, -d, d), side(high, height, -d, d), side(low, high, -d, -half), side(low, high, half, d)]
    return "".join(walls), (low, high, half, w)


def pane(opening, thickness=0.02):
    low, high, half, w = opening
    return shape("cube", "glass", "", scale(thickness, (high - low) / 2, half), move(-w, (low + high) / 2, 0))


def scenes():
    made = {}

    def fog_box(side, height, sigma, g=0.4, lens=True, intensity=60, world=False):
        text = image() + camera((0, 2.3, 7.5), (0, 2.0, 0), 48) + fog(sigma, 0.5 * sigma, g) + GREY.format(0.6) + GLASS + AIR
        if world:
            text = '[world]\nmedium = "fog"\n' + text
        else:
            text += shape("cube", "air", 'interior = "fog"\n', scale(side / 2, height / 2, side / 2), move(0, height / 2 + 0.05, 0))
        text += floor(10) + shape("rectangle", "grey", "", scale(10), move(0, 5, -5))
        text += spot((-3.9, 3.1, 0), (0.5, 1.9, 0), intensity, 15) + lamp(0.5, 3, 4, 3, 6)
        return text + (shape("sphere", "glass", "boundary = false\n", scale(0.35, 1, 1), move(-0.6, 2.2, 0)) if lens else "")

    for side, height in [(4, 3), (6, 5.7), (8, 5.7), (18, 5.7), (30, 20)]:
        made[f"fog-box-{side}"] = fog_box(side, height, 0.04)
    made["fog-box-thick"] = fog_box(6, 5.7, 0.4)
    made["fog-box-even"] = fog_box(6, 5.7, 0.04, g=0, lens=False)
    made["fog-world"] = fog_box(0, 0, 0.04, world=True)

    def sunny(depth, glass, haze=0.0, g=0.4):
        walls, opening = room(4, 2.6, depth)
        text = image() + camera((1.6, 1.4, 0.4 * depth), (-0.6, 1.0, -0.2 * depth), 60) + GREY.format(0.65) + GLASS
        if haze:
            text += fog(haze, 0.1 * haze, g) + AIR
            text += shape("cube", "air", 'interior = "fog"\n', scale(1.94, 1.29, depth / 2 - 0.01), move(0, 1.3, 0))
        text += walls + (pane(opening, glass) if glass else "")
        text += sun((1, -0.7, -0.15), 20) + sky(0.6 if not haze else 0.05)
        return text + ball(0.3, 0.35, -0.3, 0.35, "gloss") + '[materials.gloss]\ntype = "plastic"\nreflectance = [0.5, 0.2, 0.1]\n'

    made["room-window"] = sunny(5, 0)
    made["room-pane"] = sunny(5, 0.02)
    made["room-pane-deep"] = sunny(9, 0.04)
    made["room-haze"] = sunny(5, 0, 0.05)
    made["room-haze-pane"] = sunny(5, 0.02, 0.05)

    def two_rooms(wall, glass=True):
        text = image(96, 48) + camera((-0.4, 2.5, 0.001), (-0.4, 0, 0), 60, "up = [0, 0, -1]") + GREY.format(0.7) + GLASS
        text += shape("cube", "grey", "flip_normals = true\n", scale(2, 1.5, 1), move(0, 1.5, 0))
        text += shape("cube", "grey", "", scale(wall, 1.5, 1), move(0, 1.5, 0))
        text += ball(0.35, 0.5, 0, 0.3) if glass else ""
        return text + '[[lights]]\ntype = "point"\nposition = [0.35, 1.6, 0]\nintensity = 2\n\n'

    made["rooms-thin"] = two_rooms(0.0005)
    made["rooms-thick"] = two_rooms(0.05)

    def pool(depth, sigma, night=False):
        text = image() + camera((2.5, 2.2, 3.0), (0, -0.4 * depth, 0), 50) + GREY.format("[0.5, 0.6, 0.65]")
        text += '[materials.water]\ntype = "dielectric"\nior = 1.33\n'
        inside = ""
        if sigma:
            text += fog(f"[{sigma}, {1.2 * sigma}, {1.5 * sigma}]", f"[{2 * sigma}, {0.6 * sigma}, {0.4 * sigma}]", 0.8)
            inside = 'interior = "fog"\n'
        # A body of water whose lower faces are inside the ground.
        text += shape("cube", "water", inside, scale(2.05, depth / 2 + 0.05, 2.05), move(0, -depth / 2 - 0.15, 0))
        text += shape("rectangle", "grey", "", FLAT, scale(2), move(0, -depth, 0))
        for angle in (0, 90, 180, 270):
            text += shape(
                "rectangle", "grey", "", scale(2, depth / 2, 1), move(0, -depth / 2, -2), turn((0, 1, 0), angle)
            )
        # The rim.
        for x, z, a, b in [(3, 0, 1, 4), (-3, 0, 1, 4), (0, 3, 2, 1), (0, -3, 2, 1)]:
            text += shape("cube", "grey", "", scale(a, 0.05, b), move(x, -0.04, z))
        if night:
            return text + ball(1.2, -0.6 * depth, -1.2, 0.1, "grey", "emission = { radiance = 300 }\n")
        return text + sun((0.4, -1, -0.3), 8) + sky("[0.3, 0.4, 0.6]")

    made["pool"] = pool(1.0, 0)
    made["pool-deep"] = pool(3.0, 0.08)
    made["pool-lamp"] = pool(1.5, 0.08, night=True)

    def road(sigma, intensity):
        text = image() + camera((0, 1.6, 9), (0, 1.0, -6), 50) + '[world]\nmedium = "fog"\n' + fog(sigma, 0.1 * sigma, 0.7)
        text += GREY.format(0.15) + GLASS + floor(60)
        text += '[materials.chrome]\ntype = "conductor"\npreset = "silver"\n'
        for x in (-3.4, -2.2):
            text += spot((x, 0.7, -8), (x + 0.6, 0.55, 6), intensity, 14) + ball(x, 0.7, -7.85, 0.1)
        return text + shape("cube", "grey", "", scale(0.9, 0.6, 2), move(-2.8, 0.7, -10.2)) + ball(1.8, 0.5, 2, 0.5, "chrome")

    made["car-lamps"] = road(0.03, 400)
    made["car-lamps-dense"] = road(0.2, 400)

    def many_lamps(count, haze):
        text = image() + camera((0, 1.8, 8), (0, 1.2, 0), 50) + GREY.format(0.5) + GLASS + floor(20)
        if haze:
            text = '[world]\nmedium = "fog"\n' + text + fog(haze, 0.1 * haze)
        # One of them stands in front of the camera, the rest far behind a wall.
        text += lamp(0.15, 0.8, 2.4, 0, 40) + ball(0.6, 0.7, 0, 0.4)
        text += shape("cube", "grey", "", scale(20, 6, 0.1), move(0, 6, -6))
        for number in range(count - 1):
            text += lamp(0.15, -19 + 38 * number / count, 2.4, -12 - 3 * (number % 3), 40)
        return text

    made["one-of-fifty"] = many_lamps(50, 0)
    made["one-of-fifty-fog"] = many_lamps(50, 0.05)

    def smoke(sigma_t, albedo, radius):
        text = image() + camera((0, 1.5, 5), (0, 1.2, 0), 45) + GREY.format(0.5) + AIR + GLASS + floor()
        text += f'[media.smoke]\ntype = "heterogeneous"\nsigma_t = {sigma_t}\nalbedo = {albedo}\n[media.smoke.density]\n'
        text += f"min = [-1.2, 0.05, -1.2]\nmax = [1.2, 2.4, 1.2]\nblobs = [{{ center = [0, 1.2, 0], radius = {radius} }}]\n"
        text += "noise = { size = 0.5, contrast = 2 }\n"
        text += shape("cube", "air", 'interior = "smoke"\n', scale(1.2, 1.175, 1.2), move(0, 1.225, 0))
        return text + lamp(0.2, 0.3, 3.2, 0.2, 60) + ball(1.6, 0.3, 0.8, 0.3)

    made["smoke"] = smoke(2, 0.9, 0.5)
    made["smoke-thick"] = smoke(12, 0.97, 0.5)
    made["smoke-wisp"] = smoke(3, 0.8, 0.2)

    def ground(size, glass=True):
        text = image(64, 64) + camera((0.2, 1.6, 2.2), (-0.35, 0, -0.1), 30) + GREY.format(0.5) + GLASS + floor(size)
        text += ball(-0.45, 0.56, -0.045, 0.186) if glass else ""
        return text + lamp(0.08, 0, 2.2, 0.2, 55) + sky(0.5)

    for size in (1, 100, 10000):
        made[f"ground-{size}"] = ground(size)

    def ordinary(glossy, window):
        walls, opening = room(4, 2.6, 5)
        text = image() + camera((1.5, 1.4, 2.0), (-0.4, 0.9, -1.0), 60) + GREY.format("[0.7, 0.65, 0.6]") + GLASS + walls
        text += f'[materials.gloss]\ntype = "{glossy}"\nalpha = 0.15\npreset = "silver"\n'
        text += '[materials.oak]\ntype = "diffuse"\nreflectance = [0.4, 0.25, 0.12]\n'
        text += shape("cube", "oak", "", scale(0.7, 0.04, 0.45), move(-0.2, 0.75, -0.8))
        text += ball(-0.5, 0.97, -0.8, 0.18, "gloss") + ball(0.1, 0.95, -0.7, 0.16)
        return text + (sky("[1.5, 1.8, 2.2]") if window else lamp(0.3, 0, 2.55, 0, 12) + pane(opening))

    def soft(radius, haze):
        text = image() + camera((0, 1.8, 6), (0, 0.8, 0), 45) + GREY.format(0.6) + GLASS + AIR + floor()
        if haze:
            text += fog(haze, 0.1 * haze) + shape("cube", "air", 'interior = "fog"\n', scale(5, 2, 5), move(0, 2.05, 0))
        text += spot((-2, 3.5, 1), (0.3, 0.5, 0), 60, 25).replace("intensity", f"radius = {radius}\nintensity")
        clear = "boundary = false\n" if haze else ""
        return text + ball(0.4, 0.6, 0, 0.5, "glass", clear) + ball(-0.9, 0.4, 0.3, 0.4, "grey")

    made["soft-spot"] = soft(0.3, 0)
    made["soft-spot-fog"] = soft(0.3, 0.05)

    made["ordinary-window"] = ordinary("rough_conductor", True)
    made["ordinary-lamp"] = ordinary("rough_conductor", False)
    return made


# Smaller pictures of the example scenes, which are sized for viewing; the aspect ratios stay.
EXAMPLES = {
    "bumpy-sphere": 96, "cloud": 96, "diamond": 96, "disco-smoke": 128, "disco": 128, "glossy-gallery": 96,
    "headlights-fog": 96, "headlights": 96, "hero": 96, "hotel-night": 96, "hotel": 96, "light-linking": 96,
    "ocean": 96, "prism": 96, "rainbow": 96, "sphere-caustic": 96, "street": 96, "surface-caustics": 96,
}  # fmt: skip


def smaller(name, width):
    """The scene without its passes, with paths of files in the repository."""
    lines = (ROOT / "scenes" / f"{name}.toml").read_text().splitlines()
    sizes = {key: next(int(line.split("=")[1]) for line in lines if line.startswith(key)) for key in ("width", "height")}
    factor = width / sizes["width"]
    out = []
    for line in lines:
        key = line.split("=")[0].strip()
        if key in sizes and line.startswith(key):
            line = f"{key} = {max(1, round(sizes.pop(key) * factor))}"
        if key in ("paths", "passes", "media", "surfaces", "caustics", "targeting") and line.startswith(key):
            continue
        out.append(line.replace('file = "', f'file = "{ROOT}/scenes/').replace('image = "', f'image = "{ROOT}/scenes/'))
    return "\n".join(out) + "\n"


def main():
    folder = pathlib.Path(sys.argv[1]).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    suite = ['title = "What the program chooses, against the best that it could have chosen"\n']
    add = lambda path, more="": suite.append(f'[[scenes]]\nscene = "{path}"\n{more}')
    for name, text in scenes().items():
        (folder / f"{name}.toml").write_text(text)
        add(f"{name}.toml")
    for name, width in EXAMPLES.items():
        (folder / f"example-{name}.toml").write_text(smaller(name, width))
        add(f"example-{name}.toml")
    for path in sorted((ROOT / "tests/mitsuba/scenes").glob("*.xml")):
        reference = ROOT / "tests/mitsuba/errors" / f"{path.stem}.exr"
        if reference.exists():
            add(path, f'reference = "{reference}"\n')
    for seed in range(1, RANDOM + 1):
        command = ["cargo", "run", "-q", "-p", "beamfarm-tests", "--example", "random_scene", "--", str(seed), "--write", str(folder)]
        subprocess.run(command, check=True, cwd=ROOT)
        path = folder / f"random-{seed}" / f"random-{seed}.toml"
        path.write_text("".join(line for line in path.open() if not line.startswith("paths =")))
        add(path.relative_to(folder))
    (folder / "suite.toml").write_text("\n".join(suite))


if __name__ == "__main__":
    main()
