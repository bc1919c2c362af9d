"""Merges readings of a scene at several times into one."""

from dataclasses import dataclass, field

from mathutils import Matrix

from .keys import keys, on_its_way, over_time, stepped, turning
from .transforms import matrix_step

ALL_RAYS = ["camera", "reflected", "refracted", "shadow", "photon"]
# The scale of instances that are absent.
GONE = 1e-4
# The duration of a cut from one camera to the next, frames.
CUT = 1e-3


@dataclass
class Read:
    """The scene at one time."""

    context: object
    tables: dict
    camera: object = None
    """The time."""
    parts: dict = field(default_factory=dict)
    """(table, number of the place in it, or None) by part."""

    def __post_init__(self):
        settings, scene = self.context.settings, self.context.scene
        camera = None if settings.view is not None else settings.camera or scene.camera
        self.camera = None if camera is None else camera.original.session_uid
        for table in (*self.context.shapes, *self.context.lights):
            source = self.context.sources.get(id(table))
            for number, key in enumerate(source.keys if source else ()):
                self.parts[key] = table, (number if "transforms" in table else None)

    def part(self, key):
        """The fields of a part, or None if it is absent."""
        table, number = self.parts.get(key, (None, None))
        if number is None:
            return table
        fields = table["shape"] | {"transform": table["transforms"][number]}
        return fields | ({"visible": table["visible"]} if "visible" in table else {})


class Merging:
    """Adds keys to the scene at a span's own time. `reads`: `Read` by time."""

    def __init__(self, span, reads):
        self.span, self.reads = span, reads
        self.own = reads[span.own]
        self.context = self.own.context
        self.report = self.context.report

    def tables(self, camera_steps):
        """The tables at the span's own time, with keys for what moves."""
        own = self.own.tables
        tables = dict(own)
        tables["camera"] = self._camera(own["camera"], camera_steps)
        for kind, word in (("textures", "texture"), ("media", "medium"), ("materials", "material")):
            tables[kind] = {name: self._named(kind, word, name) for name in self._names(kind)}
        for kind in ("shapes", "lights"):
            tables[kind] = [self._part(table) for table in own[kind]]
        return tables

    def _camera(self, own, steps):
        times = self.span.times(steps)
        tables = [self.reads[time].tables["camera"] for time in times]
        for k in range(len(times) - 1, 0, -1):
            if self.reads[times[k]].camera != self.reads[times[k - 1]].camera:
                cut = times[k] + self.span.opens
                between = [(cut - CUT, tables[k - 1])] + ([(cut, tables[k])] if cut < times[k] else [])
                times[k:k] = [time for time, _ in between]
                tables[k:k] = [table for _, table in between]
        return self._over_time("the camera", times, tables, own)

    def _names(self, kind):
        """Names of everything needed at any of the times."""
        reads = self.reads.values() if self.span.is_long else ()
        return dict.fromkeys([*self.own.tables[kind], *(name for read in reads for name in read.tables[kind])])

    def _named(self, kind, word, name):
        """The table of a medium or a material."""
        own = self.own.tables[kind].get(name)
        source = self.context.sources.get(id(own))
        times = self.span.times(1 if source is None else source.steps)
        tables = [self.reads[time].tables[kind].get(name) for time in times]
        if self.span.is_long:
            # Values at a time at which nothing uses it do not matter.
            tables = _filled(tables)
        return self._over_time(f"{word} '{name}'", times, tables, tables[0] if own is None else own)

    def _part(self, own):
        """The table of a shape or a light."""
        source = self.context.sources.get(id(own))
        times = self.span.times(1 if source is None else source.steps)
        if source is None or not times:
            return own
        what = f"'{own['name']}'"
        if "transforms" in own:
            places = [self._places(what, times, key, steps) for key, steps in zip(source.keys, own["transforms"])]
            table = own | {"transforms": keys(times, [list(at_time) for at_time in zip(*places)])}
            return self._deforming(what, source, times, table, table["shape"])
        parts = [self.reads[time].part(source.keys[0]) for time in times]
        if self.span.is_long and any(part is None for part in parts):
            parts = _hidden(parts)
        table = self._over_time(what, times, parts, own)
        if source.within is not None and isinstance(table["transform"], dict):
            table = table | {"transform": _around(table["transform"], source.within)}
        return self._deforming(what, source, times, table, table)

    def _places(self, what, times, key, own):
        """Transforms of one of the instances at these times."""
        parts = [self.reads[time].part(key) for time in times]
        if self.span.is_long and any(part is None for part in parts):
            self.report.note(f"{what}: copies are tiny while they are absent")
            parts = [there if part else _tiny(there) for part, there in zip(parts, _filled(parts))]
        places = [part and {"transform": part["transform"]} for part in parts]
        if any(place is None for place in places):
            self._say_that_it_comes_or_goes(what)
            return [own] * len(times)
        signs = {Matrix(place["transform"][0]["matrix"]).to_3x3().determinant() > 0.0 for place in places}
        if len(signs) > 1:
            self.report.note(f"{what}: a copy that is mirrored at some times does not move")
            return [own] * len(times)
        return [place["transform"] for place in places]

    def _over_time(self, what, times, values, own):
        if not times:
            return own
        if any(value is None for value in values):
            self._say_that_it_comes_or_goes(what)
            return own
        # Names and files are those of the span's own time.
        kept = {name: own[name] for name in ("name", "file") if name in own}
        values = [value if value is own else value | kept for value in _lit(values)]
        finer, filled = turning(times, values)
        index = finer.index(self.span.own)

        def otherwise(values, field):
            if self.span.is_long and field:
                return stepped(finer, values, self.span.opens)
            when = "in the first frame" if self.span.is_long else "at the frame's own time"
            self.report.note(f"{what}: how {field or 'it'} changes cannot be interpolated: it is as {when}")
            return values[index]

        merged = over_time(finer, filled, otherwise)
        return own if merged == own else merged

    def _say_that_it_comes_or_goes(self, what):
        self.report.note(f"{what} appears or disappears while the shutter is open: it does not move")

    def _deforming(self, what, source, times, table, inner):
        """Adds the files of a mesh whose vertices move."""
        deforming = source.geometry and source.geometry.deforming
        if not deforming or not source.deforms:
            return table
        files = self.context.files
        if deforming.has_other_polygons and not self.span.is_long:
            self.report.note(f"{what} has polygons that change over time: its shape is not blurred")
            return table
        if not deforming.moves:
            return table
        if deforming.has_other_polygons:
            if self.span.opens != self.span.closes:
                self.report.note(f"{what} has polygons that change over time: its shape is not blurred")
            paths = deforming.paths(files, source.variant, times, self.span.own)
            moved = {"file": stepped(times, paths, self.span.opens)}
        elif self.span.is_long:
            moved = {"file": deforming.sequence(files, source.variant, times, self.span.own)}
        else:
            moved = on_its_way(times, deforming.paths(files, source.variant, times, self.span.own))
            if moved["file"] == moved["toward"]["file"]:
                return table
        fields = {}
        for name, value in inner.items():
            fields |= moved if name == "file" else {name: value}
        return table | {"shape": fields} if inner is not table else fields


