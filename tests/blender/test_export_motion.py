"""Motion while the shutter is open, against Cycles with the same shutter.

Cycles does not blur changes of lights, colours or materials: for those the truth is the mean of its stills at the
midpoints of equal parts of the time. Pictures may differ by the allowance of `compare.check`: means by 1 % and 3
standard errors, blocks by 5 standard errors, 4 % of the block and 2 % of the mean.
"""

import math
import unittest

import bpy
import compare
import scenes
from mathutils import Euler

STILLS = 16


def room(shutter=1.0, position="START"):
    scene = scenes.empty()
    compare.use_cycles(samples=128)
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
    scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))
    scene.render.use_motion_blur = True
    scene.render.motion_blur_shutter = shutter
    scene.render.motion_blur_position = position
    scene.frame_set(1)
    return scene


def moves(block, path, *values):
    """Linear keys of a property, from frame 1 on."""
    for frame, value in enumerate(values, start=1):
        setattr(block, path, value)
        block.keyframe_insert(path, frame=frame)
    straighten(block.id_data)
    bpy.context.scene.frame_set(1)


def curves(action):
    """All curves of an action; since Blender 5.0 they are in layers."""
    if hasattr(action, "fcurves"):
        return list(action.fcurves)
    bags = [bag for layer in action.layers for strip in layer.strips for bag in strip.channelbags]
    return [curve for bag in bags for curve in bag.fcurves]


def straighten(block):
    for curve in curves(block.animation_data.action):
        curve.extrapolation = "LINEAR"
        for key in curve.keyframe_points:
            key.interpolation = "LINEAR"


def lamp():
    return scenes.light("SUN", (2.0, -2.0, 3.0), 3.0, angle=0.0)


