"""Motion blur: the scene is read at several times while the shutter is open, and what is not the same at all of them
gets keys."""

from dataclasses import dataclass, field, replace

from mathutils import Matrix

from .keys import keys, on_its_way, over_time, turning
from .meshes import MeshArrays
from .names import Names
from .transforms import matrix_step


@dataclass(frozen=True)
class Shutter:
    """When it opens and closes, in frames after the frame's own time."""

    frame: float
    opens: float
    closes: float

    def times(self, steps):
        """So many as Cycles looks at for these motion steps: those of fewer steps are among them."""
        count = 2**steps
        return [self.frame + (self.opens + (self.closes - self.opens) * k / count) for k in range(count + 1)]


def shutter_of(depsgraph):
    """`Shutter` of the frame that is shown; None without motion blur."""
    scene, render = depsgraph.scene_eval, depsgraph.scene_eval.render
    if not (render.use_motion_blur and getattr(depsgraph.view_layer_eval, "use_motion_blur", True)):
        return None
    length = float(render.motion_blur_shutter)
    if length <= 0.0:
        return None
    opens = {"START": 0.0, "CENTER": -0.5 * length, "END": -length}[render.motion_blur_position]
    return Shutter(float(scene.frame_current) + float(scene.frame_subframe), opens, opens + length)


def motion_of(object, parent=None):
    """(motion steps, 0 for none; whether what the vertices do is blurred) of an object, or of an instance of `parent`."""
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


@dataclass
class Moment:
    """One of the times at which the scene is read."""

    time: float
    is_first: bool = True
    """The frame's own time, which says what there is and what it is made of."""
    is_again: bool = False
    """The same once more, for the meshes that are known by now to move."""
    geometries: dict = field(default_factory=dict)
    """By part, of the first moment."""

    def remember(self, context, placed, geometry):
        """Keeps what an object has at this place at the frame's own time."""
        self.geometries[context.part(placed, "geometry")] = geometry

    def known(self, context, placed, mesh):
        """The geometry that an object had at this place at the frame's own time; how its vertices are now is kept."""
        geometry = self.geometries.get(context.part(placed, "geometry"))
        if geometry is None:
            context.report.note(f"'{placed.name}' is not there at the frame's own time: it is not seen in its blur")
            return None
        deforming = geometry.deforming
        if deforming is None or self.time in deforming.moves:
            return geometry
        if not self.is_again:
            deforming.meet(mesh, self.time, geometry.variants())
        elif deforming.moves_at_all:
            deforming.keep(MeshArrays(mesh), self.time, geometry.variants())
        return geometry


@dataclass
class _Read:
    """The scene at one time."""

    context: object
    tables: dict
    parts: dict = field(default_factory=dict)
    """(table, number of the place in it, or None) by part."""

    def __post_init__(self):
        for table in (*self.context.shapes, *self.context.lights):
            source = self.context.sources.get(id(table))
            for number, key in enumerate(source.keys if source else ()):
                self.parts[key] = table, (number if "transforms" in table else None)

    def part(self, key):
        """The fields of a part, or None where it is not there."""
        table, number = self.parts.get(key, (None, None))
        if number is None:
            return table
        fields = table["shape"] | {"transform": table["transforms"][number]}
        return fields | ({"visible": table["visible"]} if "visible" in table else {})


