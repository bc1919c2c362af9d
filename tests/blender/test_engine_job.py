"""Failures of the command, cancelling, intermediate pictures, and other machines."""

from __future__ import annotations

import os
import socket
import subprocess
import time
import unittest
from pathlib import Path
from unittest import mock

import harness
import bpy
import numpy as np


def render_error() -> str:
    """The message of a render that fails."""
    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        return str(error)
    raise AssertionError("the render did not fail")


def result_of(scene: bpy.types.Scene) -> np.ndarray:
    """R, G, B, A of the render result, as saved."""
    image = bpy.data.images["Render Result"]
    path = harness.folder() / "result.exr"
    image.save_render(str(path), scene=scene)
    channels = harness.module("exr").read(path.read_bytes())
    return np.stack([channels[f"ViewLayer.Combined.{name}"] for name in "RGBA"], axis=-1)


def script(text: str) -> Path:
    """A short program."""
    path = harness.folder() / "beamfarm"
    path.write_text(f"#!/bin/sh\n{text}\n", encoding="utf-8")
    path.chmod(0o755)
    return path


def is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    return True


class Program(unittest.TestCase):
    def setUp(self) -> None:
        self.scene = harness.lit_floor((16, 12))
        self.addCleanup(harness.install)

    def test_a_path_that_leads_nowhere_is_named(self) -> None:
        harness.preferences().program = "/nowhere/beamfarm"
        said = render_error()
        self.assertIn("There is no program at /nowhere/beamfarm", said)
        self.assertIn("Preferences", said)

    def test_without_a_path_it_is_that_of_the_environment(self) -> None:
        harness.preferences().program = ""
        with mock.patch.dict(os.environ, {"PATH": "/nowhere"}):
            self.assertIn("was not found in PATH", render_error())
        with mock.patch.dict(os.environ, {"PATH": str(harness.PROGRAM.parent)}):
            bpy.ops.render.render()

    def test_another_version_is_refused(self) -> None:
        harness.preferences().program = str(script("echo beamfarm 9.2.0"))
        said = render_error()
        self.assertIn("is beamfarm 9.2.0", said)
        self.assertIn("for 0.2", said)

    def test_another_program_is_refused(self) -> None:
        harness.preferences().program = str(script("echo hello"))
        self.assertIn("is not beamfarm", render_error())

    def test_what_the_command_says_is_told(self) -> None:
        harness.preferences().program = str(
            script('[ "$1" = --version ] && echo beamfarm 0.2.0 && exit\necho "error: no luck" >&2\nexit 5')
        )
        self.assertIn("no luck", render_error())


class Engine(unittest.TestCase):
    """What renders: processors, a GPU, or whichever is better."""

    def setUp(self) -> None:
        self.scene = harness.lit_floor((16, 12))
        self.engines = harness.module("engines")
        self.asked = harness.folder() / "asked"
        self.addCleanup(harness.install)
        self.addCleanup(setattr, harness.preferences(), "engine", self.engines.CPU)

    def refusing(self, code: int) -> Path:
        """A stand-in for the command that has no GPU and records its arguments."""
        return script(
            f'echo "$*" >>"{self.asked}"\n'
            f'case "$*" in *"--engine gpu"*) echo "error: there is no device" >&2; exit {code};; esac\n'
            f'exec "{harness.PROGRAM}" "$@"'
        )

    def renders(self) -> list[str]:
        """Its calls that were renders."""
        lines = self.asked.read_text(encoding="utf-8").splitlines()
        return [line for line in lines if line.startswith("render ")]

    def test_what_is_tried(self) -> None:
        tries, gpu = self.engines.tries, ["--engine", "gpu"]
        for verb in ("render", "serve", "live"):
            self.assertEqual(tries("CPU", verb), [[]])
            self.assertEqual(tries("GPU", verb), [gpu, []])
        self.assertEqual(tries("AUTO", "render"), [["--engine", "auto"]])
        self.assertEqual(tries("AUTO", "live"), [gpu, []])
        self.assertEqual(tries("AUTO", "serve"), [[]])
        self.assertEqual(self.engines.chosen("PREFERENCES", "GPU"), "GPU")
        self.assertEqual(self.engines.chosen("CPU", "GPU"), "CPU")

    def test_processors_are_asked_for_nothing(self) -> None:
        harness.preferences().program = str(self.refusing(2))
        bpy.ops.render.render()
        self.assertNotIn("--engine", self.renders()[0])

    def test_where_there_is_no_gpu_processors_render(self) -> None:
        harness.preferences().program = str(self.refusing(1))
        harness.preferences().engine = "GPU"
        with mock.patch.object(self.engines, "instead", wraps=self.engines.instead) as instead:
            bpy.ops.render.render()
        self.assertGreater(result_of(self.scene)[..., :3].max(), 0.0)
        first, second = self.renders()
        self.assertIn("--engine gpu", first)
        self.assertNotIn("--engine", second)
        self.assertEqual(instead.call_count, 1)
        self.assertEqual(self.engines.instead(*instead.call_args.args), "On processors: there is no device")

    def test_what_breaks_is_not_tried_again(self) -> None:
        harness.preferences().program = str(self.refusing(5))
        harness.preferences().engine = "GPU"
        self.assertIn("there is no device", render_error())
        self.assertEqual(len(self.renders()), 1)

    def test_a_scene_has_the_last_word(self) -> None:
        harness.preferences().program = str(self.refusing(2))
        harness.preferences().engine = "GPU"
        self.scene.beamfarm.engine = "CPU"
        bpy.ops.render.render()
        self.assertNotIn("--engine", self.renders()[0])


