#!/usr/bin/env python3
"""Compares dispersion with Mitsuba 3.

Mitsuba's dielectrics have one index of refraction in all of its variants. So two scenes of grey surfaces are rendered
once for each of several wavelengths, with the index from Sellmeier's formula, and summed with the CIE 1931 observer
under D65. beamfarm renders the same scenes by passes and by its path tracer; means and blocks of 16 x 16 pixels are
compared.

    pip install mitsuba colour-science numpy
    tests/mitsuba/dispersion.py target/release/beamfarm
"""

import math
import subprocess
import sys
import tempfile
from pathlib import Path

import colour
import mitsuba as mi
import numpy as np

mi.set_variant("scalar_rgb")
T = mi.ScalarTransform4f
WIDTH, HEIGHT, BLOCK = 96, 64, 16
SAMPLES = 192
WAVES = 24
SF11 = [(1.73759695, 0.013188707), (0.313747346, 0.0623068142), (1.89878101, 155.23629)]


PRISM_FILE = Path(tempfile.mkdtemp()) / "prism.ply"


def write_prism():
    """The prism of scenes/meshes as triangles, which Mitsuba's reader requires."""
    corners = [math.radians(angle) for angle in (90, 210, 330)]
    points = [(math.cos(a) / math.sqrt(3), math.sin(a) / math.sqrt(3), z) for z in (-1, 1) for a in corners]
    faces = [(0, 2, 1), (3, 4, 5)]
    for i in range(3):
        j = (i + 1) % 3
        faces += [(i, j, 3 + j), (i, 3 + j, 3 + i)]
    lines = ["ply", "format ascii 1.0", f"element vertex {len(points)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    lines += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
    lines += [" ".join(map(str, point)) for point in points] + ["3 %d %d %d" % face for face in faces]
    PRISM_FILE.write_text("\n".join(lines) + "\n")


def index(nm):
    square = (nm / 1000) ** 2
    return math.sqrt(1 + sum(b * square / (square - c) for b, c in SF11))


def weights():
    """Wavelengths, and the weights of their images in linear sRGB."""
    table = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy()
    fine = colour.SpectralShape(380, 780, 1)
    xyz = table.align(fine).values
    daylight = colour.SDS_ILLUMINANTS["D65"].copy().align(fine).values
    rgb = (xyz * daylight[:, None]) @ np.array(colour.RGB_COLOURSPACES["sRGB"].matrix_XYZ_to_RGB).T
    rgb /= rgb.sum(axis=0)
    # Equal parts of the summed absolute weights.
    density = np.abs(rgb).sum(axis=1)
    part = np.minimum((np.cumsum(density) / density.sum() * WAVES).astype(int), WAVES - 1)
    nms = np.arange(380, 781)
    for number in range(WAVES):
        here = part == number
        yield (nms[here] * density[here]).sum() / density[here].sum(), rgb[here].sum(axis=0)


def prism(eta):
    """Stripes behind a prism under a sky."""
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": -1},
        "sensor": sensor([0, 0.35, 3.2], [0, 0.3, 0], 34),
        "sky": {"type": "constant", "radiance": {"type": "rgb", "value": 1.0}},
        "prism": {
            "type": "ply",
            "filename": str(PRISM_FILE),
            "face_normals": True,
            "to_world": T().translate([0, 0.3, 0]) @ T().rotate([1, 0, 0], 90) @ T().scale([1, 1, 0.5]),
            "bsdf": {"type": "dielectric", "int_ior": eta, "ext_ior": 1.0},
        },
        "stripes": {
            "type": "rectangle",
            "to_world": T().translate([0, 0.3, -1.5]) @ T().scale([2.4, 1.6, 1]),
            "bsdf": {
                "type": "twosided",
                "bsdf": {
                    "type": "diffuse",
                    "reflectance": {
                        "type": "checkerboard",
                        "color0": {"type": "rgb", "value": 0.8},
                        "color1": {"type": "rgb", "value": 0.02},
                        "to_uv": T().scale([6, 4, 1]),
                    },
                },
            },
        },
    }


PRISM = """
[[lights]]
type = "environment"
radiance = 1.0
[[shapes]]
type = "mesh"
file = "{meshes}/prism.ply"
face_normals = true
material = "glass"
transform = [{{ scale = [1, 1, 0.5] }}, {{ rotate = {{ axis = [1, 0, 0], angle = 90 }} }}, {{ translate = [0, 0.3, 0] }}]
[materials.stripes]
type = "diffuse"
reflectance = {{ checkerboard = [0.8, 0.02], uv = [{{ scale = [6, 4, 1] }}] }}
two_sided = true
[[shapes]]
type = "rectangle"
material = "stripes"
transform = [{{ scale = [2.4, 1.6, 1] }}, {{ translate = [0, 0.3, -1.5] }}]
"""


