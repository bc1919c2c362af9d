"""Mitsuba 3: a dictionary, and its volumetric path tracers. Its LLVM variant where there is an LLVM that it can use."""

import subprocess
import sys
import time

import numpy as np

from scenes import SCENES, Diffuse, Glass, Sphere, write_ply

NAME, PACKAGE = "Mitsuba", "mitsuba"


def variant():
    """The fastest variant that works. LLVM aborts the process where it is too old, hence another process."""
    test = ("import mitsuba as mi; mi.set_variant('llvm_ad_rgb'); import drjit as dr; "
            "dr.eval(mi.render(mi.load_dict(mi.cornell_box()), spp=1)); dr.sync_thread()")
    works = subprocess.run([sys.executable, "-c", test], capture_output=True).returncode == 0
    return "llvm_ad_rgb" if works else "scalar_rgb"


def dictionary(scene, size, folder):
    import mitsuba as mi

    rgb = lambda values: {"type": "rgb", "value": [float(v) for v in values]}
    camera = scene.camera
    chromatic = scene.medium and len(set(scene.medium.sigma_t)) > 1
    kind = "volpathmis" if chromatic else "volpath" if scene.medium else "path"
    out = {"type": "scene", "integrator": {"type": kind, "max_depth": scene.depth, "rr_depth": 8}}
    fog = {"type": "ref", "id": "fog"}
    if scene.medium:
        out["fog"] = {"type": "homogeneous", "sigma_t": rgb(scene.medium.sigma_t), "albedo": rgb(scene.medium.albedo),
                      "phase": {"type": "hg", "g": scene.medium.g}}
    out["camera"] = {
        "type": "perspective", "fov": camera["fov"], "near_clip": 1e-4, "far_clip": 1e4,
        "to_world": mi.ScalarTransform4f().look_at(camera["origin"], camera["target"], (0, 1, 0)),
        "film": {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"},
                 "component_format": "float32"},
        "sampler": {"type": "independent"}} | ({"medium": fog} if scene.room else {})
    for name, material in scene.materials.items():
        if isinstance(material, Diffuse):
            bsdf = {"type": "twosided", "b": {"type": "diffuse", "reflectance": rgb(material.reflectance)}}
        elif isinstance(material, Glass):
            bsdf = {"type": "dielectric", "int_ior": material.ior, "ext_ior": 1.0}
        else:
            bsdf = {"type": "twosided", "b": {"type": "conductor", "material": "none",
                                              "specular_reflectance": rgb(material.reflectance)}}
        out[f"bsdf-{name}"] = bsdf
    for item in scene.objects:
        if isinstance(item.shape, Sphere):
            shape = {"type": "sphere", "center": item.shape.center, "radius": item.shape.radius}
        else:
            file = folder / f"{item.name}.ply"
            write_ply(file, item.shape)
            shape = {"type": "ply", "filename": str(file), "face_normals": item.shape.normals is None}
        material = scene.materials[item.material]
        shape["bsdf"] = {"type": "ref", "id": f"bsdf-{item.material}"}
        if isinstance(material, Glass) and scene.room:
            shape["exterior"] = fog
        if isinstance(material, Glass) and material.filled:
            shape["interior"] = fog
        out[f"shape-{item.name}"] = shape
    for lamp in scene.lamps:
        out[f"lamp-{lamp.name}"] = {
            "type": "sphere", "center": [float(c) for c in lamp.center], "radius": lamp.radius,
            "bsdf": {"type": "diffuse", "reflectance": rgb((0, 0, 0))},
            "emitter": {"type": "area", "radiance": rgb(lamp.radiance)}}
    return out


def render(job):
    import mitsuba as mi

    mi.set_variant(variant())
    mi.set_log_level(mi.LogLevel.Error)
    if mi.variant().startswith("llvm"):
        import drjit as dr

        dr.set_thread_count(job.threads)
    source = SCENES[job.scene].check() if job.check else SCENES[job.scene]
    scene = mi.load_dict(dictionary(source, job.size, job.folder))
    # Renders are short, so that none ends much too late. The first one compiles, which does not count.
    draw = lambda spp, seed: np.array(mi.render(scene, spp=spp, seed=seed), dtype=np.float64)[..., :3]
    draw(1, 0)
    spp, taken = 1, 0.0
    while taken < min(0.4, job.seconds[0] / 8) and spp < 64:
        spp *= 2
        begun = time.time()
        draw(spp, spp)
        taken = time.time() - begun
    total, count, begun = 0, 0, time.time()
    for seconds in job.seconds:
        while time.time() - begun < seconds - taken / 2:
            count += 1
            total = total + draw(spp, job.seed * 1_000_000 + count)
        elapsed = time.time() - begun
        mi.Bitmap((total / count).astype(np.float32)).write(str(job.image(seconds)))
        job.done(seconds, elapsed, f"{count * spp} samples a pixel, {mi.variant()}")


def version(_):
    import mitsuba as mi

    return f"Mitsuba {mi.__version__}, {variant()}"
