"""Animations of glTF files that Blender writes: positions over time, in Blender and in the program."""

import math
import os
import pathlib
import re
import subprocess
import tempfile
import unittest

import bpy
import numpy as np
import scenes
from test_export_motion import moves

FRAMES = (1, 2, 2.5, 3)


def box_of_blender(frame):
    """Corners of the bounding box of all vertices, with y up."""
    scene = bpy.context.scene
    scene.frame_set(math.floor(frame), subframe=frame % 1.0)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    points = []
    for thing in scene.objects:
        if thing.type == "MESH":
            evaluated = thing.evaluated_get(depsgraph)
            points += [evaluated.matrix_world @ vertex.co for vertex in evaluated.to_mesh().vertices]
            evaluated.to_mesh_clear()
    points = np.array([(x, z, -y) for x, y, z in points])
    return points.min(axis=0), points.max(axis=0)


def box_of_file(file, frame):
    command = [os.environ["BEAMFARM"], "explain", file, "-D", f"animation.frame={frame}"]
    told = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    corners = re.search(r"^at  all of them: \[(.*)\] to \[(.*)\]$", told, re.MULTILINE).groups()
    return [np.array([float(x) for x in corner.split(",")]) for corner in corners]


def skinned():
    """A bar with two joints, of which the upper one bends."""
    armature = bpy.data.armatures.new("Bones")
    bones = scenes.link("Bones", armature)
    bpy.context.view_layer.objects.active = bones
    bpy.ops.object.mode_set(mode="EDIT")
    for name, low in (("Lower", 0.0), ("Upper", 1.0)):
        bone = armature.edit_bones.new(name)
        bone.head, bone.tail = (0.0, 0.0, low), (0.0, 0.0, low + 1.0)
    armature.edit_bones["Upper"].parent = armature.edit_bones["Lower"]
    bpy.ops.object.mode_set(mode="OBJECT")
    rings = [(x, y, z) for z in (0.0, 0.7, 1.3, 2.0) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = [(4 * k + i, 4 * k + (i + 1) % 4, 4 * k + (i + 1) % 4 + 4, 4 * k + i + 4) for k in range(3) for i in range(4)]
    bar = scenes.mesh("Bar", [(0.2 * x, 0.2 * y, z) for x, y, z in rings], faces)
    for name, weights in (("Lower", (1.0, 0.75, 0.25, 0.0)), ("Upper", (0.0, 0.25, 0.75, 1.0))):
        group = bar.vertex_groups.new(name=name)
        for vertex in bar.data.vertices:
            group.add([vertex.index], weights[vertex.index // 4], "REPLACE")
    bar.parent = bones
    bar.modifiers.new("Armature", "ARMATURE").object = bones
    upper = bones.pose.bones["Upper"]
    upper.rotation_mode = "XYZ"
    moves(upper, "rotation_euler", (0.0, 0.0, 0.0), (0.4, 0.0, 0.0), (1.2, 0.0, 0.0))


def nested():
    """A ball off the centre of something that rotates and grows."""
    parent = scenes.link("Arm", None)
    cube = scenes.ball("Cube", 0.5, (2.0, 0.0, 0.5), scenes.diffuse("Red"), segments=8)
    cube.parent = parent
    moves(parent, "rotation_euler", (0.0, 0.0, 0.0), (0.0, 0.0, 0.2), (0.1, 0.0, 0.4))
    moves(cube, "scale", (1.0, 1.0, 1.0), (1.2, 1.0, 0.9), (2.0, 1.0, 0.5))


def morphed():
    ball = scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), scenes.diffuse("Red"), segments=8)
    ball.shape_key_add(name="Basis")
    key = ball.shape_key_add(name="Long")
    for point in key.data:
        point.co.x *= 3.0
    moves(key, "value", 0.0, 0.3, 1.0)


class GltfMotion(unittest.TestCase):
    def test_things_are_where_blender_has_them(self):
        for make in (skinned, nested, morphed):
            with self.subTest(make.__name__), tempfile.TemporaryDirectory() as folder:
                scenes.empty()
                scene = bpy.context.scene
                scene.render.fps, scene.frame_start, scene.frame_end = 24, 1, 3
                make()
                file = pathlib.Path(folder) / "moving.glb"
                bpy.ops.export_scene.gltf(filepath=str(file), export_animations=True)
                boxes = []
                for frame in FRAMES:
                    theirs, ours = box_of_blender(frame), box_of_file(file, frame)
                    # Between two whole frames the file has an arc where Blender has three angles.
                    off = 1e-3 if frame % 1.0 == 0.0 else 1e-2
                    np.testing.assert_allclose(ours, theirs, atol=off, err_msg=f"frame {frame}")
                    boxes.append(theirs)
                self.assertGreater(np.abs(np.subtract(boxes[0], boxes[-1])).max(), 0.1)


if __name__ == "__main__":
    unittest.main()
