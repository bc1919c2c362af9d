"""The viewport without a window: its camera, the protocol, and the path from an edit to a picture."""

from __future__ import annotations

import gc
import importlib
import socket
import statistics
import threading
import time
import unittest
import weakref
from collections.abc import Callable
from types import SimpleNamespace
from unittest import mock

import harness
import bpy
import numpy as np
from mathutils import Euler, Matrix

harness.install()
sight = harness.module("viewport.sight")
websocket = harness.module("viewport.websocket")
live = harness.module("viewport.live")
session = harness.module("viewport.session")
export = harness.module("export")

# For what a busy machine usually does in a second.
LONG = 60.0


def wait_for(what: str, holds: Callable[[], object], patience: float = LONG) -> object:
    """Polls until a value is not None and returns it."""
    until = time.monotonic() + patience
    while time.monotonic() < until:
        value = holds()
        if value:
            return value
        time.sleep(0.005)
    raise AssertionError(f"waited for {what}")


class Camera(unittest.TestCase):
    """What Blender draws a viewport with is what the export makes of the camera."""

    def table(self, settings) -> dict[str, object]:
        folder = harness.folder()
        result = export.write_scene(bpy.context.evaluated_depsgraph_get(), folder, settings)
        import tomllib

        return tomllib.loads(result.scene.read_text(encoding="utf-8"))["camera"]

    def check(self, size: tuple[int, int], **lens: object) -> None:
        scene = harness.lit_floor(size)
        camera = scene.camera
        for name, value in lens.items():
            setattr(camera.data, name, value)
        camera.matrix_world = Matrix.LocRotScale((0.4, -0.7, 5.0), Euler((0.3, 0.2, 0.1)), None)
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        window = camera.calc_matrix_camera(depsgraph, x=size[0], y=size[1])
        seen = sight.of_matrices(camera.matrix_world.inverted(), window, size, None)
        width, height = size
        ours = self.table(export.ExportSettings(width=width, height=height, view=seen.view()))
        theirs = self.table(export.ExportSettings(width=width, height=height))
        for name in ("origin", "target", "up", "principal_point", "height"):
            expected = theirs.get(name, [0.0, 0.0] if name == "principal_point" else 0.0)
            # Matrices in single precision.
            np.testing.assert_allclose(ours.get(name, expected), expected, rtol=1e-5, atol=1e-5, err_msg=name)
        if camera.data.type == "ORTHO":
            self.assertEqual(ours["projection"], "orthographic")
            self.assertAlmostEqual(ours["view_width"], theirs["view_width"], places=5)
        else:
            self.assertEqual(self.fov_x(ours, size), self.fov_x(theirs, size))

    def fov_x(self, camera: dict[str, object], size: tuple[int, int]) -> float:
        width, height = size
        tangent = np.tan(np.radians(camera["fov"]) / 2.0)
        axis = camera.get("fov_axis", "x")
        if axis == "y" or (axis == "larger" and height > width) or (axis == "smaller" and height < width):
            tangent *= width / height
        return round(float(tangent), 4)

    def test_lenses(self) -> None:
        for size in ((64, 48), (48, 64), (50, 50)):
            for fit in ("AUTO", "HORIZONTAL", "VERTICAL"):
                with self.subTest(size=size, fit=fit):
                    self.check(size, lens=35.0, sensor_fit=fit)

    def test_shifts(self) -> None:
        for size in ((64, 48), (48, 64)):
            with self.subTest(size=size):
                self.check(size, shift_x=0.2, shift_y=-0.1)

    def test_orthographic_ones(self) -> None:
        for size in ((64, 48), (48, 64)):
            for fit in ("AUTO", "HORIZONTAL", "VERTICAL"):
                with self.subTest(size=size, fit=fit):
                    self.check(size, type="ORTHO", ortho_scale=3.0, sensor_fit=fit, shift_x=0.2, shift_y=-0.1)

    def test_a_camera_that_is_looked_through_has_its_lens(self) -> None:
        scene = harness.lit_floor()
        camera = scene.camera
        camera.data.dof.use_dof, camera.data.dof.focus_distance = True, 4.0
        camera.data.dof.aperture_fstop = 0.5
        depsgraph = bpy.context.evaluated_depsgraph_get()
        window = camera.calc_matrix_camera(depsgraph, x=64, y=48)
        seen = {}
        for perspective in ("CAMERA", "PERSP"):
            context = SimpleNamespace(
                scene=scene,
                region=SimpleNamespace(width=64, height=48),
                region_data=SimpleNamespace(view_perspective=perspective, view_distance=6.0, window_matrix=window,
                                            view_matrix=camera.matrix_world.inverted()),
                space_data=SimpleNamespace(use_local_camera=False),
            )
            seen[perspective] = sight.of_context(context, depsgraph)
        self.assertFalse(seen["CAMERA"].differs_in_place_alone(seen["PERSP"]))
        tables = {name: self.table(export.ExportSettings(width=64, height=48, view=each.view()))
                  for name, each in seen.items()}
        # 50 mm over 0.5 is the diameter.
        self.assertAlmostEqual(tables["CAMERA"]["aperture"], 0.05)
        self.assertEqual(tables["CAMERA"]["focus_distance"], 4.0)
        self.assertNotIn("aperture", tables["PERSP"])

    def test_a_view_without_a_place_begins_before_all_that_it_shows(self) -> None:
        window = Matrix.Diagonal((0.5, 0.5, -0.01, 1.0))
        seen = sight.of_matrices(Matrix.Identity(4), window, (20, 20), 10.0)
        self.assertEqual(seen.ortho_scale, 4.0)
        self.assertEqual(tuple(seen.matrix_world.translation), (0.0, 0.0, 80.0))

    def test_what_a_move_changes(self) -> None:
        window = Matrix(((1.5, 0, 0, 0), (0, 2, 0, 0), (0, 0, -1, -0.2), (0, 0, -1, 0)))
        here = sight.of_matrices(Matrix.Identity(4), window, (40, 30), 10.0)
        there = sight.of_matrices(Matrix.Translation((1, 0, 0)), window, (40, 30), 10.0)
        wider = sight.of_matrices(Matrix.Identity(4), window, (50, 30), 10.0)
        self.assertTrue(here.differs_in_place_alone(there))
        self.assertFalse(here.differs_in_place_alone(wider))
        self.assertEqual(there.message()["origin"], [-1.0, 0.0, 0.0])
        self.assertEqual(there.message()["target"], [-1.0, 0.0, -1.0])


