"""Bakes nodes' outputs in a separate Blender process, whose changes to scenes and meshes vanish with it.

Run as `baker.py FOLDER` by a Python with bpy, or by Blender with `--python baker.py -- FOLDER`. The folder holds
`job.json`, as written by `bakes.Bakes`, and `data.blend`. In the end it has an array `NAME.npy` for everything baked,
and a line in `failed.json` for everything that was not.
"""

import json
import sys
from pathlib import Path

import bpy
import numpy as np

PANORAMA = "EQUIRECTANGULAR"


def _copied(tree, groups):
    """The inner trees on the path to a node, each made unique to its group node."""
    trees = [tree]
    for name in groups:
        group = trees[-1].nodes[name]
        group.node_tree = group.node_tree.copy()
        trees.append(group.node_tree)
    return trees


def _lead_out(tree, what):
    """A socket of `tree` that carries the output of a node within its groups."""
    trees = _copied(tree, what["groups"])
    node = trees[-1].nodes[what["node"]]
    socket = next(each for each in node.outputs if each.identifier == what["socket"])
    kind = {"VALUE": "NodeSocketFloat", "VECTOR": "NodeSocketVector"}.get(socket.type, "NodeSocketColor")
    for outer, inner, name in reversed([*zip(trees, trees[1:], what["groups"])]):
        outputs = [each for each in inner.nodes if each.type == "GROUP_OUTPUT"]
        end = next((each for each in outputs if each.is_active_output), None) or inner.nodes.new("NodeGroupOutput")
        made = inner.interface.new_socket("baked", in_out="OUTPUT", socket_type=kind)
        inner.links.new(socket, next(each for each in end.inputs if each.identifier == made.identifier))
        socket = next(each for each in outer.nodes[name].outputs if each.identifier == made.identifier)
    return socket


def _cycles(samples):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0.0
    return scene