class Render(unittest.TestCase):
    def setUp(self) -> None:
        self.scene = harness.lit_floor()
        self.engine = harness.module("engine")

    def test_a_render_without_an_end_is_refused(self) -> None:
        self.scene.beamfarm.passes = 0
        self.assertIn("never end", render_error())
        self.scene.beamfarm.time_limit = 0.5
        bpy.ops.render.render()
        self.assertGreater(result_of(self.scene)[..., :3].max(), 0.0)

    def test_an_error_ends_a_render(self) -> None:
        self.scene.beamfarm.passes = 0
        self.scene.beamfarm.target_error = 20.0
        bpy.ops.render.render()
        self.assertGreater(result_of(self.scene)[..., :3].max(), 0.0)

    def test_a_coarse_picture_stays_where_no_pass_is_complete(self) -> None:
        self.scene.beamfarm.passes, self.scene.beamfarm.time_limit = 0, 0.001
        passes = []
        show = self.engine.Picture.show

        def shown(picture, data: bytes) -> None:
            show(picture, data)
            passes.append(picture.passes)

        with mock.patch.object(self.engine.Picture, "show", shown):
            bpy.ops.render.render()
        self.assertEqual(set(passes), {0})
        self.assertGreater(result_of(self.scene)[..., :3].max(), 0.0)

    def test_the_first_picture_does_not_wait_for_a_pass(self) -> None:
        # A pass of this many pixels takes seconds, and may still be complete when the job is told to end.
        self.scene.render.resolution_x, self.scene.render.resolution_y = 1600, 1200
        self.scene.beamfarm.passes = 1
        passes = []
        show = self.engine.Picture.show

        def shown(picture, data: bytes) -> None:
            show(picture, data)
            passes.append(picture.passes)

        with (
            mock.patch.object(self.engine.Picture, "show", shown),
            mock.patch.object(self.engine.BeamfarmRenderEngine, "is_stopped", lambda _engine: bool(passes)),
        ):
            bpy.ops.render.render()
        self.assertEqual(passes[0], 0)
        self.assertGreater(result_of(self.scene)[..., :3].max(), 0.0)

    def test_a_scene_without_a_camera_is_refused(self) -> None:
        bpy.data.objects.remove(self.scene.camera)
        self.assertIn("camera", render_error().lower())

    def test_pictures_come_while_it_renders_and_a_cancel_keeps_the_last(self) -> None:
        self.scene.beamfarm.passes = 1_000_000
        jobs, passes, lines = [], [], []
        show, words = self.engine.Picture.show, self.engine.job.words

        def shown(picture, data: bytes) -> None:
            show(picture, data)
            passes.append(picture.passes)

        def said(progress) -> str:
            lines.append(words(progress))
            return lines[-1]

        class Watched(harness.module("job").Job):
            def __init__(self, *arguments) -> None:
                super().__init__(*arguments)
                jobs.append(self)

        cls = self.engine.BeamfarmRenderEngine
        with (
            mock.patch.object(self.engine.Picture, "show", shown),
            mock.patch.object(self.engine.job, "Job", Watched),
            mock.patch.object(cls, "is_stopped", lambda _engine: len(passes) >= 3),
            mock.patch.object(self.engine.job, "words", said),
        ):
            bpy.ops.render.render()
        # A coarse one, the intermediate ones, and that of the passes that were complete at the end.
        self.assertEqual(len(passes), 4)
        self.assertEqual((passes[0], passes), (0, sorted(passes)))
        self.assertGreater(result_of(self.scene)[..., :3].max(), 0.0)
        self.assertFalse(is_alive(jobs[0].process.pid))
        self.assertTrue(any("Pass " in line and "/1000000" in line and "left" in line for line in lines), lines)
        self.assertTrue(any("error" in line for line in lines), lines)

    def test_what_is_left_out_is_told(self) -> None:
        told = harness.module("told")
        write_scene = self.engine.write_scene

        def lacking(*arguments):
            result = write_scene(*arguments)
            result.left_out.append("left out: node Toon BSDF of material paint")
            return result

        with mock.patch.object(self.engine, "write_scene", lacking):
            bpy.ops.render.render()
        self.assertIn("left out: node Toon BSDF of material paint", told.of("Scene").left_out)
        bpy.ops.beamfarm.show_left_out()
        self.assertIn("node Toon BSDF of material paint", bpy.data.texts["beamfarm: Scene"].as_string())
        bpy.ops.wm.read_homefile(use_empty=True)
        self.assertIsNone(told.of("Scene"))

    def test_nothing_stays_on_the_disk(self) -> None:
        before = set(Path(bpy.app.tempdir).iterdir())
        bpy.ops.render.render()
        self.assertEqual(set(Path(bpy.app.tempdir).iterdir()), before)