class Wire(unittest.TestCase):
    """The client against a scripted server."""

    def client_of(self, *frames: bytes):
        """A client and the frames that it will be sent; the server then ends."""
        listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(listener.close)
        self.heard = b""

        def serve() -> None:
            import base64
            import hashlib

            connection, _ = listener.accept()
            with connection:
                head = b""
                while b"\r\n\r\n" not in head:
                    head += connection.recv(4096)
                key = head.split(b"Sec-WebSocket-Key: ")[1].split(b"\r\n")[0]
                accept = base64.b64encode(hashlib.sha1(key + b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11").digest())
                answer = b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                connection.sendall(answer + b"Sec-WebSocket-Accept: " + accept + b"\r\n\r\n" + b"".join(frames))
                self.heard = head.split(b"\r\n\r\n", 1)[1]
                connection.settimeout(2.0)
                try:
                    while more := connection.recv(4096):
                        self.heard += more
                except TimeoutError:
                    pass

        self.server = threading.Thread(target=serve, daemon=True)
        self.server.start()
        client = websocket.WebSocket("127.0.0.1", listener.getsockname()[1], "/look", "secret")
        self.addCleanup(client.close)
        return client

    def test_messages_in_pieces_and_pings_between(self) -> None:
        client = self.client_of(
            b"\x81\x02hi", b"\x01\x02to", b"\x89\x01p", b"\x80\x03day", b"\x82\x7e\x01\x00" + bytes(256), b"\x88\x00"
        )
        self.assertEqual(client.receive(), "hi")
        self.assertEqual(client.receive(), "today")
        self.assertEqual(client.receive(), bytes(256))
        with self.assertRaises(websocket.Closed):
            client.receive()
        client.close()
        self.server.join()
        # The pong, masked like everything that a client sends.
        first, second, *mask = self.heard[:6]
        self.assertEqual((first, second), (0x8A, 0x81))
        self.assertEqual(self.heard[6] ^ mask[0], ord("p"))

    def test_nonsense_is_an_end(self) -> None:
        too_long, too_short = b"\x82\x7f" + b"\x7f" * 8, b"\x81\x05a"
        for frame in (b"\xf1\x00", b"\x83\x00", b"\x81\x82abcdef", b"\x80\x01a", too_long, too_short):
            with self.subTest(frame=frame):
                client = self.client_of(frame)
                with self.assertRaises(websocket.Closed):
                    client.receive()

    def test_nobody_there(self) -> None:
        with self.assertRaises(websocket.Closed):
            websocket.WebSocket("127.0.0.1", 1, "/look", "")

    def test_frames(self) -> None:
        header = b'{"frame":3,"revision":1,"seq":5,"step":0,"steps":1,"passes":7,"of":9,"width":2,"height":1}'
        pixels = np.arange(6, dtype="<f4")
        data = bytearray(len(header).to_bytes(4, "little") + header + pixels.tobytes())
        frame = live.parse_frame(data)
        self.assertEqual((frame.number, frame.seq, frame.passes, frame.of), (3, 5, 7, 9))
        np.testing.assert_array_equal(frame.pixels, pixels.reshape(1, 2, 3))
        for wrong in (data[:-1], data[:10], bytearray(b"\x02\0\0\0{}")):
            with self.assertRaises((ValueError, KeyError)):
                live.parse_frame(wrong)


def column(frame) -> int:
    """The column of the lamp's light."""
    return int(frame.pixels[..., 1].sum(axis=0).argmax())


class Live(unittest.TestCase):
    def setUp(self) -> None:
        self.scene = harness.lit_floor((96, 64))
        self.scene.beamfarm.viewport_passes = 4
        self.news = threading.Event()
        self.session = session.Session(harness.PROGRAM, [], self.news.set)
        self.addCleanup(self.session.close)

    def sight(self, move: float = 0.0):
        camera, depsgraph = self.scene.camera, bpy.context.evaluated_depsgraph_get()
        window = camera.calc_matrix_camera(depsgraph, x=96, y=64)
        view = (Matrix.Translation((move, 0.0, 0.0)) @ camera.matrix_world).inverted()
        return sight.of_matrices(view, window, (96, 64), None)

    def update(self) -> int:
        """Calls the engine as Blender does after an edit."""
        bpy.context.view_layer.update()
        seq = self.session.update(bpy.context.evaluated_depsgraph_get(), self.sight())
        self.assertIsNotNone(seq, self.session.words)
        return seq

    def picture(self, what: str, seq: int, passes: int = 0):
        """The first picture with a change."""
        def is_it():
            self.assertIsNone(self.session.trouble)
            frame = self.session.frame
            return frame if frame is not None and frame.seq >= seq and frame.passes >= passes else None

        return wait_for(f"{what}: {self.session.words}", is_it)

    def test_edits_and_moves_are_seen(self) -> None:
        first = self.picture("the first passes", self.update(), passes=4)
        self.assertEqual(first.pixels.shape, (64, 96, 3))
        self.assertEqual(self.session.words.partition(" |")[0], "Pass 4/4")
        # Twice the watts make the picture twice as bright, up to its noise.
        bpy.data.objects["lamp"].data.energy *= 2.0
        brighter = self.picture("a brighter lamp", self.update(), passes=4)
        self.assertAlmostEqual(brighter.pixels.mean() / first.pixels.mean(), 2.0, delta=0.1)
        # Moving the view exports nothing.
        written = self.session._exporter.folder / "scene.toml"
        before = written.stat().st_mtime_ns
        seq = self.session.look(bpy.context.evaluated_depsgraph_get(), self.sight(1.0))
        moved = self.picture("a move", seq, passes=4)
        self.assertEqual(written.stat().st_mtime_ns, before)
        self.assertLess(column(moved), column(first))
        # Nothing changes: nothing is sent.
        self.assertIsNone(self.session.look(bpy.context.evaluated_depsgraph_get(), self.sight(1.0)))

    def test_at_rest_it_is_the_render(self) -> None:
        frame = self.picture("all passes", self.update(), passes=4)
        folder = self.session._exporter.folder
        out = harness.folder() / "a.exr"
        harness.command("render", folder / "scene.toml", "--passes", 4, "-o", out, "--quiet")
        channels = harness.module("exr").read(out.read_bytes())
        # One counts rows from the bottom, the other from the top.
        theirs = np.stack([channels[name] for name in "RGB"], axis=-1)[::-1]
        np.testing.assert_array_equal(frame.pixels, theirs)

    def test_what_is_wrong_is_said_and_mended(self) -> None:
        lamp = bpy.data.objects["lamp"]
        collection = bpy.context.collection
        collection.objects.unlink(lamp)
        bpy.context.view_layer.update()
        self.session.update(bpy.context.evaluated_depsgraph_get(), self.sight())
        wait_for("an end", lambda: self.session._live.is_over or self.session.frame is not None)
        collection.objects.link(lamp)
        frame = self.picture("a lamp", self.update(), passes=4)
        self.assertGreater(frame.pixels.max(), 0.0)

    def test_where_there_is_no_gpu_processors_show_it(self) -> None:
        path = harness.folder() / "beamfarm"
        path.write_text(
            "#!/bin/sh\n"
            'case "$*" in *"--engine gpu"*) echo "error: there is no device" >&2; exit 1;; esac\n'
            f'exec "{harness.PROGRAM}" "$@"\n',
            encoding="utf-8",
        )
        path.chmod(0o755)
        self.session.close()
        self.news.clear()
        self.session = session.Session(path, [], self.news.set, "GPU")
        self.addCleanup(self.session.close)
        self.update()
        self.assertTrue(self.news.wait(LONG))
        # Calls the engine as Blender does to draw.
        seq = self.session.look(bpy.context.evaluated_depsgraph_get(), self.sight())
        self.assertIsNotNone(seq)
        self.picture("by processors", seq, 1)
        self.assertIn("On processors: there is no device", self.session.words)

    def test_it_ends_with_the_viewport(self) -> None:
        self.picture("a sketch", self.update())
        process = self.session._live._process
        self.session.close()
        self.assertIsNotNone(process.poll())

    def test_an_engine_draws_what_comes_and_ends_its_session(self) -> None:
        engine = harness.module("engine").BeamfarmRenderEngine
        camera = self.scene.camera
        window = camera.calc_matrix_camera(bpy.context.evaluated_depsgraph_get(), x=96, y=64)
        place = camera.matrix_world.inverted()
        context = SimpleNamespace(
            scene=self.scene,
            region=SimpleNamespace(width=96, height=64),
            region_data=SimpleNamespace(view_perspective="CAMERA", view_matrix=place, window_matrix=window),
            space_data=SimpleNamespace(use_local_camera=False),
        )
        drawn, known = [], []

        class Canvas:
            def draw(self, _engine, _scene, _region, frame) -> None:
                drawn.append(frame)

        # An engine exists only during a render, and there is no window to draw into.
        def render(this, depsgraph: bpy.types.Depsgraph, _folder) -> None:
            this._canvas = Canvas()
            this.view_update(context, depsgraph)
            known.append((this._session._live._process, weakref.ref(this)))

            def is_drawn() -> bool:
                this.view_draw(context, depsgraph)
                return bool(drawn) and drawn[-1].passes == 4

            wait_for("all passes", is_drawn)

        with mock.patch.object(engine, "_render", render):
            bpy.ops.render.render()
        self.assertEqual(drawn[-1].pixels.shape, (64, 96, 3))
        gc.collect()
        (process, this), *_ = known
        self.assertIsNone(this())
        wait_for("its end", lambda: process.poll() is not None)

    def test_a_texture_begins_at_the_bottom(self) -> None:
        draw = importlib.import_module(f"{harness.MODULE}.viewport.draw")
        pixels = np.arange(18, dtype=np.float32).reshape(2, 3, 3)
        with mock.patch.object(draw, "gpu") as gpu:
            draw._texture(pixels)
        _, size, data = gpu.types.Buffer.call_args.args
        self.assertEqual(size, 24)
        given = data.reshape(2, 3, 4)
        np.testing.assert_array_equal(given[0, :, :3], pixels[1])
        np.testing.assert_array_equal(given[1, :, :3], pixels[0])
        self.assertTrue((given[..., 3] == 1.0).all())

    def test_from_event_to_picture(self) -> None:
        """Not a test of speed: it prints the time taken."""
        self.picture("all passes", self.update(), passes=4)
        edits, moves = [], []
        for _ in range(10):
            begin = time.monotonic()
            bpy.data.objects["lamp"].location.x += 0.02
            self.picture("an edit", self.update())
            edits.append(time.monotonic() - begin)
        for step in range(1, 11):
            begin = time.monotonic()
            seq = self.session.look(bpy.context.evaluated_depsgraph_get(), self.sight(0.02 * step))
            self.picture("a move", seq)
            moves.append(time.monotonic() - begin)
        for what, times in (("edit", edits), ("move", moves)):
            middle, most = 1000.0 * statistics.median(times), 1000.0 * max(times)
            print(f"{what} to picture: median {middle:.0f} ms, most {most:.0f} ms")


if __name__ == "__main__":
    unittest.main()
