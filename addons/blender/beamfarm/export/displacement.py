"""True displacement of meshes."""

import math

# Longer than any edge: the mesh keeps its vertices, as in Cycles without adaptive subdivision.
UNCUT = 1e9


def displacement(found, placed, context):
    """A shape's `displacement`, if its material has one."""
    if found.displacement is None:
        return {}
    fields = dict(found.displacement)
    if fields.pop("in_world"):
        # Lengths in object space are larger by this in the world.
        fields["scale"] /= max(abs(placed.matrix.to_3x3().determinant()) ** (1.0 / 3.0), 1e-12)
    fields["edge"] = placed.edge or UNCUT
    return {"displacement": fields}


def edge_of(object, matrix, context):
    """The target edge length if Cycles subdivides the object adaptively; None otherwise."""
    rate = _rate(object, context)
    camera = context.settings.view or context.settings.camera or context.scene.camera
    if rate is None or camera is None or getattr(camera, "type", "") != "CAMERA":
        return None
    if camera.data.type == "ORTHO":
        return rate * camera.data.ortho_scale / context.settings.width
    corners = [matrix @ _vector(corner) for corner in object.bound_box]
    low, high = ([f(axis) for axis in zip(*corners)] for f in (min, max))
    eye = camera.matrix_world.translation
    nearest = math.dist(eye, [min(max(x, a), b) for x, a, b in zip(eye, low, high)])
    # From inside its box the nearest distance is unknown.
    nearest = max(nearest, 0.05 * math.dist(low, high))
    return rate * nearest * 2.0 * math.tan(0.5 * camera.data.angle) / max(context.settings.width, context.settings.height)


def _rate(object, context):
    """The length of an edge in pixels."""
    last = object.modifiers[-1] if len(object.modifiers) else None
    if last is None or last.type != "SUBSURF":
        return None
    own = getattr(object, "cycles", None)
    is_adaptive = getattr(last, "use_adaptive_subdivision", getattr(own, "use_adaptive_subdivision", False))
    if not is_adaptive:
        return None
    rate = getattr(getattr(context.scene, "cycles", None), "dicing_rate", 1.0)
    return rate * getattr(last, "adaptive_pixel_size", getattr(own, "dicing_rate", 1.0))


def _vector(corner):
    from mathutils import Vector

    return Vector(corner)