class Farm(unittest.TestCase):
    def setUp(self) -> None:
        self.scene = harness.lit_floor()
        self.addCleanup(setattr, harness.preferences(), "use_farm", False)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        preferences = harness.preferences()
        preferences.use_farm, preferences.listen = True, f"127.0.0.1:{self.port}"

    def test_a_farm_needs_a_token(self) -> None:
        harness.preferences().token = ""
        self.assertIn("token", render_error())

    def test_others_take_part_and_the_picture_is_the_same(self) -> None:
        token = "a-token-of-a-test-and-long-enough"
        preferences = harness.preferences()
        preferences.token = token
        self.scene.beamfarm.passes = 64
        preferences.workers = preferences.threads = 1
        self.addCleanup(setattr, preferences, "workers", 0)
        self.addCleanup(setattr, preferences, "threads", 0)
        line = [str(harness.PROGRAM), "worker", "--connect", f"http://127.0.0.1:{self.port}", "--name", "guest"]
        worker = subprocess.Popen(line, env={**os.environ, "BEAMFARM_TOKEN": token}, stderr=subprocess.PIPE)
        bpy.ops.render.render()
        _, said = worker.communicate(timeout=60)
        self.assertEqual(worker.returncode, 0, said)
        together = result_of(self.scene)
        preferences.use_farm = False
        bpy.ops.render.render()
        np.testing.assert_array_equal(result_of(self.scene), together)


class Life(unittest.TestCase):
    def test_a_render_ends_with_blender(self) -> None:
        harness.lit_floor()
        folder = harness.folder()
        bpy.ops.export_scene.beamfarm(directory=str(folder))
        line = [str(harness.PROGRAM), "render", str(folder / "scene.toml")]
        running = harness.module("job").Job([*line, "-o", str(folder / "a.exr"), "--passes", "1000000"])
        while running.url is None:
            self.assertTrue(running.is_running, running.words())
            time.sleep(0.01)
        # As when the process that holds the other end dies.
        running.process.stdin.close()
        running.process.wait(20.0)
        running.close()


class Words(unittest.TestCase):
    def test_numbers_of_a_job(self) -> None:
        job = harness.module("job")
        text = "# HELP x y\nbeamfarm_passes_prefix 7.0\nbeamfarm_passes_limit 9007199254740992.0\n"
        text += 'beamfarm_workers{state="idle"} 3\nbeamfarm_workers_connected 2.0\n'
        progress = job.parse_metrics(text + "beamfarm_job_remaining_seconds 3725.2\n")
        self.assertEqual((progress.passes, progress.limit, progress.workers), (7, None, 2))
        self.assertEqual(job.words(progress), "Pass 7 | 1:02:05 left | 2 workers")

    def test_a_cancel_before_there_is_a_page(self) -> None:
        job = harness.module("job")
        running = job.Job([str(script("exec cat"))])
        begin = time.monotonic()
        running.cancel()
        running.wait()
        self.assertLess(time.monotonic() - begin, 10.0)
        self.assertFalse(running.is_running)
        running.close()


harness.install()

if __name__ == "__main__":
    unittest.main()
