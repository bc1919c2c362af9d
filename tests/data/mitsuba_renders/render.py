"""Writes the pictures that Mitsuba 3's path tracer makes of the scenes in ../../tests/surfaces/material_scenes.rs (made
with 3.9.1, `pip install mitsuba`), and the images that the scenes use.

SCENE.csv: means of RGB over 4 x 4 blocks of 8 x 8 pixels, row by row, and their standard errors.
"""

import pathlib

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
T = mi.ScalarTransform4f
HERE = pathlib.Path(__file__).parent
RENDERS, SAMPLES = 16, 1024

MASK = np.array([[255, 0, 128, 255], [0, 255, 255, 64], [255, 200, 0, 0], [30, 255, 0, 255]], dtype=np.uint8)[..., None]
rng = np.random.default_rng(1)
slopes = rng.uniform(-0.7, 0.7, (4, 4, 2))
normals = np.dstack([slopes, np.ones((4, 4))])
normals /= np.linalg.norm(normals, axis=2)[..., None]
NORMALS = np.round((0.5 * normals + 0.5) * 255).astype(np.uint8)
BUMP = rng.integers(0, 256, (8, 8, 1)).astype(np.uint8)


def bitmap(pixels, filter_type="bilinear"):
    # v increases downwards in Mitsuba's coordinates, upwards in those of the scenes.
    return {
        "type": "bitmap", "raw": True, "filter_type": filter_type, "data": mi.TensorXf(np.flipud(pixels / np.float32(255))),
    }


def rgb(*value):
    return {"type": "rgb", "value": list(value)}


def rectangle(bsdf, to_world, **more):
    return {"type": "rectangle", "to_world": to_world, "bsdf": bsdf, **more}


def sphere(bsdf, center, radius):
    return {"type": "sphere", "to_world": T().translate(center).scale(radius), "bsdf": bsdf}


GREY = {"type": "diffuse", "reflectance": rgb(0.5, 0.5, 0.5)}
BLUE = {"type": "diffuse", "reflectance": rgb(0.2, 0.3, 0.4)}
RED = {"type": "diffuse", "reflectance": rgb(0.6, 0.2, 0.1)}
FLOOR = T().rotate([1, 0, 0], -90).scale(2)


def room(floor, objects):
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": -1},
        "sensor": {
            "type": "perspective", "fov": 45, "fov_axis": "x",
            "to_world": T().look_at([0.3, 1.6, 4.0], [0, 0.5, 0], [0, 1, 0]),
            "film": {"type": "hdrfilm", "width": 32, "height": 32, "rfilter": {"type": "box"}, "component_format": "float32"},
        },
        "floor": rectangle(floor, FLOOR),
        "back": rectangle(RED, T().translate([0, 1, -1.5]).scale([2, 1, 1])),
        "lamp": rectangle(
            {"type": "diffuse", "reflectance": 0.0}, T().translate([0, 2.2, -0.6]).rotate([1, 0, 0], 90).scale(0.5),
            emitter={"type": "area", "radiance": rgb(8, 7, 6)},
        ),
        **objects,
    }


PLASTIC = {"type": "plastic", "diffuse_reflectance": rgb(0.2, 0.3, 0.4), "int_ior": 1.5, "ext_ior": 1.0}
ROUGH = {
    "type": "roughplastic", "diffuse_reflectance": rgb(0.2, 0.3, 0.4), "int_ior": 1.5, "ext_ior": 1.0, "alpha": 0.2,
    "distribution": "ggx",
}
CHROME = {
    "type": "roughconductor", "distribution": "beckmann", "alpha": 0.3,
    "eta": {"type": "rgb", "value": 1.4}, "k": {"type": "rgb", "value": 1.6},
}
SCENES = {
    "plastic": room(PLASTIC, {"ball": sphere(PLASTIC, [-0.5, 0.5, 0], 0.5), "other": sphere(ROUGH, [0.7, 0.4, 0.2], 0.4)}),
    "opacity": room(GREY, {
        "screen": rectangle(
            {"type": "mask", "opacity": bitmap(MASK, "nearest"), "bsdf": {"type": "twosided", "bsdf": RED}},
            T().translate([0, 1.2, -0.3]).rotate([1, 0, 0], -80).scale(0.8),
        ),
        "ball": sphere({"type": "mask", "opacity": 0.4, "bsdf": GREY}, [0.5, 0.5, 0.5], 0.5),
    }),
    "relief": room({"type": "normalmap", "normalmap": bitmap(NORMALS), "bsdf": GREY}, {
        # Bumps shadow diffuse light only; Mitsuba's surfaces shadow all light or none.
        "ball": sphere(
            {
                "type": "bumpmap", "texture": bitmap(BUMP), "scale": 0.15, "bsdf": CHROME,
                "use_shadowing_function": False,
            },
            [-0.5, 0.5, 0], 0.5,
        ),
        "board": rectangle(
            {"type": "bumpmap", "texture": bitmap(BUMP), "scale": 0.2, "bsdf": {"type": "twosided", "bsdf": BLUE}},
            T().translate([0.8, 0.6, 0]).rotate([0, 1, 0], -30).scale([0.5, 0.6, 1]),
        ),
    }),
    "panes": room(GREY, {
        "pane": rectangle(
            {
                "type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0,
                "specular_transmittance": rgb(0.9, 0.6, 0.3),
            },
            T().translate([0.9, 0.7, 0.8]).rotate([0, 1, 0], -20).scale([0.5, 0.6, 1]),
        ),
        "ball": sphere(
            {"type": "principled", "base_color": rgb(0.8, 0.4, 0.1), "metallic": 0.5, "roughness": 0.5}, [-0.5, 0.5, 0], 0.5,
        ),
    }),
}

for name, pixels in {"mask": MASK, "normals": NORMALS, "bump": BUMP}.items():
    mi.Bitmap(pixels).write(str(HERE / f"{name}.png"))
for name, record in SCENES.items():
    scene = mi.load_dict(record)
    blocks = []
    for seed in range(RENDERS):
        image = np.array(mi.render(scene, spp=SAMPLES, seed=seed))[..., :3]
        blocks.append(image.reshape(4, 8, 4, 8, 3).mean(axis=(1, 3)).reshape(16, 3))
    mean, error = np.mean(blocks, axis=0), np.std(blocks, axis=0, ddof=1) / np.sqrt(RENDERS)
    print(name, mean.mean(axis=0), (error / mean).max())
    rows = [",".join(f"{x:.6g}" for x in [*m, *e]) for m, e in zip(mean, error)]
    (HERE / f"{name}.csv").write_text("\n".join(rows) + "\n")
