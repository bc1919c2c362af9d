"""The render engine: F12 and animations by the command, and the viewport by its live view."""

from __future__ import annotations

import contextlib
import shutil
import tempfile
import time
import traceback
import weakref
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy
import numpy as np

from . import engines, exr, frame, job, passes, preferences, program, told
from .export import write_scene
from .viewport import sight
from .viewport.session import Session

# Seconds between checks of the job: for a cancel and the status line, and for a picture.
_LOOK = 0.1
_STATUS = 0.5
_PICTURE = 1.0
# Intermediate pictures take at most this share of the time.
_SHARE = 0.1


class Failed(Exception):
    """The frame cannot be rendered; the message is for the user."""


class BeamfarmRenderEngine(bpy.types.RenderEngine):
    bl_idname = "BEAMFARM"
    bl_label = "beamfarm"
    bl_use_preview = False
    bl_use_postprocess = True
    # Shader nodes are those of Cycles, and EEVEE renders the material preview.
    bl_use_shading_nodes_custom = False
    bl_use_eevee_viewport = True

    # The viewport's; Blender makes an engine for each viewport and for each render. Set late: `__init__` is Blender's.
    _session: Session | None = None
    _canvas = None
    _wrong: str | None = None

    def update_render_passes(self, scene=None, renderlayer=None) -> None:
        self.register_pass(scene, renderlayer, "Combined", 4, "RGBA", "COLOR")
        for each in passes.of_layer(renderlayer):
            self.register_pass(scene, renderlayer, each.name, len(each.channels), each.channels, each.kind)

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        try:
            with _folder() as folder:
                self._render(depsgraph, folder)
        except (Failed, program.ProgramError) as error:
            self.report({"ERROR"}, str(error))
        except Exception as error:
            # Otherwise Blender would show an empty picture and print only to the console.
            traceback.print_exc()
            self.report({"ERROR"}, f"Error in the add-on, see the console: {type(error).__name__}: {error}")

    def _render(self, depsgraph: bpy.types.Depsgraph, folder: Path) -> None:
        # As it is in this frame: settings can be animated.
        scene, view_layer = depsgraph.scene_eval, depsgraph.view_layer_eval
        settings = preferences.get()
        path = settings.path()
        ends = frame.ends(scene.beamfarm)
        if not ends:
            raise Failed("The render would never end: set passes, time or error in Render Properties > Sampling")
        if settings.use_farm and not settings.token:
            raise Failed("Other machines need a token: set one in Preferences > Add-ons > beamfarm")
        if scene.render.use_multiview:
            raise Failed("Stereoscopy is not rendered: turn it off in Output Properties")
        self.update_stats("", "Writing the scene")
        shape = frame.of_scene(scene)
        exported = self._export(depsgraph, folder, shape)
        if self.is_stopped():
            return
        wanted = list(passes.of_layer(view_layer))
        output, sketch = folder / "frame.exr", folder / "sketch.exr"
        layers = passes.aov(wanted, scene.render.film_transparent)
        picture = Picture(self, view_layer.name, shape.size, wanted, passes.cryptomattes(view_layer))
        tries = engines.tries(engines.chosen(scene.beamfarm.engine, settings.engine), frame.verb(settings))
        for number, by_engine in enumerate(tries):
            options = [*by_engine, *ends, *layers, "--sketch", str(sketch)]
            line = frame.command(path, settings, exported, output, options)
            running, code = self._run(line, picture, path, sketch)
            if output.is_file():
                picture.show(output.read_bytes())
            if code is None:
                return
            is_last = number + 1 == len(tries) or picture.passes or not engines.is_refusal(code)
            if not is_last:
                self.report({"WARNING"}, engines.instead(running.words()))
                continue
            if code not in (job.DONE, job.NOTHING):
                raise Failed(running.words() or f"beamfarm ended with exit code {code}")
            break
        if not picture.passes:
            if not output.is_file():
                raise Failed("No pass was completed in the time: allow more time")
            self.report({"WARNING"}, "No pass was completed in the time; this is a coarse picture: allow more time")
        self.update_progress(1.0)

    def _run(self, line: list[str], picture: Picture, path: Path, sketch: Path) -> tuple[job.Job, int | None]:
        """Runs the command to its end. Returns the job and its exit code, or None if it was cancelled."""
        settings = preferences.get()
        self.update_stats("", "Starting beamfarm")
        try:
            running = job.Job(line, settings.token if settings.use_farm else None)
        except OSError as error:
            raise Failed(f"{path} cannot be run: {error}") from error
        workers = []
        try:
            cancelled = self._follow(running, picture, path, workers, sketch)
            code = running.wait()
        finally:
            running.close()
            job.stop_workers(workers)
        return running, None if cancelled else code

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        session = self._viewport(depsgraph.scene)
        if session is not None:
            session.update(depsgraph, sight.of_context(context, depsgraph))
            self.tag_redraw()

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        session = self._session
        if session is None:
            self.update_stats("beamfarm", self._wrong or "")
            return
        session.look(depsgraph, sight.of_context(context, depsgraph))
        self.update_stats("beamfarm", session.words)
        shown = session.frame
        if shown is None:
            return
        if self._canvas is None:
            # Without a window there is no GPU.
            from .viewport.draw import Canvas

            self._canvas = Canvas()
        self._canvas.draw(self, depsgraph.scene, context.region, shown)

    def _viewport(self, scene: bpy.types.Scene) -> Session | None:
        settings = preferences.get()
        engine = engines.chosen(scene.beamfarm.engine, settings.engine)
        if self._session is not None and self._session.engine != engine:
            self._session.close()
            self._session = None
        if self._session is None:
            try:
                path = settings.path()
            except program.ProgramError as error:
                self._wrong = str(error)
                return None
            threads = ["--threads", str(settings.threads)] if settings.threads else []
            self._session = Session(path, threads, _redraws(self), engine)
        return self._session

    def __del__(self) -> None:
        if self._session is not None:
            self._session.close()
        # Only Blender 4.4 and later have one.
        above = getattr(super(), "__del__", None)
        if above is not None:
            above()

    def is_stopped(self) -> bool:
        """Whether the user has pressed Escape."""
        return self.test_break()

    def _export(self, depsgraph: bpy.types.Depsgraph, folder: Path, shape: frame.Frame) -> Path:
        settings = frame.export_settings(depsgraph.scene_eval, shape)
        if self.camera_override is not None:
            settings.camera = self.camera_override.evaluated_get(depsgraph)
        try:
            result = write_scene(depsgraph, folder, settings, self._go_to)
        except (ValueError, OSError) as error:
            raise Failed(f"The scene cannot be written: {error}") from error
        told.remember(depsgraph.scene.name, result.left_out, result.notes)
        if result.left_out:
            self.report({"WARNING"}, told.warning(result.left_out))
        return result.scene

    def _go_to(self, time: float) -> None:
        """Sets the depsgraph of this render to a time, frames."""
        self.frame_set(*frame.parts(time))

    def _follow(self, running: job.Job, picture: Picture, path: Path, workers: list, sketch: Path) -> bool:
        """Shows the progress until the end, starting with a coarse picture. Returns whether it was cancelled."""
        settings = preferences.get()
        next_status = next_picture = 0.0
        shown = 0
        while running.is_running:
            if self.is_stopped():
                self.update_stats("", "Cancelling")
                running.cancel()
                return True
            now = time.monotonic()
            if sketch.is_file():
                # The file is complete: it gets its name only once it is written.
                picture.show(sketch.read_bytes())
                sketch.unlink()
            if settings.use_farm and not workers and running.url:
                workers += job.start_workers(running, path, max(1, settings.workers), settings.threads)
            if now >= next_status:
                next_status = now + _STATUS
                progress = running.look()
                self.update_progress(progress.share)
                self.update_stats("", job.words(progress))
                if progress.passes > shown and now >= next_picture:
                    data = running.picture()
                    if data is not None:
                        shown = progress.passes
                        picture.show(data)
                    next_picture = now + max(_PICTURE, (time.monotonic() - now) / _SHARE)
            time.sleep(_LOOK)
        return False


