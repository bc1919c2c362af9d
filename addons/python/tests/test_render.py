"""Renders, single passes and references, against those of the command."""

from __future__ import annotations

import multiprocessing
import os
import signal
import subprocess
import sys
import tempfile
import textwrap
import threading
import unittest
import warnings
from pathlib import Path
from typing import Any

import beamfarm
import numpy as np
from common import FOG, TOP, command


def in_child(queue: Any) -> None:
    """Renders in a forked process."""
    queue.put((beamfarm.pass_image(FOG, 1).hash, beamfarm.render(FOG, passes=2, progress=False).hash))


def on_device(queue: Any) -> None:
    """Asks for devices in a forked process."""
    try:
        beamfarm.pass_image(FOG, 0, engine="gpu")
        queue.put("rendered")
    except beamfarm.DeviceError as error:
        queue.put(str(error))


class Renders(unittest.TestCase):
    def test_bits_are_those_of_the_command(self) -> None:
        layers = ["depth", "normal", "volume", "beam_density", "alpha", "motion", "lights", "stderr"]
        with tempfile.TemporaryDirectory() as folder:
            path = beamfarm.Scene(FOG).save(Path(folder) / "fog.toml")
            told = command(
                "render", path, "--passes", 5, "--seed", 3, "--aov", ",".join(layers), "-o", Path(folder) / "a.exr"
            )
            image = beamfarm.render(path, passes=5, seed=3, layers=layers, progress=False)
            self.assertIn(f"pixels {image.hash}", told)
            own = image.save(Path(folder) / "b.exr")
            image.save(Path(folder) / "b.png")
            self.assertEqual((Path(folder) / "b.png").read_bytes(), (Path(folder) / "a.png").read_bytes())
            self.assertEqual(image.to_png(), (Path(folder) / "a.png").read_bytes())
            # Equal except for the render time and the scene's file, which does not exist here.
            self.assertEqual(abs(len(own.read_bytes()) - (Path(folder) / "a.exr").stat().st_size) < 100, True)
            compared = beamfarm.compare(image, Path(folder) / "a.exr")
            self.assertTrue(compared.identical)
            self.assertEqual(compared.rmse, 0.0)
            np.testing.assert_array_equal(beamfarm.read(own), image.beauty)
            replayed = command("replay", path, "--pass", 3, "--seed", 3)
            self.assertIn(f"pass 3 pixels {beamfarm.pass_image(path, 3, seed=3).hash}", replayed)

    def test_what_an_image_holds(self) -> None:
        image = beamfarm.render(FOG, passes=16, layers=["depth", "direct", "surface", "volume"], progress=False)
        self.assertEqual((image.passes, image.width, image.height), (16, 48, 32))
        self.assertEqual(image.beauty.shape, (32, 48, 3))
        self.assertEqual(image.beauty.dtype, np.float32)
        self.assertEqual(image.layers["depth"].shape, (32, 48))
        self.assertEqual(sorted(image.layers), ["depth", "direct", "surface", "volume"])
        parts = sum(image.layers[name] for name in ("direct", "surface", "volume"))
        np.testing.assert_allclose(parts, image.beauty, rtol=1e-4, atol=1e-6)
        # The memory belongs to the image, which lives as long as its arrays.
        self.assertFalse(image.beauty.flags.owndata or image.beauty.flags.writeable)
        self.assertTrue(np.shares_memory(image.beauty, image.beauty))
        beauty, mean = image.beauty, float(image.beauty.mean())
        self.assertTrue(np.isfinite(image.stderr).all())
        # Its error follows from its arrays by the same rule, except for blocks.
        self.assertTrue(0.0 < image.error < 1.0)
        assert image.bias is None or abs(image.bias.relative) < 1.0
        self.assertEqual(np.asarray(image, dtype=np.float64).dtype, np.float64)
        del image
        self.assertEqual(float(beauty.mean()), mean)

    def test_passes_add_up_to_the_image_in_any_order(self) -> None:
        passes = beamfarm.Passes(FOG, layers=["depth"])
        made = [passes[index] for index in (4, 1, 0, 3, 2)]
        image = beamfarm.render(FOG, passes=5, layers=["depth"], progress=False)
        average = beamfarm.average(made)
        self.assertEqual(average.hash, image.hash)
        np.testing.assert_array_equal(average.stderr, image.stderr)
        np.testing.assert_array_equal(average.layers["depth"], image.layers["depth"])
        self.assertEqual([one.index for one, _ in zip(passes(2), range(3))], [2, 3, 4])
        self.assertEqual(made[0].radius_scale, passes.radius_scale(4))
        self.assertAlmostEqual(passes.radius_scale(7), beamfarm.radius_scale(7, 2 / 3), places=12)
        self.assertEqual(beamfarm.radius_scale(0), 1.0)
        # F(n + 1) / F(n) = (n + alpha) / (n + 1)
        self.assertAlmostEqual(beamfarm.radius_scale(3, 0.5) / beamfarm.radius_scale(2, 0.5), 3.5 / 4, places=12)
        other = beamfarm.pass_image(FOG, 1, seed=9)
        for wrong in ([], [made[0]], [made[1], made[1]], [made[2], other], [made[2].beauty]):
            with self.assertRaises(beamfarm.ArgumentError):
                beamfarm.average(wrong)

    def test_the_reference_is_the_command_s_and_the_truth(self) -> None:
        plain = dict(FOG, world={}, lights=[{"type": "environment", "radiance": 1.0}])
        with tempfile.TemporaryDirectory() as folder:
            path = beamfarm.Scene(plain).save(Path(folder) / "plain.toml")
            told = command("reference", path, "--samples", 3, "-o", Path(folder) / "a.exr")
        truth = beamfarm.reference(plain, samples=3, progress=False)
        self.assertIn(f"pixels {truth.hash}", told)
        self.assertEqual(truth.passes, 3)
        truth = beamfarm.reference(plain, samples=400, progress=False)
        image = beamfarm.render(plain, passes=64, progress=False)
        # The means of both: five standard errors, and a bias of a thousandth.
        mean, other = float(image.beauty.mean()), float(truth.beauty.mean())
        error = np.hypot(*(np.sqrt((one.stderr.astype(np.float64) ** 2).sum()) / one.stderr.size for one in (image, truth)))
        self.assertLess(abs(mean - other), 5 * error + 1e-3 * other)

    def test_time_and_error_end_a_render(self) -> None:
        image = beamfarm.render(FOG, error=0.2, progress=False)
        self.assertLessEqual(image.error, 0.2)
        image = beamfarm.render(FOG, time=1.0, progress=False)
        self.assertGreaterEqual(image.passes, 1)
        self.assertLess(image.seconds, 20.0)

    def test_progress_is_told_and_may_end_it(self) -> None:
        states: list[beamfarm.Progress] = []
        beamfarm.render(FOG, passes=30, progress=states.append)
        self.assertTrue(all(isinstance(state, beamfarm.Progress) for state in states))
        self.assertEqual(sorted(state.fraction for state in states), [state.fraction for state in states])

        def enough(state: beamfarm.Progress) -> None:
            raise LookupError("enough")

        with self.assertRaisesRegex(LookupError, "enough"):
            beamfarm.render(FOG, passes=10**9, progress=enough)

    def test_wrong_arguments_are_named(self) -> None:
        cases: list[tuple[dict[str, Any], str]] = [
            ({"passes": 0}, "passes"),
            ({"passes": 1.5}, "passes"),
            ({"time": -1}, "time"),
            ({"error": 2}, "error"),
            ({"percentile": 101}, "percentile"),
            ({"layers": ["dept"]}, "dept"),
            ({"engine": "abacus"}, "cpu, gpu or auto"),
            ({"threads": 0}, "threads"),
            ({"alpha": float("nan")}, "alpha"),
            ({"alpha": 1.5}, "alpha"),
            ({"seed": -1}, "seed"),
        ]
        for options, word in cases:
            with self.assertRaises(beamfarm.ArgumentError, msg=str(options)) as caught:
                beamfarm.render(FOG, progress=False, **options)
            self.assertIn(word, str(caught.exception))
        with self.assertRaises(beamfarm.ArgumentError):
            beamfarm.render(3)  # type: ignore[arg-type]
        # Layers of a scene with vertex colours and too many pixels: it is refused beforehand if the machine cannot hold
        # it.
        huge = dict(FOG, image={"width": 32768, "height": 32768})
        with self.assertRaises(MemoryError) as memory:
            beamfarm.render(huge, layers=["all"], progress=False)
        self.assertIn("32768 x 32768", str(memory.exception))

    def test_a_worker_that_dies_takes_nobody_along(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            dying = Path(folder) / "beamfarm"
            dying.write_text("#!/bin/sh\nkill -9 $$\n")
            dying.chmod(0o755)
            before = os.environ.get("BEAMFARM_PROGRAM")
            os.environ["BEAMFARM_PROGRAM"] = str(dying)
            try:
                with self.assertRaises(beamfarm.OutOfMemoryError) as caught:
                    beamfarm.render(FOG, progress=False)
            finally:
                os.environ.pop("BEAMFARM_PROGRAM")
                if before is not None:
                    os.environ["BEAMFARM_PROGRAM"] = before
        self.assertIn("signal 9", str(caught.exception))
        self.assertIsNone(caught.exception.image)

    def test_several_threads_render_at_once_and_the_interpreter_goes_on(self) -> None:
        expected = [beamfarm.render(FOG, passes=3, seed=seed, progress=False).hash for seed in range(3)]
        found: dict[int, str] = {}
        turns = 0

        def work(seed: int) -> None:
            found[seed] = beamfarm.average(beamfarm.Passes(FOG, seed=seed, threads=1)[i] for i in range(3)).hash

        threads = [threading.Thread(target=work, args=(seed,)) for seed in range(3)]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            turns += 1
            threading.Event().wait(0.001)
        self.assertEqual([found[seed] for seed in range(3)], expected)
        self.assertGreater(turns, 5)

    @unittest.skipUnless(hasattr(os, "fork"), "there is no fork")
    def test_a_process_that_was_forked_renders_as_well(self) -> None:
        expected = beamfarm.pass_image(FOG, 1).hash, beamfarm.render(FOG, passes=2, progress=False).hash
        context = multiprocessing.get_context("fork")
        queue = context.Queue()
        with warnings.catch_warnings():
            # Python warns of threads, but these are idle.
            warnings.simplefilter("ignore", DeprecationWarning)
            child = context.Process(target=in_child, args=(queue,))
            child.start()
        self.assertEqual(queue.get(timeout=120), expected)
        child.join()

    @unittest.skipIf(os.name == "nt", "signals are sent in another way")
    def test_ctrl_c_keeps_what_is_done(self) -> None:
        program = textwrap.dedent(
            """
            import sys, warnings
            sys.path.insert(0, sys.argv[1])
            import beamfarm
            from common import FOG
            warnings.simplefilter("ignore")
            def tell(state):
                if state.passes > 3:
                    print("begun", flush=True)
            for render in (
                lambda: beamfarm.render(FOG, passes=10**9, progress=tell),
                lambda: beamfarm.reference(FOG, samples=10**9, progress=tell),
            ):
                image = render()
                print("kept", image.passes > 3, image.interrupted, image.beauty.mean() > 0, flush=True)
            """
        )
        with subprocess.Popen(
            [sys.executable, "-c", program, Path(__file__).parent], stdout=subprocess.PIPE, text=True
        ) as child:
            assert child.stdout is not None
            for _ in range(2):
                while child.stdout.readline() != "begun\n":
                    pass
                child.send_signal(signal.SIGINT)
                said = ""
                while not said.startswith("kept"):
                    said = child.stdout.readline()
                self.assertEqual(said, "kept True True True\n")
            self.assertEqual(child.wait(), 0)

    def test_nothing_is_printed(self) -> None:
        program = (
            "import sys; sys.path.insert(0, sys.argv[1])\nimport beamfarm\nfrom common import FOG\n"
            "beamfarm.render(FOG, passes=2)\nbeamfarm.reference(FOG, samples=1)\nbeamfarm.explain(FOG)\n"
            "beamfarm.average([beamfarm.pass_image(FOG, 0)])\n"
        )
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", program, Path(__file__).parent], capture_output=True, check=True
        )
        self.assertEqual((done.stdout, done.stderr), (b"", b""))

    def test_notes_on_a_scene_are_warnings(self) -> None:
        scene = beamfarm.Scene(dict(FOG, world={}))
        # Glass of a single sheet.
        scene["shapes"].append({"name": "sheet", "type": "rectangle", "material": "glass"})
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            image = beamfarm.render(scene, passes=1, progress=False)
        notes = [str(one.message) for one in caught if issubclass(one.category, beamfarm.SceneNote)]
        self.assertTrue(any("sheet" in note for note in notes), notes)
        self.assertTrue(set(notes) <= set(image.notes))

    @unittest.skipUnless(beamfarm._native.has_gpu, "this build has no engine gpu")
    def test_devices_that_are_not_there(self) -> None:
        with self.assertRaises(beamfarm.DeviceError):
            beamfarm.render(FOG, engine="gpu", device="no such device", progress=False)

    @unittest.skipUnless(os.environ.get("BEAMFARM_LONG"), "on a device that is a program it takes a minute: BEAMFARM_LONG")
    def test_passes_on_devices_have_the_command_s_bits(self) -> None:
        try:
            one = beamfarm.pass_image(FOG, 1, engine="gpu")
        except beamfarm.DeviceError as error:
            self.skipTest(str(error))
        passes = beamfarm.Passes(FOG, engine="gpu")
        image = beamfarm.render(FOG, passes=2, engine="gpu", progress=False)
        self.assertEqual(beamfarm.average([passes[0], one]).hash, image.hash)
        with tempfile.TemporaryDirectory() as folder:
            path = beamfarm.Scene(FOG).save(Path(folder) / "fog.toml")
            self.assertIn(f"pass 1 pixels {one.hash}", command("replay", path, "--pass", 1, "--engine", "gpu"))

    @unittest.skipUnless(beamfarm._native.has_gpu and hasattr(os, "fork"), "there is no engine gpu, or no fork")
    def test_a_process_that_was_forked_is_told_that_devices_want_another_way(self) -> None:
        with self.assertRaises(beamfarm.DeviceError):
            beamfarm.pass_image(FOG, 0, engine="gpu", device="no such device")
        context = multiprocessing.get_context("fork")
        queue = context.Queue()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            child = context.Process(target=on_device, args=(queue,))
            child.start()
        self.assertIn("forked", queue.get(timeout=120))
        child.join()

    @unittest.skipIf(beamfarm._native.has_gpu, "this build has the engine gpu")
    def test_builds_without_devices_say_so(self) -> None:
        with self.assertRaises(beamfarm.DeviceError):
            beamfarm.render(FOG, engine="gpu", progress=False)

    def test_the_commands_of_the_package(self) -> None:
        for name, arguments, word in (
            ("main", ["--version"], "beamfarm "),
            ("worker", ["--help"], "--connect"),
            ("worker", ["--version"], "protocol"),
        ):
            program = f"import sys; from beamfarm.command import {name}; sys.argv = ['x', *{arguments}]; {name}()"
            done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
            self.assertIn(word, done.stdout)
        self.assertIn(beamfarm.__version__, command("--version"))
        self.assertTrue((TOP / "README.md").is_file())


if __name__ == "__main__":
    unittest.main()
