"""beamfarm: writes the scene as TOML and lets the program render it."""

import csv
import subprocess
import time

from scenes import SCENES, Diffuse, Glass, Sphere, write_ply

NAME, PACKAGE = "beamfarm", None


def text(scene, size, folder):
    """The scene file; meshes are written beside it."""
    show = lambda values: "[" + ", ".join(f"{float(v):.9g}" for v in values) + "]"
    out = [f"[image]\nwidth = {size}\nheight = {size}\n\n[camera]\norigin = {show(scene.camera['origin'])}\n"
           f"target = {show(scene.camera['target'])}\nfov = {scene.camera['fov']}.0\n"]
    if scene.room:
        out.append('[world]\nmedium = "fog"\n')
    if scene.medium:
        m = scene.medium
        out.append(f'[media.fog]\ntype = "homogeneous"\nsigma_a = {show(m.sigma_a)}\nsigma_s = {show(m.sigma_s)}\n'
                   f'phase = {{ type = "hg", g = {m.g} }}\n')
    for name, material in scene.materials.items():
        if isinstance(material, Glass):
            out.append(f'[materials.{name}]\ntype = "dielectric"\nior = {material.ior}\n')
        else:
            kind = "diffuse" if isinstance(material, Diffuse) else "mirror"
            out.append(f'[materials.{name}]\ntype = "{kind}"\nreflectance = {show(material.reflectance)}\n'
                       "two_sided = true\n")
    for item in scene.objects:
        head = f'[[shapes]]\nname = "{item.name}"\nmaterial = "{item.material}"\n'
        if getattr(scene.materials[item.material], "filled", False):
            head += 'interior = "fog"\n'
        if isinstance(item.shape, Sphere):
            head += f'type = "sphere"\ncenter = {show(item.shape.center)}\nradius = {item.shape.radius}\n'
        else:
            write_ply(folder / f"{item.name}.ply", item.shape)
            head += f'type = "mesh"\nfile = "{item.name}.ply"\n'
        out.append(head)
    for lamp in scene.lamps:
        out.append(f'[[shapes]]\nname = "{lamp.name}"\ntype = "sphere"\ncenter = {show(lamp.center)}\n'
                   f"radius = {lamp.radius}\nemission = {{ power = {show(lamp.power)} }}\n")
    return "\n".join(out)


def render(job):
    scene = SCENES[job.scene].check() if job.check else SCENES[job.scene]
    file = job.folder / f"{scene.name}.toml"
    file.write_text(text(scene, job.size, job.folder))
    for seconds in job.seconds:
        image = job.image(seconds)
        command = [job.program, "render", str(file), "-o", str(image), "--quiet", "--restart", "--seed", str(job.seed),
                   "--workers", "1", "--threads", str(job.threads)] + ["--denoise"] * job.denoise
        begun = time.time()
        if subprocess.run([*command, "--time", f"{seconds:g}s"]).returncode:
            # A busy machine did not complete a pass: there must be one. Other failures happen again.
            begun = time.time()
            subprocess.run([*command, "--passes", "1"], check=True)
        wall = time.time() - begun
        rows = list(csv.DictReader(image.with_suffix(".csv").open()))
        if job.denoise:
            image.with_suffix(".denoised.exr").replace(image)
        # Denoising comes after the last pass.
        job.done(seconds, wall if job.denoise else float(rows[-1]["wall_seconds"]), f"{rows[-1]['passes']} passes")


def version(program):
    return subprocess.run([program, "--version"], check=True, capture_output=True, text=True).stdout.splitlines()[0]
