"""Small scenes of bpy for the tests, built from nothing."""

import math

import bpy
from mathutils import Euler, Vector


def empty():
    """An empty scene without light from the world."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background().inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    return scene


def background():
    return bpy.context.scene.world.node_tree.nodes["Background"]


def link(name, data):
    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    return made


def camera(location, target, lens=35.0):
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    made = link("Camera", data)
    made.location = location
    made.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.camera = made
    return made


def light(kind, location, energy, target=(0.0, 0.0, 0.0), name=None, **values):
    data = bpy.data.lights.new(name or kind.title(), kind)
    data.energy = energy
    for key, value in values.items():
        setattr(data, key, value)
    made = link(data.name, data)
    made.location = location
    made.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    return made


def mesh(name, vertices, faces, uv=None):
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    if uv is not None:
        layer = data.uv_layers.new(name="UVMap")
        for loop, value in zip(layer.uv, uv):
            loop.vector = value
    data.update()
    return link(name, data)


def plane(name="Plane", size=4.0, location=(0.0, 0.0, 0.0), rotation=(0.0, 0.0, 0.0), material=None):
    half = size / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    made = mesh(name, corners, [(0, 1, 2, 3)], [(0, 0), (1, 0), (1, 1), (0, 1)])
    made.location = location
    made.rotation_euler = Euler(rotation)
    if material:
        made.data.materials.append(material)
    return made


def cube(name="Cube", size=1.0, location=(0.0, 0.0, 0.0), material=None):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    return _finish(name, material)


def ball(name="Ball", radius=0.5, location=(0.0, 0.0, 0.0), material=None, smooth=True, segments=64):
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=location, segments=segments, ring_count=segments // 2)
    made = _finish(name, material)
    if smooth:
        made.data.shade_smooth()
    return made


def _finish(name, material):
    made = bpy.context.object
    made.name = made.data.name = name
    if material:
        made.data.materials.append(material)
    return made


def material(name="Material", node="ShaderNodeBsdfPrincipled", **inputs):
    """A material of one shader node; `inputs` by name, with _ for spaces."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    shader = tree.nodes.new(node)
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    set_inputs(shader, inputs)
    return made


def set_inputs(shader, inputs):
    for name, value in inputs.items():
        socket = shader.inputs[name.replace("_", " ")]
        if socket.type == "RGBA" and len(value) == 3:
            value = (*value, 1.0)
        socket.default_value = value


def diffuse(name="Diffuse", color=(0.6, 0.5, 0.4)):
    return material(name, "ShaderNodeBsdfDiffuse", Color=color)


def degrees(*angles):
    return tuple(math.radians(angle) for angle in angles)
