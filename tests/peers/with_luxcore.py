"""LuxCore: properties. Its bidirectional path tracer with vertex merging or, see SETTINGS, what does better."""

import time

from scenes import SCENES, Diffuse, Glass, Sphere, write_ply

NAME, PACKAGE = "LuxCore", "pyluxcore"

BIDIRVM = {"renderengine.type": "BIDIRVMCPU", "sampler.type": "RANDOM"}
BIDIR = {"renderengine.type": "BIDIRCPU", "sampler.type": "SOBOL"}
METROPOLIS = BIDIR | {"sampler.type": "METROPOLIS"}
HYBRID = {"renderengine.type": "PATHCPU", "sampler.type": "SOBOL", "path.hybridbackforward.enable": 1,
          "path.hybridbackforward.partition": 0.5}
PATH = {"renderengine.type": "PATHCPU", "sampler.type": "SOBOL"}
PHOTONS = PATH | {"path.photongi.caustic.enabled": 1, "path.photongi.sampler.type": "METROPOLIS",
                  "path.photongi.photon.maxcount": 1_000_000, "path.photongi.photon.maxdepth": 16}
MODES = {"bidirvm": BIDIRVM, "bidir": BIDIR, "metropolis": METROPOLIS, "hybrid": HYBRID, "path": PATH,
         "photons": PHOTONS}
# In fog the bidirectional ones are 4 to 20 % brighter than LuxCore's own path tracer, hence that with light tracing.
SETTINGS = {"box-iso": "hybrid", "box-hg": "hybrid", "lantern": "hybrid"}


def properties(scene, size, folder):
    """The scene, as properties."""
    out = {}
    show = lambda values: " ".join(f"{float(v):.9g}" for v in values)
    camera = scene.camera
    out |= {"scene.camera.type": "perspective", "scene.camera.lookat.orig": show(camera["origin"]),
            "scene.camera.lookat.target": show(camera["target"]), "scene.camera.up": "0 1 0",
            "scene.camera.fieldofview": camera["fov"], "scene.camera.cliphither": 1e-4}
    # LuxCore's pictures lie a pixel lower than those of the others.
    out["scene.camera.screenwindow"] = show((-1, 1, -1 - 2 / size, 1 - 2 / size))
    if scene.medium:
        out |= {"scene.volumes.fog.type": "homogeneous", "scene.volumes.fog.multiscattering": 1,
                "scene.volumes.fog.absorption": show(scene.medium.sigma_a),
                "scene.volumes.fog.scattering": show(scene.medium.sigma_s),
                "scene.volumes.fog.asymmetry": show([scene.medium.g] * 3)}
    if scene.room:
        out["scene.world.volume.default"] = "fog"
    for name, material in scene.materials.items():
        key = f"scene.materials.{name}"
        if isinstance(material, Diffuse):
            out |= {f"{key}.type": "matte", f"{key}.kd": show(material.reflectance)}
        elif isinstance(material, Glass):
            # Volumes have the indices: where there are any, those of the material bend light wrongly.
            inside = "fog" if material.filled else f"inside-{name}"
            out |= {f"{key}.type": "glass", f"{key}.kr": "1 1 1", f"{key}.kt": "1 1 1",
                    f"{key}.volume.interior": inside, f"scene.volumes.{inside}.ior": material.ior}
            if not material.filled:
                out |= {f"scene.volumes.{inside}.type": "clear", f"scene.volumes.{inside}.absorption": "0 0 0"}
            if scene.room:
                out[f"{key}.volume.exterior"] = "fog"
        else:
            out |= {f"{key}.type": "mirror", f"{key}.kr": show(material.reflectance)}
    for lamp in scene.lamps:
        out |= {f"scene.materials.{lamp.name}.type": "matte", f"scene.materials.{lamp.name}.kd": "0 0 0",
                f"scene.materials.{lamp.name}.emission": show(lamp.radiance),
                # By default a lamp of more than 256 triangles is not sampled.
                f"scene.materials.{lamp.name}.emission.directlightsampling.type": "ENABLED"}
    lamps = [(lamp.name, lamp.mesh(), lamp.name) for lamp in scene.lamps]
    for name, shape, material in [(o.name, o.shape, o.material) for o in scene.objects] + lamps:
        file = folder / f"{name}.ply"
        write_ply(file, shape.mesh() if isinstance(shape, Sphere) else shape)
        out |= {f"scene.objects.{name}.ply": str(file), f"scene.objects.{name}.material": material}
    return out


def render(job):
    import pyluxcore

    pyluxcore.Init(lambda message: None)

    def made(values):
        out = pyluxcore.Properties()
        out.SetFromString("".join(f"{key} = {value}\n" for key, value in values.items()))
        return out

    source = SCENES[job.scene].check() if job.check else SCENES[job.scene]
    mode = job.mode or SETTINGS.get(source.name, "bidirvm")
    scene = pyluxcore.Scene()
    scene.Parse(made(properties(source, job.size, job.folder)))
    depth = source.depth
    config = {"film.width": job.size, "film.height": job.size, "film.filter.type": "BOX", "film.filter.xwidth": 0.5,
              "film.filter.ywidth": 0.5, "renderengine.seed": job.seed + 1, "native.threads.count": job.threads,
              "path.pathdepth.total": depth, "path.pathdepth.diffuse": depth, "path.pathdepth.glossy": depth,
              "path.pathdepth.specular": depth, "path.maxdepth": 20, "light.maxdepth": 20,
              "path.clamping.variance.maxvalue": 0, "film.outputs.0.type": "RGB", "film.outputs.0.filename": "x.exr",
              "film.imagepipeline.0.type": "NOP",
              # Few light paths a pass in small pictures, since a pass that is not complete darkens them.
              "bidirvm.lightpath.count": min(max(job.size**2 // 32, 1024), 4096)}
    session = pyluxcore.RenderSession(pyluxcore.RenderConfig(made(config | MODES[mode]), scene))
    # Photon maps are made before Start returns, and count.
    begun = time.time()
    session.Start()
    for seconds in job.seconds:
        while time.time() - begun < seconds:
            time.sleep(min(0.2, seconds / 20))
            session.UpdateStats()
        session.UpdateStats()
        elapsed = time.time() - begun
        samples = session.GetStats().Get("stats.renderengine.pass").GetInt()
        session.GetFilm().SaveOutput(str(job.image(seconds)), pyluxcore.FilmOutputType.RGB, made({}))
        job.done(seconds, elapsed, f"{mode}, {samples} samples a pixel")
    session.Stop()


def version(_):
    import pyluxcore

    return f"LuxCore {pyluxcore.Version()}"
