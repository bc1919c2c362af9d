"""Moving scenes: they are read at several times, while the shutter is open or frame by frame, and what changes gets
keys."""

import re
from dataclasses import dataclass, field, replace

from .merging import Merging, Read
from .meshes import MeshArrays
from .names import Names
from .spans import motion_of, now


@dataclass
class Moment:
    """One of the times at which the scene is read."""

    span: object
    """`spans.Exposure` or `spans.Frames`."""
    time: float
    is_first: bool = True
    """The span's own time, which decides what exists and what it is made of."""
    is_again: bool = False
    """The same once more, for meshes found to move since."""
    geometries: dict = field(default_factory=dict)
    """By part, at the first moment."""

    def steps_of(self, object, parent, report):
        """`spans.motion_of` for an object, or for an instance of `parent`."""
        steps, deforms = motion_of(object, parent)
        if not self.span.is_long:
            return steps, deforms
        if self.span.opens != self.span.closes and not (steps and deforms):
            report.note(f"'{object.name}' is blurred, whatever its settings say: it moves from frame to frame")
        return 1, True

    def remember(self, context, placed, geometry):
        """Keeps the state of an object at this place at the frame's own time."""
        self.geometries[context.part(placed, "geometry")] = geometry

    def known(self, context, placed, mesh):
        """The geometry of an object at this place at the frame's own time; its present vertices are kept."""
        geometry = self.geometries.get(context.part(placed, "geometry"))
        if geometry is None:
            if self.span.is_long:
                context.report.leave_out(f"'{placed.name}', which is absent in the first frame")
            else:
                context.report.note(f"'{placed.name}' is absent at the frame's own time: its blur lacks it")
            return None
        deforming = geometry.deforming
        if deforming is None or self.time in deforming.moves:
            return geometry
        if not self.is_again:
            deforming.meet(mesh, self.time, geometry.variants(), self.span.is_long)
        elif deforming.moves:
            deforming.keep(MeshArrays(mesh), self.time, geometry.variants(), self.span.is_long)
        return geometry


def moving(context, span, go_to, read):
    """Tables of the scene with keys for what moves in a `spans.Exposure` or in `spans.Frames`.

    `read`: function from a `Context` to its tables.
    """
    found_at = here = now(context.depsgraph)
    settings = context.settings
    first = Moment(span, span.own)
    context.motion = first

    def settings_now():
        seen = settings.camera or camera
        if span.is_long and settings.camera is None:
            # The evaluated scene may still have the camera from before the last marker.
            seen = context.depsgraph.scene.camera
        # For one frame, the frame's own camera, even if another one takes over while the shutter is open.
        return replace(settings, camera=seen and seen.original.evaluated_get(context.depsgraph))

    def read_at(time, **how):
        other = replace(
            context,
            scene=context.depsgraph.scene_eval,
            settings=settings_now(),
            slots={key: slot for key, slot in context.slots.items() if not slot.is_animated},
            motion=Moment(span, time, False, geometries=first.geometries, **how),
            names=Names(),
            media_names=Names(),
            **{name: type(getattr(context, name))() for name in GROWING},
        )
        return Read(other, read(other))

    try:
        if here != span.own:
            here = span.own
            go_to(here)
            context.scene = context.depsgraph.scene_eval
        camera = (settings.camera or context.scene.camera) if settings.view is None else None
        context.settings = settings_now()
        own = Read(context, read(context))
        camera_steps = 0 if camera is None else motion_of(camera)[0]
        steps = [source.steps for source in context.sources.values()]
        reads = {span.own: own}
        for time in span.times(max([1, camera_steps, *steps])):
            if time != span.own:
                here = time
                go_to(here)
                reads[time] = read_at(time)
        if any(geometry.deforming and geometry.deforming.moves for geometry in first.geometries.values()):
            here = span.own
            go_to(here)
            read_at(span.own, is_again=True)
    finally:
        if here != found_at:
            go_to(found_at)
    tables = Merging(span, reads).tables(camera_steps)
    written = repr(tables)
    for path in list(context.files.used):
        if path not in written and OF_A_FRAME.sub("_####", path) not in written:
            context.files.drop(path)
    if tables == own.tables and not span.is_long:
        return own.tables
    return {"image": tables.pop("image"), "render": tables.pop("render"), "animation": span.table()} | tables


# The frame number in names of sequences' files.
OF_A_FRAME = re.compile(r"_-?\d+(?=\.\w+\Z)")
# Fields of a context that a reading fills.
GROWING = ["textures", "media", "materials", "shapes", "lights", "groups", "rules", "shown", "sources", "counts"]
