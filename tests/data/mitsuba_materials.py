"""Writes mitsuba_materials.csv: values of materials from Mitsuba 3 (made with 3.9.1, `pip install mitsuba`).

Columns: name of the material, as in ../tests/surfaces/materials.rs; `value`, `reflect` or `transmit`;
wo; wi (both leave the surface); RGB. That is the BSDF's value without the cosine, or for the other two the weight of a
delta lobe.
"""

import math
import pathlib

import mitsuba as mi

mi.set_variant("scalar_rgb")


def direction(degrees, azimuth):
    theta, phi = math.radians(degrees), math.radians(azimuth)
    return [
        math.sin(theta) * math.cos(phi),
        math.sin(theta) * math.sin(phi),
        math.cos(theta),
    ]


def rgb(*value):
    return {"type": "rgb", "value": list(value)}


PAINT = rgb(0.8, 0.4, 0.1)
COATED = {"diffuse_reflectance": PAINT, "int_ior": 1.5, "ext_ior": 1.0}
TINTS = {"specular_reflectance": rgb(0.9, 0.7, 0.5), "specular_transmittance": rgb(0.2, 0.6, 0.8)}

MATERIALS = {
    "beckmann_conductor": {
        "type": "roughconductor", "distribution": "beckmann", "alpha": 0.3,
        "eta": {"type": "rgb", "value": 1.4}, "k": {"type": "rgb", "value": 1.6},
    },
    "beckmann_dielectric": {
        "type": "roughdielectric", "distribution": "beckmann", "alpha": 0.4, "int_ior": 1.5, "ext_ior": 1.0, **TINTS,
    },
    "glass": {"type": "dielectric", "int_ior": 1.5, "ext_ior": 1.0, **TINTS},
    "metal": {"type": "principled", "base_color": PAINT, "metallic": 0.7, "roughness": 0.3, "specular": 0.4},
    # Black except for its metal. At 0 Mitsuba's metal is black, at anything above it is not.
    "metal_bare": {"type": "principled", "base_color": PAINT, "metallic": 0.9, "roughness": 0.5, "specular": 1e-9},
    "pane": {"type": "thindielectric", "int_ior": 1.5, "ext_ior": 1.0, **TINTS},
    "plastic": {"type": "plastic", **COATED},
    "plastic_nonlinear": {
        "type": "plastic", **COATED, "nonlinear": True, "specular_reflectance": TINTS["specular_reflectance"],
    },
    "principled": {"type": "principled", "base_color": PAINT, "roughness": 0.6},
    "principled_coated": {
        "type": "principled", "base_color": PAINT, "roughness": 0.5, "spec_tint": 0.6, "sheen": 0.5, "sheen_tint": 0.4,
        "clearcoat": 0.8, "clearcoat_gloss": 0.3, "flatness": 0.3,
    },
    "principled_glass": {
        "type": "principled", "base_color": PAINT, "metallic": 0.2, "roughness": 0.6, "spec_trans": 0.7, "eta": 1.5,
    },
    "principled_ior": {"type": "principled", "base_color": PAINT, "roughness": 0.4, "eta": 1.8},
    "rough_plastic": {"type": "roughplastic", **COATED, "distribution": "ggx", "alpha": 0.1},
    "rough_plastic_beckmann": {
        "type": "roughplastic", **COATED, "distribution": "beckmann", "alpha": 0.3, "nonlinear": True,
        "specular_reflectance": TINTS["specular_reflectance"],
    },
    "rough_plastic_very": {"type": "roughplastic", **COATED, "distribution": "ggx", "alpha": 0.6},
}

rows = []


def add(name, what, wo, wi, value):
    rows.append(",".join([name, what, *(f"{x:.8g}" for x in [*wo, *wi, *value])]))


for name, record in MATERIALS.items():
    bsdf = mi.load_dict(record)
    ctx = mi.BSDFContext()
    for wo in [direction(*d) for d in [(3, 0), (40, 20), (75, 0), (88, 200), (130, 20)]]:
        si = mi.SurfaceInteraction3f()
        si.wi = wo
        for wi in [direction(*d) for d in [(10, 170), (42, 205), (78, 178), (60, 60), (150, 200)]]:
            value = bsdf.eval(ctx, si, wi)
            if max(value) > 0:
                add(name, "value", wo, wi, [x / abs(wi[2]) for x in value])
        if mi.has_flag(bsdf.flags(), mi.BSDFFlags.Delta):
            # The first number chooses the lobe: a low one reflection.
            for u, what in [(0.0, "reflect"), (0.999999, "transmit")]:
                sample, weight = bsdf.sample(ctx, si, u, [0.5, 0.5])
                if sample.sampled_type & int(mi.BSDFFlags.Delta):
                    add(name, what, wo, sample.wo, [x * sample.pdf for x in weight])

path = pathlib.Path(__file__).with_suffix(".csv")
path.write_text("\n".join(rows) + "\n")
