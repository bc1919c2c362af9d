"""Cameras as `[camera]`."""

import math

from mathutils import Vector


class NoCamera(ValueError):
    """There is no camera, or one that the scene file has no word for."""


def camera_table(context):
    """`[camera]` of the settings' view or camera object."""
    settings = context.settings
    if settings.pixel_aspect[0] != settings.pixel_aspect[1]:
        context.report.leave_out("the pixels' aspect ratio: they are square")
    if settings.view is not None:
        return _from_view(settings.view, settings)
    camera = settings.camera or context.scene.camera
    if camera is None or camera.type != "CAMERA":
        raise NoCamera("the scene has no camera")
    return _from_object(camera.evaluated_get(context.depsgraph), context)


def _place(matrix):
    """Origin, target and up of a camera that looks along -z; a scale of the object does not count."""
    rotation = matrix.to_3x3()
    origin = matrix.translation
    forward = (rotation @ Vector((0.0, 0.0, -1.0))).normalized()
    up = (rotation @ Vector((0.0, 1.0, 0.0))).normalized()
    return {"origin": _list(origin), "target": _list(origin + forward), "up": _list(up)}


def _list(vector):
    return [float(number) for number in vector]


def _from_view(view, settings):
    table = _place(view.matrix_world)
    axis = "x" if settings.width >= settings.height else "y"
    if view.is_orthographic:
        raise NoCamera("an orthographic view: take a perspective one")
    table |= {"fov": math.degrees(view.fov), "fov_axis": axis}
    return table | _shift(view.shift, axis, settings)


def _shift(shift, axis, settings):
    """Blender's shift is in lengths of the side that the lens spans, the scene file's in the picture's own."""
    fitted = settings.width if axis == "x" else settings.height
    x, y = +shift[0] * fitted / settings.width, -shift[1] * fitted / settings.height
    return {} if x == 0.0 and y == 0.0 else {"principal_point": [float(x), float(y)]}


def _from_object(camera, context):
    data, settings = camera.data, context.settings
    if data.type == "PANO":
        kind = data.panorama_type.lower().replace("_", " ") if hasattr(data, "panorama_type") else "panorama"
        raise NoCamera(f"camera '{camera.name}' is a panoramic one ({kind}): take a perspective one")
    if data.type == "ORTHO":
        raise NoCamera(f"camera '{camera.name}' is an orthographic one: take a perspective one")
    if data.type != "PERSP":
        raise NoCamera(f"camera '{camera.name}' is of the kind {data.type.lower()}: take a perspective one")
    if data.sensor_fit == "AUTO":
        axis, sensor = ("x" if settings.width >= settings.height else "y"), data.sensor_width
    elif data.sensor_fit == "HORIZONTAL":
        axis, sensor = "x", data.sensor_width
    else:
        axis, sensor = "y", data.sensor_height
    table = _place(camera.matrix_world)
    table |= {"fov": math.degrees(2.0 * math.atan(sensor / (2.0 * data.lens))), "fov_axis": axis}
    if data.dof.use_dof:
        table |= _focus(camera, data, context)
    defaults = data.bl_rna.properties
    for name in ("clip_start", "clip_end"):
        if getattr(data, name) != defaults[name].default:
            context.report.note(f"camera '{camera.name}': {name} does not count, nothing is clipped")
    return table | _shift((data.shift_x, data.shift_y), axis, settings)


def _focus(camera, data, context):
    dof = data.dof
    if dof.aperture_blades > 2 or dof.aperture_ratio != 1.0:
        context.report.note(f"camera '{camera.name}': its aperture is round")
    fstop = max(dof.aperture_fstop, 1e-5)
    # Focal lengths are millimetres.
    aperture = data.lens * 1e-3 / (2.0 * fstop)
    distance = dof.focus_distance
    if dof.focus_object is not None:
        matrix = camera.matrix_world
        focus = dof.focus_object.evaluated_get(context.depsgraph).matrix_world.translation
        forward = (matrix.to_3x3() @ Vector((0.0, 0.0, -1.0))).normalized()
        distance = abs((focus - matrix.translation).dot(forward))
    return {"aperture": float(aperture), "focus_distance": max(float(distance), 1e-4)}
