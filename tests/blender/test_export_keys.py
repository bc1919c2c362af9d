"""What gets keys while the shutter is open, and what does not. No renderer is needed."""

import math
import pathlib
import re
import subprocess
import tempfile
import tomllib
import unittest

import bpy
import compare
import numpy as np
import scenes
from export import ExportSettings, write_scene
from export.keys import on_its_way, over_time, turning
from mathutils import Euler
from test_export_motion import lamp, moves, room


def exported(text=False):
    result = compare.export_scene()
    return result.text if text else (tomllib.loads(result.text), result)


def keys(value):
    return [key for key in value["keys"]]


class Keys(unittest.TestCase):
    def test_what_stands_still_has_none(self):
        scene = room()
        lamp()
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), scenes.diffuse("Red"))
        with_blur = exported(text=True)
        scene.render.use_motion_blur = False
        self.assertEqual(with_blur, exported(text=True))
        self.assertNotIn("animation", with_blur)

    def test_they_are_at_the_times_of_the_shutter(self):
        for position, opens in (("START", 0.0), ("CENTER", -0.25), ("END", -0.5)):
            for steps in (1, 3):
                with self.subTest(position, steps=steps):
                    scene = room(0.5, position)
                    lamp()
                    ball = scenes.ball("Ball", 0.5, material=scenes.diffuse("Red"), segments=8)
                    ball.cycles.motion_steps = steps
                    moves(ball, "location", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
                    scene.frame_set(7, subframe=0.0)
                    table, _ = exported()
                    self.assertEqual(scene.frame_current_final, 7.0)
                    self.assertEqual(
                        table["animation"], {"frames": [7, 7], "frame": 7, "shutter": [opens, opens + 0.5]}
                    )
                    of_ball = next(shape for shape in table["shapes"] if shape["name"] == "Ball")
                    times = [time for time, _ in of_ball["transform"]["keys"]]
                    np.testing.assert_allclose(times, 7.0 + opens + np.linspace(0.0, 0.5, 2**steps + 1))
                    for time, value in of_ball["transform"]["keys"]:
                        self.assertAlmostEqual(value[0]["matrix"][0][3], time - 1.0, places=5)
                    self.assertNotIn("keys", str(table["lights"]) + str(table["camera"]))

    def test_what_is_told_not_to_blur(self):
        room()
        ball = scenes.ball("Ball", 0.5, material=scenes.diffuse("Red"), segments=8)
        moves(ball, "location", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        camera = bpy.context.scene.camera
        moves(camera, "location", (0.0, -4.0, 3.0), (1.0, -4.0, 3.0))
        ball.cycles.use_motion_blur = camera.cycles.use_motion_blur = False
        self.assertNotIn("keys", exported(text=True))

    def test_the_camera_of_the_frame_stays(self):
        scene = room()
        first = scene.camera
        second = scenes.camera((3.0, -4.0, 3.0), (0.0, 0.0, 0.0))
        for frame, camera in ((1, first), (1.4, second)):
            scene.timeline_markers.new(camera.name, frame=math.ceil(frame)).camera = camera
        scene.frame_set(1)
        scene.camera = first
        self.assertNotIn("keys", exported(text=True))

    def test_other_polygons_are_told(self):
        scene = room()
        ball = scenes.ball("Ball", 0.5, material=scenes.diffuse("Red"), segments=8)
        modifier = ball.modifiers.new("Build", "BUILD")
        modifier.frame_start, modifier.frame_duration = 1, 10
        scene.frame_set(4)
        _, result = exported()
        self.assertTrue(any("polygons that change" in note for note in result.notes), result.notes)
        self.assertNotIn("keys", result.text)

    def test_what_comes_or_goes_is_told(self):
        scene = room()
        ball = scenes.ball("Ball", 0.5, material=scenes.diffuse("Red"), segments=8)
        moves(ball, "location", (0.0, 0.0, 0.0), (1.0, 0.0, 0.0))
        for frame, hidden in ((1, False), (2, True)):
            ball.hide_viewport = ball.hide_render = hidden
            ball.keyframe_insert("hide_viewport", frame=frame)
            ball.keyframe_insert("hide_render", frame=frame)
        scene.frame_set(1)
        _, result = exported()
        self.assertTrue(any("appears or disappears" in note for note in result.notes), result.notes)

    def test_only_files_of_the_scene_are_left(self):
        for position in ("START", "CENTER", "END"):
            with self.subTest(position):
                room(position=position)
                ball = scenes.ball("Ball", 0.5, material=scenes.diffuse("Red"), segments=8)
                ball.shape_key_add(name="Basis")
                key = ball.shape_key_add(name="Long")
                key.slider_min, key.slider_max = -2.0, 2.0
                key.data[0].co.z += 1.0
                moves(key, "value", 0.0, 1.0)
                with tempfile.TemporaryDirectory() as folder:
                    depsgraph = bpy.context.evaluated_depsgraph_get()
                    result = write_scene(depsgraph, folder, ExportSettings(64, 48), compare.go_to)
                    named = set(re.findall(r"meshes/[^\"]+", result.scene.read_text()))
                    files = {f"meshes/{path.name}" for path in result.scene.parent.glob("meshes/*")}
                # The floor, and the ball at three times.
                self.assertEqual(len(files), 4)
                self.assertEqual(files, named)

    def test_a_mesh_goes_by_all_of_its_files(self):
        times = [0.0, 0.25, 0.5, 0.75, 1.0]
        table = on_its_way(times, list("abcde"))

        def at(value, time):
            if not isinstance(value, dict):
                return value
            return [held for start, held in value["keys"] if start <= time][-1]

        def share(time):
            return np.interp(time, *zip(*table["toward"]["weight"]["keys"]))

        for k in range(4):
            for part in (0.25, 0.75):
                time = times[k] + 0.25 * part
                weights = {at(table["file"], time): 1.0 - share(time), at(table["toward"]["file"], time): share(time)}
                self.assertEqual(weights, {"abcde"[k]: 1.0 - part, "abcde"[k + 1]: part})

    def test_a_turning_view_turns_evenly(self):
        def look(degrees):
            x, y = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
            return {"origin": [0.0, 0.0, 0.0], "target": [x, y, 0.0], "up": [0.0, 0.0, 1.0], "fov": 40.0}

        times, tables = turning([0.0, 1.0], [look(0.0), look(90.0)])
        self.assertEqual(len(times), 19)
        for time, table in zip(times, tables):
            np.testing.assert_allclose(table["target"], look(90.0 * time)["target"], atol=1e-6)

    def test_what_has_nothing_between_is_told(self):
        said = []

        def otherwise(values, field):
            said.append(field)
            return values[0]

        self.assertEqual(over_time([0.0, 1.0], [{"type": "a"}, {"type": "b"}], otherwise), {"type": "a"})
        self.assertEqual(said, ["type"])
        grey = over_time([0.0, 1.0], [0.5, [0.1, 0.2, 0.3]], otherwise)
        self.assertEqual(grey, {"keys": [[0.0, 0.5], [1.0, [0.1, 0.2, 0.3]]]})
        faded = over_time([0.0, 1.0], [{}, {"opacity": 0.5}], otherwise)
        self.assertEqual(faded, {"opacity": {"keys": [[0.0, 1.0], [1.0, 0.5]]}})

    def test_instances_move_by_themselves(self):
        room()
        red = scenes.diffuse("Red")
        collection = bpy.data.collections.new("Balls")
        ball = scenes.ball("Ball", 0.25, material=red, segments=8)
        bpy.context.collection.objects.unlink(ball)
        collection.objects.link(ball)
        moves(ball, "rotation_euler", Euler((0.0, 0.0, 0.0)), Euler((0.0, 0.0, 1.0)))
        for k in range(3):
            empty = scenes.link(f"Empty{k}", None)
            empty.instance_type, empty.instance_collection = "COLLECTION", collection
            empty.location = (k, 0.0, 0.0)
        table, _ = exported()
        self.assertEqual(str(table).count("'keys'"), 3)


class Frames(unittest.TestCase):
    def moving_room(self, shutter=None):
        scene = room(shutter or 0.5, "CENTER")
        scene.render.use_motion_blur = shutter is not None
        scene.frame_start, scene.frame_end = 1, 4
        lamp()
        ball = scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), scenes.diffuse("Red", (0.8, 0.3, 0.2)), segments=8)
        moves(ball, "location", (-1.0, 0.0, 0.5), (-0.5, 0.2, 0.5))
        jelly = scenes.cube("Jelly", 0.6, (1.0, 0.0, 0.4), scenes.diffuse("Green", (0.2, 0.7, 0.3)))
        jelly.shape_key_add(name="Basis")
        key = jelly.shape_key_add(name="Long")
        key.slider_min, key.slider_max = -4.0, 4.0
        key.data[0].co.x += 0.3
        moves(key, "value", 0.0, 0.5)
        camera = scene.camera
        moves(camera, "location", (0.0, -4.0, 3.0), (0.1, -4.0, 3.0))
        return scene

    def test_one_key_a_frame(self):
        for shutter, times in ((None, [1, 2, 3, 4]), (0.5, [0, 1, 2, 3, 4, 5])):
            with self.subTest(shutter=shutter), tempfile.TemporaryDirectory() as folder:
                scene = self.moving_room(shutter)
                scene.frame_set(3)
                result = compare.export_scene(folder, all_frames=True)
                table = tomllib.loads(result.text)
                self.assertEqual(scene.frame_current_final, 3.0)
                self.assertEqual(table["animation"]["frames"], [1, 4])
                self.assertEqual(table["animation"]["fps"], 24.0)
                self.assertEqual(table["animation"].get("shutter"), shutter and [-0.25, 0.25])
                floor, ball, jelly = table["shapes"]
                self.assertNotIn("keys", str(floor) + str(table["materials"]) + str(table["lights"]))
                for value in (ball["transform"], table["camera"]["origin"]):
                    self.assertEqual([time for time, _ in value["keys"]], times)
                self.assertRegex(jelly["file"], r"_####\.ply$")
                files = {f"meshes/{path.name}" for path in result.scene.parent.glob("meshes/*")}
                frames = {jelly["file"].replace("####", f"{time:04}") for time in times}
                self.assertEqual(files, {floor["file"], ball["file"], *frames})

    @unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
    def test_each_frame_is_that_of_its_own_export(self):
        for shutter in (None, 0.5):
            with self.subTest(shutter=shutter), tempfile.TemporaryDirectory() as folder:
                folder = pathlib.Path(folder)
                scene = self.moving_room(shutter)
                whole = compare.export_scene(folder / "all", all_frames=True).scene
                for frame in (1, 3, 4):
                    scene.frame_set(frame)
                    one = compare.export_scene(folder / f"{frame}").scene
                    pictures = []
                    for file, more in ((whole, ["-D", f"animation.frame={frame}"]), (one, [])):
                        output = folder / "a.exr"
                        line = [compare.program(), "render", file, "-o", output, "--passes", "8", "--quiet", *more]
                        subprocess.run(list(map(str, line)), check=True, capture_output=True)
                        pictures.append(compare.read(output))
                    # The same up to rounding, which makes a few rays hit something else.
                    difference = abs(pictures[0] - pictures[1]).mean() / pictures[1].mean()
                    self.assertLess(difference, 2e-3, frame)

    def test_what_comes_and_goes(self):
        scene = self.moving_room()
        ball = bpy.data.objects["Ball"]
        for frame, hidden in ((1, False), (3, True)):
            ball.hide_viewport = ball.hide_render = hidden
            ball.keyframe_insert("hide_viewport", frame=frame)
            ball.keyframe_insert("hide_render", frame=frame)
        scene.frame_set(1)
        table = tomllib.loads(compare.export_scene(all_frames=True).text)
        seen = table["shapes"][1]["visible"]
        self.assertEqual(seen["interpolation"], "step")
        self.assertEqual([(time, len(rays)) for time, rays in seen["keys"]], [(1.0, 5), (3.0, 0), (4.0, 0)])

    def test_cuts_between_cameras(self):
        scene = self.moving_room(0.5)
        first = scene.camera
        second = scenes.camera((3.0, -4.0, 3.0), (0.0, 0.0, 0.0))
        for frame, camera in ((1, first), (3, second)):
            scene.timeline_markers.new(camera.name, frame=frame).camera = camera
        scene.frame_set(4)
        table = tomllib.loads(compare.export_scene(all_frames=True).text)
        times, places = zip(*((time, place[0]) for time, place in table["camera"]["origin"]["keys"]))
        # Until then the first one stays where it was at frame 2.
        np.testing.assert_allclose(np.interp([2.25, 2.74], times, places), [0.1, 0.1], atol=1e-5)
        np.testing.assert_allclose(np.interp([2.75, 3.0, 3.25], times, places), [3.0, 3.0, 3.0], atol=1e-5)

    def test_other_polygons_have_files_of_their_own(self):
        scene = self.moving_room()
        modifier = bpy.data.objects["Ball"].modifiers.new("Build", "BUILD")
        modifier.frame_start, modifier.frame_duration = 0, 10
        scene.frame_set(1)
        with tempfile.TemporaryDirectory() as folder:
            result = compare.export_scene(folder, all_frames=True)
            of_ball = tomllib.loads(result.text)["shapes"][1]["file"]
            self.assertEqual(of_ball["interpolation"], "step")
            paths = [path for _, path in of_ball["keys"]]
            self.assertEqual(len(set(paths)), 4)
            self.assertTrue(all((result.scene.parent / path).is_file() for path in paths))


if __name__ == "__main__":
    unittest.main()
