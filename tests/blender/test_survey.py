"""The survey of a folder of .blend files."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

import bpy
import scenes
import survey


class Kinds(unittest.TestCase):
    def test_names_and_numbers_do_not_count(self):
        for line, kind in {
            "left out: node 'Noise Texture' of material 'Rock.001'": "node 'Noise Texture' of material '…'",
            "left out: node 'My node' (Toon BSDF) of material 'Bob's'": "node 'Toon BSDF' of material '…'",
            "left out: the hair 'Fur' of 'Cat': why": "the hair '…' of '…': why",
            "left out: the exposure of Cycles' film, 1.25: set it": "the exposure of Cycles' film, N: set it",
        }.items():
            self.assertEqual(survey.kind_of(line), kind)

    def test_objects_of_which_nothing_is_seen(self):
        self.assertEqual(survey.nothing_of("left out: object 'A': no faces"), "no faces")
        self.assertEqual(survey.nothing_of("left out: object 'Bob's hat': no faces: why"), "no faces: why")
        self.assertEqual(survey.nothing_of("left out: object 'A' of the kind curves"), "curves")
        self.assertIsNone(survey.nothing_of("left out: displacement of material 'A'"))

    def test_what_nobody_can_show(self):
        for line in ("object 'A': no faces: a curve without bevel or extrusion",
                     "node 'Image Texture' of material 'A': image 'a.png' cannot be read",
                     "node 'Environment Texture' of world 'A': no image",
                     "volume 'A': there is no file 'a.vdb'"):
            self.assertFalse(survey.can_be_shown(f"left out: {line}"), line)
        for line in ("object 'A' of the kind greasepencil", "node 'Toon BSDF' of material 'no image'"):
            self.assertTrue(survey.can_be_shown(f"left out: {line}"), line)


class Survey(unittest.TestCase):
    def setUp(self):
        kept = tempfile.TemporaryDirectory()
        self.addCleanup(kept.cleanup)
        self.folder = pathlib.Path(kept.name)

    def save(self, name, *lines):
        """A file with a cube that has a Toon BSDF, and edges with these names."""
        scenes.empty()
        scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
        scenes.cube("Cube", material=scenes.material(f"of {name}", "ShaderNodeBsdfToon"))
        for line in lines:
            scenes.mesh(line, [(0, 0, 0), (1, 0, 0)], [])
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        bpy.ops.wm.save_as_mainfile(filepath=str(path))

    def survey(self, *arguments):
        line = [sys.executable, survey.__file__, str(self.folder), *arguments]
        return subprocess.run(line, capture_output=True, text=True, timeout=120)

    def test_tables_of_a_folder(self):
        self.save("a.blend")
        self.save("inner/b.blend", "one", "two")
        (self.folder / "c.blend").write_bytes(b"no blend")
        before = sorted(self.folder.rglob("*"))
        done = self.survey()
        self.assertEqual(done.returncode, 0, done.stderr)
        lines = done.stdout.splitlines()
        self.assertEqual(
            lines[0], "3 files, 1 of them failed, 0 without any shape, "
            "0 with nothing left out, 0 with nothing but what nobody can show")
        self.assertIn("      2       2  node 'Toon BSDF' of material '…'  [a.blend]", lines)
        self.assertIn("      1       2  no faces  [inner/b.blend]", lines)
        (failed,) = [line for line in lines if line.startswith("    c.blend: ")]
        self.assertIn("c.blend", failed)
        self.assertEqual(sorted(self.folder.rglob("*")), before)

    def test_a_limit_of_files(self):
        for name in ("a.blend", "b.blend"):
            self.save(name)
        done = self.survey("--limit", "1")
        self.assertTrue(done.stdout.startswith("1 files, 0 of them failed"), done.stdout)

    def test_a_limit_of_time(self):
        self.save("a.blend")
        done = self.survey("--patience", "0.01")
        self.assertIn("    a.blend: not done after 0.01 s", done.stdout.splitlines())

    def test_files_of_which_nothing_is_seen(self):
        # It has no camera either.
        scenes.empty()
        bpy.ops.wm.save_as_mainfile(filepath=str(self.folder / "bare.blend"))
        lines = self.survey().stdout.splitlines()
        self.assertEqual(
            lines[0], "1 files, 0 of them failed, 1 without any shape, "
            "1 with nothing left out, 0 with nothing but what nobody can show")
        self.assertIn("    bare.blend", lines)

    def test_an_empty_folder_is_refused(self):
        done = self.survey()
        self.assertEqual(done.returncode, 1)
        self.assertIn("there is no .blend in", done.stderr)


if __name__ == "__main__":
    unittest.main()
