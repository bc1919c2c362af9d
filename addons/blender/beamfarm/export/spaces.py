"""What textures in an object's own coordinates need to know about it: `space` of a shape."""

# What other objects do not share.
OWN = {"generated", "object", "normal", "object_info"}


def reached(tables, textures):
    """Names of the textures that tables use, directly or through other textures."""
    found = {}
    waiting = [tables]
    while waiting:
        entry = waiting.pop()
        if isinstance(entry, dict):
            name = entry.get("texture")
            if isinstance(name, str) and name in textures and name not in found:
                found[name] = textures[name]
                waiting.append(textures[name])
            waiting.extend(entry.values())
        elif isinstance(entry, list):
            waiting.extend(entry)
    return {name: table for name, table in textures.items() if name in found}


def own_of(tables):
    """What graph nodes and tangents in it require of their object: "object_info" and coordinates."""
    if isinstance(tables, dict):
        node = tables.get("node")
        asked = tables.get("of") if node == "coordinates" else node
        own = {asked} if asked in OWN else set()
        if str(tables.get("tangent", "")).startswith("around"):
            own.add("generated")
        return own.union(*map(own_of, tables.values()))
    return set().union(*map(own_of, tables)) if isinstance(tables, list) else set()


def is_deformed(object):
    """Whether modifiers or shape keys may have moved its vertices, which Blender's generated coordinates ignore."""
    keys = getattr(object.data, "shape_keys", None)
    return keys is not None or any(modifier.type in DEFORMING and modifier.show_render for modifier in object.modifiers)


DEFORMING = {"ARMATURE", "CAST", "CLOTH", "CORRECTIVE_SMOOTH", "CURVE", "DISPLACE", "HOOK", "LAPLACIANDEFORM",
             "LAPLACIANSMOOTH", "LATTICE", "MESH_DEFORM", "SHRINKWRAP", "SIMPLE_DEFORM", "SMOOTH", "SOFT_BODY",
             "SURFACE_DEFORM", "VOLUME_DISPLACE", "WARP", "WAVE"}


def space_of(placed, box):
    """`space` of an object at a place; `box`: Blender's texture space, (lowest, highest) in object coordinates."""
    return {
        "matrix": to_object(placed),
        "box": [list(corner) for corner in box],
        "random": (placed.random & WORD) / WORD,
        "index": placed.index,
        "location": [float(number) for number in placed.matrix.translation],
    }


WORD = 0xFFFFFFFF


def random_of(name):
    """The 32 bits that Cycles gives to an object that is no instance: hashes of its name and of 0."""
    key = 0
    for byte in name.encode():
        key = (key * 37 + byte) & WORD
    return _mixed(key, 0)


def _mixed(first, second):
    """Bob Jenkins' lookup3 of two words (http://burtleburtle.net/bob/c/lookup3.c, public domain)."""
    a = b = c = 0xDEADBEEF + (2 << 2) + 13
    a, b = (a + first) & WORD, (b + second) & WORD

    def turned(word, by):
        return (word << by | word >> (32 - by)) & WORD

    words = [c, b, a]
    # c by b, a by c, b by a, and so on.
    for step, by in enumerate((14, 11, 25, 16, 4, 14, 24)):
        changed, other = ((0, 1), (2, 0), (1, 2))[step % 3]
        words[changed] = ((words[changed] ^ words[other]) - turned(words[other], by)) & WORD
    return words[0]


def to_object(placed):
    """Rows of the matrix from the world to an object's coordinates."""
    # With 0 in place of -0.
    rows = [[float(number) + 0.0 for number in row] for row in placed.matrix.inverted_safe()]
    rows[3] = [0.0, 0.0, 0.0, 1.0]
    return rows


class Volume:
    """Coordinates for textures of a volume: they are evaluated only in world space, with the object's matrix."""

    def __init__(self, placed, box):
        self.name = placed.name
        self.key = placed.key
        self.to_object = to_object(placed)
        low, high = box
        # Generated coordinates go from 0 to 1 through the box.
        scale = [1.0 / (b - a) if b > a else 0.0 for a, b in zip(low, high)]
        self.to_generated = [
            [scale[i] * number - (scale[i] * low[i] if column == 3 else 0.0) for column, number in enumerate(row)]
            for i, row in enumerate(self.to_object[:3])
        ] + [[0.0, 0.0, 0.0, 1.0]]

    def coordinates(self, of):
        world = {"node": "coordinates", "of": "world"}
        matrix = {"generated": self.to_generated, "object": self.to_object}.get(of)
        return world if matrix is None else {"node": "transform", "vector": world, "matrix": matrix}
