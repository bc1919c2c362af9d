"""Writes mitsuba_bsdf.csv: values of rough BSDFs from Mitsuba 3 (made with 3.9.1, `pip install mitsuba`).

Columns: conductor or dielectric; alpha; eta (inside over outside); k; radiance or flux; wo; wi (both leave the surface);
BSDF value without the cosine (for flux mode Mitsuba's `Importance`); density of wi.
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


def scatterings(outgoing, incoming):
    for wo in outgoing:
        for wi in incoming:
            yield direction(*wo), direction(*wi)


rows = []


def add(name, bsdf, alpha, eta, k, modes, pairs):
    for wo, wi in pairs:
        for mode, label in modes:
            si = mi.SurfaceInteraction3f()
            si.wi = wo
            ctx = mi.BSDFContext()
            ctx.mode = mode
            value = bsdf.eval(ctx, si, wi)[0] / abs(wi[2])
            pdf = bsdf.pdf(ctx, si, wi)
            numbers = [*wo, *wi, value, pdf]
            rows.append(",".join([name, f"{alpha},{eta},{k}", label, *(f"{x:.8g}" for x in numbers)]))


RADIANCE = (mi.TransportMode.Radiance, "radiance")
FLUX = (mi.TransportMode.Importance, "flux")
outgoing = [(3, 0), (40, 20), (75, 0), (88, 200)]
incoming = [(10, 170), (42, 205), (78, 178), (120, 190), (150, 200), (174, 10)]

for alpha in [0.1, 0.6]:
    for eta, k in [(0.2, 3.9), (1.4, 1.6)]:
        bsdf = mi.load_dict({
            "type": "roughconductor", "distribution": "ggx", "alpha": alpha,
            "eta": {"type": "rgb", "value": eta}, "k": {"type": "rgb", "value": k},
        })
        add("conductor", bsdf, alpha, eta, k, [RADIANCE], scatterings(outgoing, incoming[:4]))
    for eta in [1.5, 0.75]:
        bsdf = mi.load_dict({
            "type": "roughdielectric", "distribution": "ggx", "alpha": alpha,
            "int_ior": eta, "ext_ior": 1.0,
        })
        add("dielectric", bsdf, alpha, eta, 0, [RADIANCE, FLUX],
            scatterings([*outgoing, (100, 30), (165, 0)], incoming))

path = pathlib.Path(__file__).with_suffix(".csv")
path.write_text("\n".join(rows) + "\n")
