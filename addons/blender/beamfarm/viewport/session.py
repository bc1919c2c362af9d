"""One viewport: its export, its live view, and what it shows."""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Callable
from pathlib import Path

import bpy

from .. import engines, told
from ..export import Exporter, ExportSettings
from .live import Frame, Live
from .sight import Sight

_open: weakref.WeakSet[Session] = weakref.WeakSet()

# Successive changes of the view count as one gesture.
_GESTURE = "view"


class Session:
    """Keeps a live view in step with a scene. `news` is called, from another thread, when there is something to
    show."""

    def __init__(
        self, program: Path, options: list[str], news: Callable[[], None], engine: str = engines.CPU
    ) -> None:
        self._program, self._options, self._news = program, options, news
        self.engine = engine
        # Options to try in turn if the command refuses.
        self._tries = engines.tries(engine, "live")
        self._scene: Path | None = None
        self._note: str | None = None
        self._folder = Path(tempfile.mkdtemp(prefix="beamfarm-view-", dir=bpy.app.tempdir or None))
        self._exporter = Exporter(self._folder)
        self._sight: Sight | None = None
        self._passes: int | None = None
        self._live: Live | None = None
        self._is_written = False
        self.trouble: str | None = None
        _open.add(self)

    def update(self, depsgraph: bpy.types.Depsgraph, sight: Sight) -> int | None:
        """Call it after a change of the scene. Returns the number of the change, for pictures."""
        self._sight = sight
        scene = depsgraph.scene
        render: dict[str, object] = {"seed": scene.beamfarm.seed}
        if scene.beamfarm.radius > 0.0:
            render["radius"] = scene.beamfarm.radius
        settings = ExportSettings(width=sight.width, height=sight.height, view=sight.view(), bakes=False, render=render)
        try:
            write = self._exporter.update if self._is_written else self._exporter.write
            result = write(depsgraph, settings)
        except (ValueError, OSError) as error:
            self.trouble = f"The scene cannot be written: {error}"
            return None
        self.trouble = None
        self._is_written = True
        told.remember(scene.name, result.left_out, result.notes)
        if self._live is None or self._live.is_over:
            # A scene that cannot be rendered ends the process: the next one may be valid.
            self._scene = result.scene
            self._start()
        live = self._live
        if live is None:
            return None
        self._tell(depsgraph, sight)
        return live.change("written")

    def _start(self) -> None:
        if self._live is not None:
            self._live.close()
        self._passes = None
        try:
            self._live = Live(self._program, self._scene, [*self._tries[0], *self._options], self._news)
        except OSError as error:
            self._live = None
            self.trouble = f"{self._program} cannot be run: {error}"

    def _tell(self, depsgraph: bpy.types.Depsgraph, sight: Sight) -> None:
        """Sends the settings of the picture that are not in the scene file."""
        if self._passes != depsgraph.scene.beamfarm.viewport_passes:
            self._passes = depsgraph.scene.beamfarm.viewport_passes
            self._live.tell("passes", passes=self._passes)
        self._live.tell("size", width=sight.width)

    def _fall_back(self) -> bool:
        """Goes on with the next engine if this one does not accept the scene."""
        live = self._live
        if live is None or len(self._tries) == 1 or not live.is_refused:
            return False
        self._note = engines.instead(str(live.trouble or ""))
        del self._tries[0]
        self._start()
        return self._live is not None

    def look(self, depsgraph: bpy.types.Depsgraph, sight: Sight) -> int | None:
        """Call it when the viewport is drawn. Returns the number of the change of its view, if there is one."""
        if self._fall_back():
            self._tell(depsgraph, sight)
            return self.update(depsgraph, sight) if sight != self._sight else self._live.change("written")
        if sight == self._sight or self._live is None:
            return None
        if self._sight is None or not sight.differs_in_place_alone(self._sight):
            return self.update(depsgraph, sight)
        self._sight = sight
        return self._live.change("camera", gesture=_GESTURE, **sight.message())

    @property
    def frame(self) -> Frame | None:
        """The picture to show."""
        return self._live and self._live.frame

    @property
    def words(self) -> str:
        """The current activity, or what is wrong."""
        wrong = self.trouble or (self._live and self._live.trouble)
        if wrong:
            return str(wrong)
        if self._live is None:
            return ""
        frame, state = self._live.frame, self._live.state
        if frame is None or frame.passes == 0:
            doing = {"pilot": "Finding radii", "no workers": "Starting"}.get(state.doing, "Sketch")
            return " | ".join([doing, self._note] if self._note else [doing])
        parts = [f"Pass {frame.passes}/{frame.of}"]
        if state.error is not None:
            parts.append(f"error {100.0 * state.error:.2g} %")
        if self._note:
            parts.append(self._note)
        return " | ".join(parts)

    def close(self) -> None:
        """Ends everything."""
        live, self._live = self._live, None
        if live is not None:
            live.close()
        shutil.rmtree(self._folder, ignore_errors=True)
        _open.discard(self)


def close_all() -> None:
    """The add-on is disabled, or Blender ends."""
    for session in list(_open):
        session.close()