def caustic(eta):
    """A ball of flint and a prism on a table under a lamp."""
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": -1},
        "sensor": sensor([0.3, 2.2, 3.4], [0.1, 0.2, 0], 40),
        "lamp": {
            "type": "sphere",
            "center": [-1.5, 2.8, 0.5],
            "radius": 0.5,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 10.0}},
        },
        "ball": {
            "type": "sphere",
            "center": [-0.4, 0.5, 0.2],
            "radius": 0.45,
            "bsdf": {"type": "dielectric", "int_ior": eta, "ext_ior": 1.0},
        },
        "prism": {
            "type": "ply",
            "filename": str(PRISM_FILE),
            "face_normals": True,
            "to_world": T().translate([0.75, 0.45, 0]) @ T().scale([0.7, 0.7, 0.5]),
            "bsdf": {"type": "dielectric", "int_ior": eta, "ext_ior": 1.0},
        },
        "table": {
            "type": "rectangle",
            "to_world": T().rotate([1, 0, 0], -90) @ T().scale([3, 3, 1]),
            "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.6}},
        },
    }


CAUSTIC = """
[[shapes]]
type = "sphere"
center = [-1.5, 2.8, 0.5]
radius = 0.5
emission = {{ radiance = 10.0 }}
[[shapes]]
type = "sphere"
center = [-0.4, 0.5, 0.2]
radius = 0.45
material = "glass"
[[shapes]]
type = "mesh"
file = "{meshes}/prism.ply"
face_normals = true
material = "glass"
transform = [{{ scale = [0.7, 0.7, 0.5] }}, {{ translate = [0.75, 0.45, 0] }}]
[materials.table]
type = "diffuse"
reflectance = 0.6
[[shapes]]
type = "rectangle"
material = "table"
transform = [{{ scale = 3 }}, {{ rotate = {{ axis = [1, 0, 0], angle = -90 }} }}]
"""

FRAME = """
[image]
width = {width}
height = {height}
[camera]
origin = {origin}
target = {target}
fov = {fov}
[materials.glass]
type = "dielectric"
ior = {{ preset = "sf11" }}
"""


def sensor(origin, target, fov):
    return {
        "type": "perspective",
        "fov": fov,
        "to_world": T().look_at(origin=origin, target=target, up=[0, 1, 0]),
        "film": {"type": "hdrfilm", "width": WIDTH, "height": HEIGHT, "rfilter": {"type": "box"}},
        "sampler": {"type": "independent", "sample_count": SAMPLES},
    }


def by_mitsuba(scene):
    image = np.zeros((HEIGHT, WIDTH, 3))
    for number, (nm, weight) in enumerate(weights()):
        grey = np.array(mi.render(mi.load_dict(scene(index(nm))), seed=number))[..., 0]
        image += grey[..., None] * weight
    return image


def blocks(image):
    rows, columns = HEIGHT // BLOCK, WIDTH // BLOCK
    return image.reshape(rows, BLOCK, columns, BLOCK, 3).mean(axis=(1, 3))


def by_beamfarm(command, scene, folder, args):
    out = folder / "out.exr"
    subprocess.run([*command, scene, "-o", out, "--quiet"] + args, check=True, stdout=subprocess.DEVNULL)
    parts = dict(mi.Bitmap(str(out)).split())
    return np.array(parts["<root>"]).astype(float)[..., :3]


def main():
    beamfarm = sys.argv[1]
    meshes = Path("scenes/meshes").resolve()
    write_prism()
    cases = [
        ("prism", prism, PRISM, ([0, 0.35, 3.2], [0, 0.3, 0], 34)),
        ("caustic", caustic, CAUSTIC, ([0.3, 2.2, 3.4], [0.1, 0.2, 0], 40)),
    ]
    for name, scene, text, (origin, target, fov) in cases:
        expected = by_mitsuba(scene)
        with tempfile.TemporaryDirectory() as folder:
            folder = Path(folder)
            path = folder / "scene.toml"
            frame = FRAME.format(width=WIDTH, height=HEIGHT, origin=origin, target=target, fov=fov)
            path.write_text(frame + text.format(meshes=meshes))
            passes = by_beamfarm([beamfarm, "render"], path, folder, ["--passes", "1024"])
            reference = by_beamfarm([beamfarm, "reference"], path, folder, ["--samples", "2048"])
        for of, image in [("passes", passes), ("reference", reference)]:
            mean = image.mean(axis=(0, 1)) / expected.mean(axis=(0, 1))
            ours, theirs = blocks(image), blocks(expected)
            off = np.abs(ours - theirs) / theirs.mean(axis=2, keepdims=True)
            print(
                f"{name}, {of}: means {mean.round(4)} of Mitsuba's; blocks of {BLOCK} pixels differ by "
                f"{100 * off.mean():.2f} % of their mean on average, {100 * off.max():.2f} % at most"
            )


if __name__ == "__main__":
    main()
