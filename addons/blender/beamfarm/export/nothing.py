"""Objects that could be seen and of which nothing is, and why."""

# What has a surface is shown a second time, as the mesh that is made of it; and why there may be none.
MADE_OF_CURVES = {
    "CURVE": "no faces: a curve without bevel or extrusion",
    "SURFACE": "no faces",
    "FONT": "no faces: a text without letters or fill",
    "META": "no faces",
}


class Nothing:
    """Notes what the depsgraph shows, and tells what came to nothing when it has shown all."""

    def __init__(self):
        self._empty = {}
        self._seen = set()

    def is_made_of(self, object):
        """Whether it is one of which a mesh is made that is shown by itself."""
        if object.type not in MADE_OF_CURVES:
            return False
        self._empty.setdefault(_family(object), (object.name, MADE_OF_CURVES[object.type]))
        return True

    def see(self, object, instancer):
        """Takes what is something, and what makes it as an instance."""
        self._seen.add(_family(object))
        if instancer is not None:
            self._seen.add(_family(instancer))

    def add(self, placed, why):
        """Takes an object that comes to nothing at one of its places."""
        self._empty.setdefault(placed.uid, (placed.name, why))

    def tell(self, report):
        """What nothing was seen of at any place."""
        for family, (name, why) in self._empty.items():
            if family not in self._seen:
                report.comes_to_nothing(name, why)


def _family(object):
    """Metaballs whose names are alike but for the number after the dot are one surface."""
    original = object.original
    return original.name.partition(".")[0] if original.type == "META" else original.session_uid


def without_faces(mesh):
    """Why there is nothing of a mesh none of whose triangles has an area."""
    return "no face has an area" if len(mesh.polygons) else "no faces"
