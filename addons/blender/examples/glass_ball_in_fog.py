"""A glass ball under a spot in fog: path tracers show its light as speckle, if at all.

Run it in Blender's text editor, or as `blender --python glass_ball_in_fog.py`, with the add-on beamfarm enabled; then
press F12. The glass focuses the light into the cone below the ball, and the fog makes it visible.
"""

import bpy


def clean_scene() -> bpy.types.Scene:
    """An empty scene."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing, do_unlink=True)
    return bpy.context.scene


def node_material(name: str, kind: str, **inputs: object) -> bpy.types.Material:
    """A material with a single shader node."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(kind)
    for socket, value in inputs.items():
        shader.inputs[socket.replace("_", " ")].default_value = value
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def fog(density: float, anisotropy: float) -> bpy.types.World:
    """A world full of fog and otherwise dark."""
    world = bpy.data.worlds.new("Fog")
    world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Density"].default_value = density
    scatter.inputs["Anisotropy"].default_value = anisotropy
    output = tree.nodes.new("ShaderNodeOutputWorld")
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    return world


def ball() -> None:
    """A glass ball. Smooth normals alone do not bend light like a sphere, so it has enough triangles."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=6, radius=0.6, location=(0.0, 0.0, 1.7))
    thing = bpy.context.object
    thing.name = "Ball"
    bpy.ops.object.shade_smooth()
    thing.data.materials.append(node_material("Glass", "ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.5))


def floor() -> None:
    """The floor on which the light ends."""
    bpy.ops.mesh.primitive_plane_add(size=12.0)
    thing = bpy.context.object
    thing.name = "Floor"
    thing.data.materials.append(node_material("Paint", "ShaderNodeBsdfDiffuse", Color=(0.3, 0.3, 0.3, 1.0)))


def spot() -> None:
    """A spot straight above the ball, hardly wider than the ball."""
    bpy.ops.object.light_add(type="SPOT", location=(0.0, 0.0, 5.0))
    light = bpy.context.object.data
    light.energy = 9000.0
    light.spot_size = 0.42
    light.spot_blend = 0.2
    light.shadow_soft_size = 0.0


def camera(scene: bpy.types.Scene) -> None:
    """A camera at the side, a little above the floor."""
    bpy.ops.object.camera_add(location=(0.0, -6.5, 1.9), rotation=(1.535, 0.0, 0.0))
    scene.camera = bpy.context.object
    scene.camera.data.lens = 45.0


def main() -> None:
    scene = clean_scene()
    floor()
    ball()
    spot()
    camera(scene)
    scene.world = fog(density=0.06, anisotropy=0.3)
    scene.render.engine = "BEAMFARM"
    scene.render.resolution_x, scene.render.resolution_y = 640, 480
    scene.beamfarm.passes = 64


if __name__ == "__main__":
    main()