def blurred(context, shutter, go_to, read):
    """Tables of the scene at `context`'s time, with keys for what moves while the shutter is open.

    `read`: function from a `Context` to its tables.
    """
    settings = context.settings
    camera = (settings.camera or context.scene.camera) if settings.view is None else None
    first = Moment(shutter.frame)
    context.motion = first
    own = _Read(context, read(context))
    steps = [source.steps for source in context.sources.values()]
    camera_steps = 0 if camera is None else motion_of(camera)[0]
    times = shutter.times(max([1, camera_steps, *steps]))
    used = set(context.files.used)
    reads = {shutter.frame: own}

    def read_at(time, **how):
        # The camera of the frame, even where another one takes over while the shutter is open.
        seen = camera and camera.original.evaluated_get(context.depsgraph)
        other = replace(
            context,
            scene=context.depsgraph.scene_eval,
            settings=replace(settings, camera=seen),
            slots={key: slot for key, slot in context.slots.items() if not slot.is_animated},
            motion=Moment(time, False, geometries=first.geometries, **how),
            names=Names(),
            media_names=Names(),
            **{name: type(getattr(context, name))() for name in GROWING},
        )
        return _Read(other, read(other))

    try:
        for time in times:
            if time != shutter.frame:
                go_to(time)
                reads[time] = read_at(time)
    finally:
        go_to(shutter.frame)
    if any(geometry.deforming and geometry.deforming.moves_at_all for geometry in first.geometries.values()):
        read_at(shutter.frame, is_again=True)
    for path in context.files.used - used:
        context.files.drop(path)
    tables = _Keys(shutter, reads).tables(camera_steps)
    if tables == own.tables:
        return own.tables
    frame = int(shutter.frame // 1)
    animation = {
        "frames": [frame, frame],
        "frame": frame if frame == shutter.frame else shutter.frame,
        "shutter": [shutter.opens, shutter.closes],
    }
    return {"image": tables.pop("image"), "render": tables.pop("render"), "animation": animation} | tables


# Fields of a context that a read fills.
GROWING = ["media", "materials", "shapes", "lights", "groups", "rules", "shown", "sources", "counts"]


class _Keys:
    """Makes one scene of those at several times."""

    def __init__(self, shutter, reads):
        self.shutter, self.reads = shutter, reads
        self.own = reads[shutter.frame]
        self.context = self.own.context
        self.replaced = set()

    def tables(self, camera_steps):
        """The tables at the frame's own time, with keys for what moves."""
        own = self.own.tables
        tables = dict(own)
        tables["camera"] = self._camera(own["camera"], camera_steps)
        for kind in ("media", "materials"):
            tables[kind] = {name: self._named(kind, name, table) for name, table in own[kind].items()}
        for kind in ("shapes", "lights"):
            tables[kind] = [self._part(table) for table in own[kind]]
        taken = repr(tables["shapes"])
        for path in self.replaced:
            if path not in taken:
                self.context.files.drop(path)
        return tables

    def _camera(self, own, steps):
        times = self.shutter.times(steps) if steps else []
        return self._over_time("the camera", times, [self.reads[time].tables["camera"] for time in times], own)

    def _named(self, kind, name, own):
        """Of a medium or a material."""
        source = self.context.sources.get(id(own))
        what = f"{'medium' if kind == 'media' else 'material'} '{name}'"
        times = self._times(1 if source is None else source.steps)
        return self._over_time(what, times, [self.reads[time].tables[kind].get(name) for time in times], own)

    def _times(self, steps):
        return self.shutter.times(steps) if steps else []

    def _part(self, own):
        """Of a shape or a light."""
        source = self.context.sources.get(id(own))
        times = self._times(1 if source is None else source.steps)
        if source is None or not times:
            return own
        what = f"'{own['name']}'"
        if "transforms" in own:
            places = [self._places(what, times, key, steps) for key, steps in zip(source.keys, own["transforms"])]
            table = own | {"transforms": keys(times, [list(at_time) for at_time in zip(*places)])}
            return self._deforming(what, source, times, table, table["shape"])
        table = self._over_time(what, times, [self.reads[time].part(source.keys[0]) for time in times], own)
        if source.within is not None and table["transform"] != own["transform"]:
            table = table | {"transform": _around(table["transform"], source.within)}
        return self._deforming(what, source, times, table, table)

    def _places(self, what, times, key, own):
        """Transforms of one of the instances at these times."""
        moved = self._over_time(
            what, times, [(part := self.reads[time].part(key)) and {"transform": part["transform"]} for time in times],
            {"transform": own},
        )["transform"]
        return [steps for _, steps in moved["keys"]] if isinstance(moved, dict) else [moved] * len(times)

    def _over_time(self, what, times, values, own):
        if not times:
            return own
        report = self.context.report
        if any(value is None for value in values):
            report.note(f"{what} comes or goes while the shutter is open: it stands still")
            return own
        # Names and files are those of the frame's own time.
        kept = {name: own[name] for name in ("name", "file") if name in own}
        values = [value if value is own else value | kept for value in _lit(values)]
        finer, filled = turning(times, values)
        index = finer.index(self.shutter.frame)

        def tell(field):
            report.note(
                f"{what}: how {field or 'it'} changes while the shutter is open has nothing between: it is as at the "
                "frame's own time"
            )

        merged = over_time(finer, filled, index, tell)
        return own if merged == own else merged

    def _deforming(self, what, source, times, table, inner):
        """With the files of a mesh whose vertices move."""
        deforming = source.geometry and source.geometry.deforming
        if not deforming or not source.deforms:
            return table
        if deforming.has_other_polygons:
            self.context.report.note(f"{what} has other polygons at other times: its shape is not blurred")
            return table
        if not deforming.moves:
            return table
        paths = deforming.paths(self.context.files, source.variant, times, self.shutter.frame)
        if len(set(paths)) == 1:
            return table
        self.replaced.add(inner["file"])
        moved = on_its_way(times, paths)
        fields = {}
        for name, value in inner.items():
            fields |= moved if name == "file" else {name: value}
        return table | {"shape": fields} if inner is not table else fields


def _lit(tables):
    """Shapes that do not shine at some of the times shine with nothing there."""
    shining = [table for table in tables if "emission" in table]
    if not shining or len(shining) == len(tables):
        return tables
    if isinstance(shining[0]["emission"].get("radiance"), (dict, type(None))):
        return tables
    dark = shining[0]["emission"] | {"radiance": 0.0}
    return [table if "emission" in table else table | {"emission": dark} for table in tables]


def _around(transform, within):
    """The same keys, with the matrix that comes before the object's by itself: the object's is what is interpolated."""
    inverse = within.inverted()
    both = [
        [time, [matrix_step(within), matrix_step(Matrix(steps[0]["matrix"]) @ inverse)]]
        for time, steps in transform["keys"]
    ]
    return transform | {"keys": both}