def _filled(values):
    """Missing values are the last ones before, or else the first ones after."""
    last = next((value for value in values if value is not None), None)
    filled = []
    for value in values:
        last = last if value is None else value
        filled.append(last)
    return filled


def _hidden(parts):
    """Makes shapes or lights invisible where they are absent."""
    filled = _filled(parts)
    return [
        there | {"visible": [] if part is None else part.get("visible", ALL_RAYS)}
        for part, there in zip(parts, filled)
    ]


def _tiny(part):
    matrix = Matrix(part["transform"][0]["matrix"]) @ Matrix.Diagonal((GONE, GONE, GONE, 1.0))
    return part | {"transform": [matrix_step(matrix)]}


def _lit(tables):
    """Shapes that emit only at some of the times emit zero at the others."""
    shining = [table for table in tables if "emission" in table]
    if not shining or len(shining) == len(tables):
        return tables
    if isinstance(shining[0]["emission"].get("radiance"), (dict, type(None))):
        return tables
    dark = shining[0]["emission"] | {"radiance": 0.0}
    return [table if "emission" in table else table | {"emission": dark} for table in tables]


def _around(transform, within):
    """The same keys, with the matrix that precedes the object's kept separate: only the object's is interpolated."""
    inverse = within.inverted()
    both = [
        [time, [matrix_step(within), matrix_step(Matrix(steps[0]["matrix"]) @ inverse)]]
        for time, steps in transform["keys"]
    ]
    return transform | {"keys": both}
