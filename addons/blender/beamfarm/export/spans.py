"""The times that a scene file covers: those while the shutter of one frame is open, or all frames."""

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
    """The scene's present time."""
    scene = depsgraph.scene_eval
    return float(scene.frame_current) + float(scene.frame_subframe)


@dataclass(frozen=True)
class Exposure:
    """The time for which the shutter of one frame is open."""

    own: float
    """The time that decides what exists and what it is made of."""
    opens: float
    closes: float
    is_long = False
    """Whether it covers more than one frame."""

    @staticmethod
    def of(depsgraph):
        """That of the present frame; None without motion blur."""
        shutter = shutter_of(depsgraph)
        return None if shutter is None else Exposure(now(depsgraph), *shutter)

    def times(self, steps):
        """The times at which Cycles evaluates this many motion steps, none for 0: those of fewer steps are among
        them."""
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
    """The first one."""
    last: int
    fps: float
    opens: float = 0.0
    closes: float = 0.0
    is_long = True

    @staticmethod
    def of(depsgraph):
        """The scene's frames."""
        scene = depsgraph.scene_eval
        fps = scene.render.fps / scene.render.fps_base
        return Frames(float(scene.frame_start), scene.frame_end, fps, *(shutter_of(depsgraph) or (0.0, 0.0)))

    def times(self, _steps):
        """One for each frame, and those that the shutter reaches."""
        first, last = math.floor(self.own + self.opens), math.ceil(self.last + self.closes)
        return [float(frame) for frame in range(first, max(last, first + 1) + 1)]

    def table(self):
        """`[animation]`."""
        fields = {"frames": [int(self.own), self.last], "fps": self.fps}
        return fields if self.opens == self.closes else fields | {"shutter": [self.opens, self.closes]}


def motion_of(object, parent=None):
    """(motion steps, 0 for none; whether vertex motion is blurred) for an object, or for an instance of `parent`."""
    steps, deforms = 1, True
    for each in (object, parent):
        # The evaluated copy may still have their values from before a change.
        settings = None if each is None else getattr(each.original, "cycles", None)
        if settings is None:
            continue
        if not getattr(settings, "use_motion_blur", True):
            return 0, False
        steps = max(steps, getattr(settings, "motion_steps", 1))
        deforms &= getattr(settings, "use_deform_motion", True)
    return steps, deforms
