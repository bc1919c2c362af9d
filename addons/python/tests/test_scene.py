"""Scenes from dictionaries, texts and files."""

from __future__ import annotations

import json
import tempfile
import unittest
import warnings
from base64 import b64encode
from pathlib import Path

import beamfarm
import numpy as np
from common import FOG, TOP, command


class Scenes(unittest.TestCase):
    def test_a_dictionary_is_a_scene_and_is_copied(self) -> None:
        scene = beamfarm.Scene(FOG)
        scene["lights"][0]["power"] = 7
        scene.set("camera.fov", np.float32(30)).set("shapes.0.center.1", 0.75)
        self.assertEqual(scene.get_path("shapes.0.center.1"), 0.75)
        self.assertEqual(FOG["lights"][0]["power"], 50.0)
        other = scene.copy()
        other.set("lights.0.power", 8)
        self.assertEqual(scene["lights"][0]["power"], 7)
        self.assertEqual(repr(scene), "<Scene 'scene': 48 x 32, 2 shapes, 1 light>")
        again = beamfarm.Scene(scene.to_toml())
        self.assertEqual(again["camera"]["fov"], 30)
        for path in ("camera.fov.x", "lights.3.power", "nothing.at", "lights.x.power"):
            with self.assertRaises(KeyError, msg=path):
                scene.set(path, 1)

    def test_all_errors_come_with_file_line_and_field(self) -> None:
        text = (TOP / "scenes" / "prism.toml").read_text()
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "wrong.toml"
            wrong = text.replace("fov =", "fovv =").replace("width =", "widht =", 1)
            path.write_text(wrong)
            with self.assertRaises(beamfarm.SceneError) as caught:
                beamfarm.load(path).check()
            faults = caught.exception.faults
            self.assertGreaterEqual(len(faults), 2, faults)
            lines = wrong.splitlines()
            for fault, word in zip(faults, ("widht", "fovv")):
                self.assertEqual(fault.file, path)
                assert fault.line is not None
                self.assertIn(word, lines[fault.line - 1])
            self.assertIn(f"{path}:{faults[0].line}: ", str(caught.exception))
            self.assertIsInstance(caught.exception, ValueError)
            with self.assertRaises(beamfarm.SceneError) as caught:
                beamfarm.load(Path(folder) / "none.toml")
            self.assertIn("none.toml", str(caught.exception))
            path.write_text("[image\n")
            with self.assertRaises(beamfarm.SceneError):
                beamfarm.load(path)

    def test_errors_of_a_scene_that_was_changed_name_lines_of_its_text(self) -> None:
        scene = beamfarm.Scene(FOG)
        scene.set("camera.fov", "wide").set("materials.glass.ior", -1)
        for use in (scene.check, lambda: beamfarm.render(scene, progress=False), lambda: beamfarm.explain(scene)):
            with self.assertRaises(beamfarm.SceneError) as caught:
                use()
            faults = caught.exception.faults
            self.assertEqual({fault.field for fault in faults}, {"camera.fov", "materials.glass.ior"})
            self.assertTrue(all(fault.file == Path("<scene>") for fault in faults))
            lines = scene.to_toml().splitlines()
            for fault in faults:
                assert fault.line is not None and fault.field is not None
                self.assertIn(fault.field.rsplit(".", 1)[1], lines[fault.line - 1])

    def test_a_scene_of_a_file_is_the_command_s(self) -> None:
        path = TOP / "scenes" / "prism.toml"
        told = command("explain", path, "--paths", "1000")
        plan = beamfarm.explain(path, paths=1000)
        self.assertEqual(str(plan), told.rstrip("\n"))
        self.assertEqual(plan["paths"], 1000)
        self.assertTrue(told.startswith(f"scene {plan['scene']}\n"))
        scene = beamfarm.load(path)
        self.assertEqual(scene.explain(paths=1000), plan)
        # White space and comments do not matter.
        self.assertEqual(beamfarm.explain(beamfarm.Scene(scene.data, folder=path.parent))["scene"], plan["scene"])

    def test_a_scene_that_is_saved_elsewhere_names_the_same_files(self) -> None:
        path = TOP / "scenes" / "ocean.toml"
        scene = beamfarm.load(path)
        with tempfile.TemporaryDirectory() as folder:
            saved = scene.save(Path(folder) / "other.toml")
            beamfarm.load(saved).check()
            scene["shapes"][1]["file"] = beamfarm.Mesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]])
            saved = scene.save(Path(folder) / "changed.toml")
            beamfarm.load(saved).check()
            made = [file for file in Path(folder).rglob("*") if file.is_file()]
            self.assertEqual(len(made), 3, made)
            with self.assertRaises(beamfarm.ArgumentError):
                scene.save(Path(folder) / "scene.json")
            with self.assertRaises(beamfarm.ImageError):
                scene.save(Path(folder) / "changed.toml" / "below.toml")

    def test_files_that_files_name_are_read_where_the_command_reads_them(self) -> None:
        """A glTF file, and an .obj file with its .mtl, whose images lie outside their folder."""
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "a").mkdir()
            (folder / "images").mkdir()
            image = beamfarm.render(FOG, passes=1, progress=False)
            image.save(folder / "images" / "own.png")
            points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32).tobytes() + bytes(24)
            places = {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}
            gltf = {
                "asset": {"version": "2.0"},
                "scene": 0,
                "scenes": [{"nodes": [0]}],
                "nodes": [{"mesh": 0}],
                "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "material": 0}]}],
                "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
                "textures": [{"source": 0}],
                "images": [{"uri": "../images/own.png"}],
                "buffers": [{"byteLength": 60, "uri": f"data:application/octet-stream;base64,{b64encode(points).decode()}"}],
                "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 24}],
                "accessors": [places, {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"}],
            }
            (folder / "a" / "model.gltf").write_text(json.dumps(gltf))
            told = command("explain", folder / "a" / "model.gltf", "--paths", 1)
            scene = beamfarm.load(folder / "a" / "model.gltf")
            self.assertEqual(scene.explain(paths=1)["scene"], told.split()[1])
            scene.copy().set("image.width", 8).check()

            (folder / "a" / "mesh.obj").write_text("mtllib mesh.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")
            (folder / "a" / "mesh.mtl").write_text("newmtl m\nmap_Kd ../images/own.png\n")
            data = dict(FOG, shapes=[{"type": "mesh", "file": "mesh.obj", "mtl": True}])
            with self.assertRaisesRegex(beamfarm.SceneError, "lies outside"):
                beamfarm.Scene(data, folder=folder / "a").check()
            allowed = beamfarm.Scene(data, folder=folder / "a", allow_outside=[folder / "images"])
            allowed.check()
            path = folder / "a" / "scene.toml"
            path.write_text(allowed.to_toml())
            beamfarm.load(path, allow_outside=[folder / "images"]).check()

    def test_what_no_scene_can_hold_is_told_by_its_path(self) -> None:
        for value, word in ((None, "NoneType"), (object(), "object"), (np.zeros((100, 100)), "shape (100, 100)")):
            scene = beamfarm.Scene(FOG).set("materials.glass.ior", value)
            with self.assertRaises(beamfarm.ArgumentError) as caught:
                scene.to_toml()
            self.assertTrue(str(caught.exception).startswith("materials.glass.ior: "), caught.exception)
            self.assertIn(word, str(caught.exception))
        with self.assertRaises(beamfarm.ArgumentError):
            beamfarm.Scene("scene.toml")
        with self.assertRaises(beamfarm.ArgumentError):
            beamfarm.Scene(3)  # type: ignore[arg-type]

    def test_mitsuba_s_scenes_have_parameters_and_say_what_is_left_out(self) -> None:
        xml = """<scene version="3.0.0"><default name="w" value="8"/>
            <sensor type="perspective"><float name="fov" value="40"/>
            <film type="hdrfilm"><integer name="width" value="$w"/><integer name="height" value="6"/></film></sensor>
            <emitter type="point"><point name="position" x="0" y="1" z="2"/></emitter>
            <emitter type="unheard"/></scene>"""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "scene.xml"
            path.write_text(xml)
            with self.assertRaises(beamfarm.SceneError):
                beamfarm.load(path)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                scene = beamfarm.load(path, parameters={"w": 12}, skip_unsupported=True)
            self.assertEqual(scene["image"]["width"], 12)
            self.assertEqual(len(scene.left_out), 1)
            self.assertTrue(any("unheard" in str(warning.message) for warning in caught))
            self.assertTrue(all(issubclass(warning.category, beamfarm.SceneNote) for warning in caught))


if __name__ == "__main__":
    unittest.main()