def world(what, folder, samples):
    """A panorama of the world, rows from the bottom up, +x in the middle; for a sky with a sun, without the sun."""
    scene = _cycles(samples)
    made = bpy.data.worlds[what["world"]].copy()
    scene.world = made
    tree = made.node_tree
    socket = _lead_out(tree, what)
    if hasattr(socket.node, "sun_disc"):
        socket.node.sun_disc = False
    for node in [each for each in tree.nodes if each.bl_idname == "ShaderNodeOutputWorld"]:
        tree.nodes.remove(node)
    output, shader = tree.nodes.new("ShaderNodeOutputWorld"), tree.nodes.new("ShaderNodeBackground")
    tree.links.new(socket, shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    camera = bpy.data.cameras.new("around")
    camera.type = "PANO"
    (camera if hasattr(camera, "panorama_type") else camera.cycles).panorama_type = PANORAMA
    scene.camera = bpy.data.objects.new("around", camera)
    scene.collection.objects.link(scene.camera)
    # At the origin, looking along +x, with +z up.
    scene.camera.rotation_euler = (0.5 * np.pi, 0.0, -0.5 * np.pi)
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = what["size"], what["size"] // 2, 100
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    scene.cycles.pixel_filter_type = "BOX"
    render.film_transparent = False
    render.filepath = str(folder / f"{what['file']}.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(render.filepath)
    image.colorspace_settings.name = "Non-Color"
    return _pixels(image)


def _pixels(image):
    width, height = image.size
    values = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(height, width, image.channels)[..., :3]


def _as_rendered(shown):
    """Modifiers as for renders."""
    for modifier in shown.modifiers:
        modifier.show_viewport = modifier.show_render
        if hasattr(modifier, "render_levels"):
            modifier.levels = modifier.render_levels


class Body:
    """A copy of an object as a mesh with its modifiers applied and its own UV."""

    def __init__(self, what, is_render):
        scene = bpy.context.scene
        shown = bpy.data.objects[what["object"]]
        scene.collection.objects.link(shown)
        if is_render:
            _as_rendered(shown)
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        evaluated = shown.evaluated_get(depsgraph)
        mesh = bpy.data.meshes.new_from_object(evaluated, preserve_all_data_layers=True, depsgraph=depsgraph)
        self.slots = [slot.material.original if slot.material else None for slot in evaluated.material_slots]
        scene.collection.objects.unlink(shown)
        # Object Info's random number depends on the name.
        self.shown, self.name = shown, shown.name
        shown.name = "beamfarm was this"
        if shown.type == "MESH":
            self.object = shown.copy()
            self.object.modifiers.clear()
            self.object.data = mesh
        else:
            self.object = bpy.data.objects.new(self.name, mesh)
            self.object.pass_index, self.object.color = shown.pass_index, shown.color
            self.object.matrix_world = evaluated.matrix_world.copy()
        self.object.name = self.name
        scene.collection.objects.link(self.object)
        self.mesh = mesh
        for each in list(bpy.context.selected_objects):
            each.select_set(False)
        self.object.select_set(True)
        bpy.context.view_layer.objects.active = self.object
        self.layer = self._unwrapped()

    def _unwrapped(self):
        layers = self.mesh.uv_layers
        shown = next((layer.name for layer in layers if layer.active_render), None)
        layer = layers.new(name="beamfarm baked", do_init=False)
        if layer is None:
            raise ValueError("its mesh has no room for one more UV map")
        name = layer.name
        layers.active = layer
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.reveal(select=False)
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.uv.smart_project(island_margin=0.004)
        bpy.ops.object.mode_set(mode="OBJECT")
        if shown is not None:
            self.mesh.uv_layers[shown].active_render = True
        return name

    def uv(self):
        """UV of its corners, followed by the vertex of each: these fit the original mesh if it is the same."""
        loops = len(self.mesh.loops)
        values = np.empty(loops * 2, dtype=np.float32)
        self.mesh.uv_layers[self.layer].uv.foreach_get("vector", values)
        vertices = np.empty(loops, dtype=np.int32)
        self.mesh.loops.foreach_get("vertex_index", vertices)
        return np.concatenate([values.reshape(-1, 2), vertices[:, None].astype(np.float32)], axis=1)

    def bake(self, what, samples):
        """Pixels of one output of one material on the mesh."""
        _cycles(samples)
        size = what["size"]
        image = bpy.data.images.new("baked", size, size, float_buffer=True, is_data=True)
        wanted = bpy.data.materials[what["material"]]
        made = wanted.copy()
        socket = _lead_out(made.node_tree, what)
        _shine(made.node_tree, socket, image)
        dark = bpy.data.materials.new("dark")
        dark.use_nodes = True
        dark.node_tree.nodes.clear()
        _shine(dark.node_tree, None, image)
        self.mesh.materials.clear()
        for material in self.slots or [wanted]:
            self.mesh.materials.append(made if material == wanted else dark)
        for slot in self.object.material_slots:
            slot.link = "DATA"
        bpy.ops.object.bake(type="EMIT", margin=16, margin_type="EXTEND", uv_layer=self.layer, use_clear=True)
        return _pixels(image)

    def remove(self):
        """Removes it."""
        bpy.data.objects.remove(self.object)
        self.shown.name = self.name


def _shine(tree, socket, image):
    """Makes a material emit only this colour, into an image."""
    for node in [each for each in tree.nodes if each.bl_idname == "ShaderNodeOutputMaterial"]:
        tree.nodes.remove(node)
    output, shader = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    shader.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    if socket is not None:
        tree.links.new(socket, shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    into = tree.nodes.new("ShaderNodeTexImage")
    into.image = image
    tree.nodes.active = into


def main(folder):
    """Runs the job of a folder."""
    job = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    bpy.ops.wm.read_factory_settings(use_empty=True)
    with bpy.data.libraries.load(str(folder / "data.blend")) as (there, here):
        here.objects, here.worlds, here.materials = there.objects, there.worlds, there.materials
    bpy.context.scene.frame_set(job["frame"], subframe=job["subframe"])
    failed = {}

    def save(name, values):
        np.save(folder / f"{name}.npy", values)

    def attempt(name, make):
        try:
            return make()
        except Exception as error:   # Whatever Blender raises, the others are baked.
            failed[name] = " ".join(str(error).split())
            return None

    for what in job["worlds"]:
        attempt(what["file"], lambda: save(what["file"], world(what, folder, job["samples"])))
    for what in job["objects"]:
        body = attempt(what["uv"], lambda: Body(what, job["is_render"]))
        if body is None:
            continue
        save(what["uv"], body.uv())
        for each in what["bakes"]:
            attempt(each["file"], lambda: save(each["file"], body.bake(each, job["samples"])))
        body.remove()
    (folder / "failed.json").write_text(json.dumps(failed), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[-1]))
