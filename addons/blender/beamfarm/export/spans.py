"""Which times a scene file is to tell of: those while the shutter of one frame is open, or all frames."""

import math
from dataclasses import dataclass


def shutter_of(depsgraph):
    """When the shutter opens and closes, in frames after the frame's own time; None without motion blur."""
    render = depsgraph.scene_eval.render
    if not (render.use_motion_blur and getattr(depsgraph.view_layer_eval, "use_motion_blur", True)):
        return None
    length = float(render.motion_blur_shutter)
    if length <= 0.0:
        return None
    opens = {"START": 0.0, "CENTER": -0.5 * length, "END": -length}[render.motion_blur_position]
    return opens, opens + length


def now(depsgraph):
    """The time that the scene shows."""
    scene = depsgraph.scene_eval
    return float(scene.frame_current) + float(scene.frame_subframe)


@dataclass(frozen=True)
class Exposure:
    """While the shutter is open for one frame."""

    own: float
    """The time that says what there is and what it is made of."""
    opens: float
    closes: float
    is_long = False
    """Whether more than one frame is told of."""

    @staticmethod
    def of(depsgraph):
        """Of the frame that is shown; None without motion blur."""
        shutter = shutter_of(depsgraph)
        return None if shutter is None else Exposure(now(depsgraph), *shutter)

    def times(self, steps):
        """So many as Cycles looks at for these motion steps, none for 0: those of fewer steps are among them."""
        count = 2**steps
        moments = [self.own + (self.opens + (self.closes - self.opens) * k / count) for k in range(count + 1)]
        return moments if steps else []

    def table(self):
        """`[animation]`."""
        whole = math.floor(self.own)
        frame = whole if whole == self.own else self.own
        return {"frames": [whole, whole], "frame": frame, "shutter": [self.opens, self.closes]}


@dataclass(frozen=True)
class Frames:
    """All frames from the first to the last."""

    own: float
    """The first."""
    last: int
    fps: float
    opens: float = 0.0
    closes: float = 0.0
    is_long = True

    @staticmethod
    def of(depsgraph):
        """Those of the scene."""
        scene = depsgraph.scene_eval
        fps = scene.render.fps / scene.render.fps_base
        return Frames(float(scene.frame_start), scene.frame_end, fps, *(shutter_of(depsgraph) or (0.0, 0.0)))

    def times(self, _steps):
        """One for each frame, and as far as the shutter goes."""
        first, last = math.floor(self.own + self.opens), math.ceil(self.last + self.closes)
        return [float(frame) for frame in range(first, max(last, first + 1) + 1)]

    def table(self):
        """`[animation]`."""
        fields = {"frames": [int(self.own), self.last], "fps": self.fps}
        return fields if self.opens == self.closes else fields | {"shutter": [self.opens, self.closes]}


def motion_of(object, parent=None):
    """(motion steps, 0 for none; whether what vertices do is blurred) of an object, or of an instance of `parent`."""
    steps, deforms = 1, True
    for each in (object, parent):
        # The copy that is evaluated may have them as they were before a change.
        settings = None if each is None else getattr(each.original, "cycles", None)
        if settings is None:
            continue
        if not getattr(settings, "use_motion_blur", True):
            return 0, False
        steps = max(steps, getattr(settings, "motion_steps", 1))
        deforms &= getattr(settings, "use_deform_motion", True)
    return steps, deforms