def _redraws(engine: BeamfarmRenderEngine) -> Callable[[], None]:
    """A function that redraws a viewport from another thread.

    Blender releases an engine when its viewport is closed; a strong reference elsewhere would keep it from ending its
    session.
    """
    known = weakref.ref(engine)

    def redraw() -> None:
        engine = known()
        if engine is not None:
            # It may be gone nevertheless.
            with contextlib.suppress(ReferenceError):
                engine.tag_redraw()

    return redraw


class Picture:
    """The render result of a view layer while it is being filled."""

    def __init__(
        self, engine: BeamfarmRenderEngine, layer: str, size: tuple[int, int], wanted: list, mattes: list[str]
    ) -> None:
        self.engine, self.layer, self.size, self.wanted, self.mattes = engine, layer, size, wanted, mattes
        self.passes = 0
        for each in wanted:
            engine.add_pass(each.name, len(each.channels), each.channels, layer=layer)

    def show(self, data: bytes) -> None:
        """Puts the pixels of an EXR into it."""
        sources = {source for each in self.wanted for source in each.sources}
        try:
            channels = exr.read(data, {*passes.COMBINED, passes.ALPHA, *sources})
            self.passes = exr.passes(data) or 0
            manifests = exr.manifests(data)
        except exr.ExrError as error:
            raise Failed(f"The picture cannot be read: {error}") from error
        width, height = self.size
        colour = [channels.get(name) for name in passes.COMBINED]
        if any(channel is None or channel.shape != (height, width) for channel in colour):
            raise Failed(f"The picture does not have {width} x {height} pixels")
        alpha = channels.get(passes.ALPHA)
        alpha = np.ones((height, width), np.float32) if alpha is None else alpha
        # A group without lights has no layer and contributes nothing.
        black = np.zeros((height, width), np.float32)
        result = self.engine.begin_result(0, 0, width, height, layer=self.layer)
        # A result that is not ended crashes Blender.
        try:
            of_layer = result.layers[0].passes
            _fill(of_layer["Combined"], [*colour, alpha])
            for kind in self.mattes:
                _name_matte(result, f"{self.layer}.Crypto{kind}", manifests.get(f"Crypto{kind}", "{}"))
            for each in self.wanted:
                target = of_layer.get(each.name)
                if target is not None:
                    _fill(target, [channels.get(source, black) for source in each.sources])
        finally:
            self.engine.end_result(result)


def _name_matte(result: bpy.types.RenderResult, name: str, manifest: str) -> None:
    """Stores the names by which the compositor's Cryptomatte node and files know a Cryptomatte."""
    key = f"cryptomatte/{zlib.crc32(name.encode()):08x}"[:-1]
    fields = {"name": name, "hash": "MurmurHash3_32", "conversion": "uint32_to_float32", "manifest": manifest}
    for field, value in fields.items():
        result.stamp_data_add_field(f"{key}/{field}", value)


def _fill(render_pass: bpy.types.RenderPass, channels: list[np.ndarray]) -> None:
    render_pass.rect.foreach_set(np.stack(channels, axis=-1).ravel())


@contextlib.contextmanager
def _folder() -> Iterator[Path]:
    """A folder for one frame."""
    folder = Path(tempfile.mkdtemp(prefix="beamfarm-", dir=bpy.app.tempdir or None))
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)