def middles(shutter=1.0, opens=0.0, count=STILLS):
    return [1.0 + opens + shutter * (k + 0.5) / count for k in range(count)]


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Blur(unittest.TestCase):
    def check(self, name, passes=48, **how):
        result = compare.check(self, name, passes=passes, **how)
        self.assertIn("[animation]", result.text)
        self.assertEqual(result.left_out, [])
        return result

    def test_a_ball_that_slides(self):
        for position in ("START", "CENTER", "END"):
            with self.subTest(position):
                room(0.8, position)
                lamp()
                ball = scenes.ball("Ball", 0.4, (0.0, 0.0, 0.4), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
                moves(ball, "location", (-1.0, 0.0, 0.4), (1.0, 0.3, 0.6))
                self.check(f"a sliding ball, {position.lower()}")

    def test_a_bar_that_turns(self):
        room()
        lamp()
        bar = scenes.cube("Bar", 1.0, (0.0, 0.0, 0.5), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
        bar.scale = (2.4, 0.2, 0.3)
        bar.cycles.motion_steps = 3
        moves(bar, "rotation_euler", Euler((0.0, 0.0, 0.0)), Euler((0.0, 0.0, math.radians(100.0))))
        self.check("a turning bar")

    def test_what_a_parent_moves(self):
        room()
        lamp()
        bpy.ops.object.empty_add()
        empty = bpy.context.object
        cube = scenes.cube("Cube", 0.5, (1.0, 0.0, 0.4), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
        cube.parent = empty
        cube.cycles.motion_steps = 3
        moves(empty, "rotation_euler", Euler((0.0, 0.0, 0.0)), Euler((0.0, 0.0, 1.2)))
        self.check("a parent that turns")

    def test_cameras(self):
        for kind in ("slides", "turns", "zooms", "orthographic"):
            with self.subTest(kind):
                room()
                lamp()
                scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
                scenes.cube("Blue", 0.6, (-1.2, 0.8, 0.3), scenes.diffuse("Blue", (0.2, 0.3, 0.8)))
                camera = bpy.context.scene.camera
                turn = camera.rotation_euler.copy()
                if kind == "slides":
                    moves(camera, "location", (0.0, -4.0, 3.0), (0.5, -3.6, 3.2))
                elif kind == "turns":
                    moves(camera, "rotation_euler", turn, Euler((turn.x, turn.y + 0.3, turn.z + 0.2)))
                elif kind == "zooms":
                    moves(camera.data, "lens", 30.0, 40.0)
                else:
                    camera.data.type = "ORTHO"
                    moves(camera.data, "ortho_scale", 4.0, 5.0)
                # Cycles does not blur the scale of an orthographic camera.
                self.check(f"camera {kind}", times=middles() if kind == "orthographic" else None)

    def test_a_mesh_that_deforms(self):
        room()
        lamp()
        ball = scenes.ball("Ball", 0.5, (0.0, 0.0, 0.6), scenes.diffuse("Red", (0.8, 0.3, 0.2)), segments=32)
        ball.shape_key_add(name="Basis")
        key = ball.shape_key_add(name="Long")
        for point in key.data:
            point.co.x += 1.5 * (point.co.z + 0.5)
            point.co.z *= 0.6
        moves(key, "value", 0.0, 1.0)
        result = self.check("a mesh that deforms")
        self.assertIn("toward", result.text)

    def test_instances(self):
        room()
        lamp()
        collection = bpy.data.collections.new("Balls")
        red = scenes.diffuse("Red", (0.8, 0.3, 0.2))
        for x in (-0.4, 0.4):
            ball = scenes.ball("Ball", 0.25, (x, 0.0, 0.3), red, segments=32)
            bpy.context.collection.objects.unlink(ball)
            collection.objects.link(ball)
        for k in range(2):
            empty = scenes.link(f"Empty{k}", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", collection
            empty.location = (0.0, 1.0 - 1.2 * k, 0.0)
            if k:
                moves(empty, "location", (-0.6, -0.2, 0.0), (0.6, -0.2, 0.3))
        result = self.check("instances")
        # Two balls, each in an instance of one of the two collections.
        self.assertEqual(result.text.count("keys ="), 2)

    def test_instances_of_points(self):
        room()
        lamp()
        red = scenes.diffuse("Red", (0.8, 0.3, 0.2))
        bar = scenes.cube("Bar", 0.4, material=red)
        bar.scale = (1.0, 0.3, 0.3)
        points = scenes.mesh("Points", [(-1.0, 0.0, 0.0), (0.0, 0.5, 0.0), (1.0, 0.0, 0.2)], [])
        node = points.modifiers.new("Nodes", "NODES")
        node.node_group = tree = bpy.data.node_groups.new("Copies", "GeometryNodeTree")
        tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
        tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
        kinds = ("NodeGroupInput", "GeometryNodeInstanceOnPoints", "GeometryNodeObjectInfo", "NodeGroupOutput")
        start, copies, of_bar, end = (tree.nodes.new(kind) for kind in kinds)
        of_bar.inputs["Object"].default_value, of_bar.transform_space = bar, "ORIGINAL"
        of_bar.inputs["As Instance"].default_value = True
        tree.links.new(start.outputs[0], copies.inputs["Points"])
        tree.links.new(of_bar.outputs["Geometry"], copies.inputs["Instance"])
        tree.links.new(copies.outputs[0], end.inputs[0])
        moves(copies.inputs["Rotation"], "default_value", Euler((0.0, 0.0, 0.0)), Euler((0.0, 0.0, 1.5)))
        bar.location, points.location = (0.0, 0.0, -2.0), (0.0, 0.0, 0.4)
        points.cycles.motion_steps = bar.cycles.motion_steps = 2
        result = self.check("instances of points")
        self.assertIn("transforms = { keys", result.text)
        self.assertEqual(result.text.count("keys ="), 1)

    def test_lights_that_move(self):
        for kind, energy, values in (
            ("POINT", 60.0, {"shadow_soft_size": 0.2, "use_soft_falloff": False}),
            ("POINT", 60.0, {"shadow_soft_size": 0.0, "use_soft_falloff": False}),
            ("SPOT", 120.0, {"shadow_soft_size": 0.0, "spot_size": math.radians(50.0), "spot_blend": 0.3}),
            ("AREA", 40.0, {"size": 0.6}),
            ("SUN", 3.0, {"angle": 0.0}),
        ):
            with self.subTest(kind, **values):
                room()
                scenes.ball("Ball", 0.3, (0.0, 0.0, 0.3), scenes.diffuse("Red", (0.8, 0.3, 0.2)), segments=32)
                light = scenes.light(kind, (-1.0, 0.3, 2.0), energy, **values)
                light.cycles.motion_steps = 3
                moves(light, "location", (-1.0, 0.3, 2.0), (1.0, 0.3, 1.5))
                turn = light.rotation_euler.copy()
                moves(light, "rotation_euler", turn, Euler((turn.x + 0.3, turn.y - 0.5, turn.z)))
                self.check(f"moving {kind.lower()}, {values}", times=middles())

    def test_light_that_changes(self):
        room()
        light = scenes.light("POINT", (0.5, 0.3, 2.0), 50.0, shadow_soft_size=0.0, use_soft_falloff=False)
        moves(light.data, "energy", 0.0, 80.0)
        other = scenes.light("POINT", (-1.0, -0.3, 1.0), 20.0, shadow_soft_size=0.1, use_soft_falloff=False)
        moves(other.data, "color", (1.0, 0.2, 0.1), (0.1, 0.3, 1.0))
        world = bpy.context.scene.world.node_tree
        world.nodes["Background"].inputs["Color"].default_value = (0.5, 0.6, 0.7, 1.0)
        moves(world.nodes["Background"].inputs["Strength"], "default_value", 0.0, 0.4)
        self.check("light that changes", times=middles())

    def test_materials_that_change(self):
        room()
        lamp()
        made = scenes.diffuse("Red", (0.8, 0.1, 0.1))
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), made)
        glow = scenes.material("Glow", "ShaderNodeEmission", Strength=0.0)
        scenes.cube("Lamp", 0.4, (-1.2, 0.5, 0.6), glow)
        for owner, kind, name, values in (
            (made, "BSDF_DIFFUSE", "Color", ((0.8, 0.1, 0.1, 1.0), (0.1, 0.1, 0.8, 1.0))),
            (glow, "EMISSION", "Strength", (0.0, 4.0)),
        ):
            socket = next(node for node in owner.node_tree.nodes if node.type == kind).inputs[name]
            moves(socket, "default_value", *values)
        self.check("materials that change", times=middles())


if __name__ == "__main__":
    unittest.main()
