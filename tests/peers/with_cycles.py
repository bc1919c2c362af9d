"""Cycles, as Blender's Python package has it: meshes, shader nodes, 2 threads of the processor."""

import time

import numpy as np

from scenes import SCENES, Diffuse, Glass, Mesh, Sphere

NAME, PACKAGE = "Cycles", "bpy"


def fog_of(scene):
    """Closed boundary of the fog. Volumes add up where they overlap, so it has holes, a hair larger than the glass."""
    (x, y, z), (X, Y, Z) = np.array(scene.room) + [[-0.01], [0.01]]
    corners = [(x, y, z), (X, y, z), (X, Y, z), (x, Y, z), (x, y, Z), (X, y, Z), (X, Y, Z), (x, Y, Z)]
    sides = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (3, 7, 6, 2), (0, 4, 7, 3), (1, 2, 6, 5)]
    parts = [Mesh(np.array(corners), np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))]))]
    for item in scene.objects:
        if isinstance(scene.materials[item.material], Glass):
            shape = item.shape.mesh() if isinstance(item.shape, Sphere) else item.shape
            middle = shape.vertices.mean(0)
            parts.append(Mesh(middle + 1.001 * (shape.vertices - middle), shape.faces[:, ::-1]))
    starts = np.cumsum([0] + [len(part.vertices) for part in parts])
    return Mesh(np.concatenate([part.vertices for part in parts]),
                np.concatenate([part.faces + start for part, start in zip(parts, starts)]))


def build(bpy, scene):
    def material(name, surface, volume=None):
        out = bpy.data.materials.new(name)
        out.use_nodes = True
        nodes, links = out.node_tree.nodes, out.node_tree.links
        nodes.clear()
        end = nodes.new("ShaderNodeOutputMaterial")
        kind, values = surface
        links.new(node(nodes, kind, values).outputs[0], end.inputs["Surface"])
        if volume:
            both = nodes.new("ShaderNodeAddShader")
            scatter, absorb = max(volume.sigma_s), max(volume.sigma_a)
            links.new(node(nodes, "ShaderNodeVolumeScatter", {
                "Color": rgba(np.divide(volume.sigma_s, scatter)), "Density": scatter, "Anisotropy": volume.g,
            }).outputs[0], both.inputs[0])
            links.new(node(nodes, "ShaderNodeVolumeAbsorption", {
                "Color": rgba(1 - np.divide(volume.sigma_a, absorb)), "Density": absorb}).outputs[0], both.inputs[1])
            links.new(both.outputs[0], end.inputs["Volume"])
        return out

    def add(name, mesh, material, smooth):
        data = bpy.data.meshes.new(name)
        data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
        if smooth:
            data.polygons.foreach_set("use_smooth", [True] * len(data.polygons))
            data.normals_split_custom_set_from_vertices(mesh.normals.tolist())
        data.materials.append(material)
        item = bpy.data.objects.new(name, data)
        bpy.context.scene.collection.objects.link(item)

    rgba = lambda values: (*(float(v) for v in values), 1.0)
    materials = {}
    for name, value in scene.materials.items():
        if isinstance(value, Diffuse):
            surface = "ShaderNodeBsdfDiffuse", {"Color": rgba(value.reflectance), "Roughness": 0.0}
        elif isinstance(value, Glass):
            surface = "ShaderNodeBsdfGlass", {"Color": (1, 1, 1, 1), "Roughness": 0.0, "IOR": value.ior}
        else:
            surface = "ShaderNodeBsdfAnisotropic", {"Color": rgba(value.reflectance), "Roughness": 0.0}
        filled = isinstance(value, Glass) and value.filled
        materials[name] = material(name, surface, scene.medium if filled else None)
    for item in scene.objects:
        mesh = item.shape.mesh() if isinstance(item.shape, Sphere) else item.shape
        add(item.name, mesh, materials[item.material], mesh.normals is not None)
    for lamp in scene.lamps:
        strength = max(lamp.radiance)
        emission = "ShaderNodeEmission", {"Color": rgba(np.divide(lamp.radiance, strength)), "Strength": strength}
        add(lamp.name, lamp.mesh(), material(lamp.name, emission), False)
    if scene.room:
        clear = "ShaderNodeBsdfTransparent", {"Color": (1, 1, 1, 1)}
        add("fog", fog_of(scene), material("fog", clear, scene.medium), False)


def node(nodes, kind, values):
    out = nodes.new(kind)
    for name, value in values.items():
        out.inputs[name].default_value = value
    return out


def camera(bpy, scene):
    from mathutils import Matrix

    origin, target = (np.array(scene.camera[key], float) for key in ("origin", "target"))
    back = (origin - target) / np.linalg.norm(origin - target)
    right = np.cross((0, 1, 0), back)
    right /= np.linalg.norm(right)
    columns = np.stack([right, np.cross(back, right), back, origin], 1)
    data = bpy.data.cameras.new("camera")
    data.angle, data.clip_start, data.clip_end = np.radians(scene.camera["fov"]), 1e-4, 1e4
    item = bpy.data.objects.new("camera", data)
    item.matrix_world = Matrix(np.vstack([columns, [0, 0, 0, 1]]).tolist())
    bpy.context.scene.collection.objects.link(item)
    bpy.context.scene.camera = item


def settings(scene, job, depth):
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = job.size
    render.resolution_percentage = 100
    render.threads_mode, render.threads = "FIXED", job.threads
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.use_compositing = render.use_sequencer = False
    cycles.device = "CPU"
    cycles.seed = job.seed
    cycles.samples, cycles.use_adaptive_sampling = 1_000_000, False
    cycles.pixel_filter_type, cycles.film_exposure = "BOX", 1.0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy, cycles.light_sampling_threshold = 0.0, 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    for kind in ("max", "diffuse", "glossy", "transmission", "volume", "transparent_max"):
        setattr(cycles, kind + "_bounces", depth)
    cycles.use_denoising = job.denoise
    if job.denoise:
        cycles.denoiser = "OPENIMAGEDENOISE"
    # Path guiding is Cycles' own means against noise like this.
    cycles.use_guiding = job.mode != "plain"


def render(job):
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    source = SCENES[job.scene].check() if job.check else SCENES[job.scene]
    build(bpy, source)
    camera(bpy, source)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("black")
    scene.world.color = (0, 0, 0)
    settings(scene, job, source.depth)
    for seconds in job.seconds:
        scene.cycles.time_limit = seconds
        scene.render.filepath = str(job.image(seconds))
        begun = time.time()
        bpy.ops.render.render(write_still=True)
        job.done(seconds, time.time() - begun, "path guiding" if scene.cycles.use_guiding else "")


def version(_):
    import bpy

    return f"Cycles of Blender {bpy.app.version_string}"
