"""Objects that should be visible but are not, and why."""

# Objects that have a surface appear a second time, as the mesh made of them; and why there may be none.
MADE_OF_CURVES = {
    "CURVE": "no faces: a curve without bevel or extrusion",
    "SURFACE": "no faces",
    "FONT": "no faces: a text without letters or fill",
    "META": "no faces",
}


class Nothing:
    """Records what the depsgraph shows, and reports at the end which objects came to nothing."""

    def __init__(self):
        self._empty = {}
        self._seen = set()

    def is_made_of(self, object):
        """Whether it is an object whose mesh appears separately."""
        if object.type not in MADE_OF_CURVES:
            return False
        self._empty.setdefault(_family(object), (object.name, MADE_OF_CURVES[object.type]))
        return True

    def see(self, object, instancer):
        """Records a visible object and its instancer."""
        self._seen.add(_family(object))
        if instancer is not None:
            self._seen.add(_family(instancer))

    def add(self, placed, why):
        """Records an object that comes to nothing at one of its places."""
        self._empty.setdefault(placed.uid, (placed.name, why))

    def tell(self, report):
        """Reports objects that are visible at no place."""
        for family, (name, why) in self._empty.items():
            if family not in self._seen:
                report.comes_to_nothing(name, why)


def _family(object):
    """Metaballs whose names differ only in the number after the dot form one surface."""
    original = object.original
    return original.name.partition(".")[0] if original.type == "META" else original.session_uid


def without_faces(mesh):
    """Why nothing is visible of a mesh none of whose triangles has an area."""
    return "no face has an area" if len(mesh.polygons) else "no faces"
