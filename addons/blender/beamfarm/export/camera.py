"""Cameras as `[camera]`."""

import math


def camera_table(context):
    """`[camera]` of the settings' view or camera object; None, and a line in the report, where it cannot be told."""
    settings = context.settings
    if settings.view is not None:
        return _from_view(settings.view, settings)
    return _from_object(settings.camera or context.scene.camera, context)


def _place(matrix):
    """Origin, target and up of a camera that looks along -z."""
    rotation = matrix.to_3x3()
    origin = matrix.translation
    forward = (rotation @ _vector(0, 0, -1)).normalized()
    up = (rotation @ _vector(0, 1, 0)).normalized()
    return {"origin": _list(origin), "target": _list(origin + forward), "up": _list(up)}


def _vector(*numbers):
    from mathutils import Vector

    return Vector(numbers)


def _list(vector):
    return [float(number) for number in vector]


def _size(settings):
    """Width and height of the image in units of its wider side, pixels counted by their aspect."""
    x, y = settings.width * settings.pixel_aspect[0], settings.height * settings.pixel_aspect[1]
    return x / max(x, y), y / max(x, y)


def _from_view(view, settings):
    table = _place(view.matrix_world)
    width, height = _size(settings)
    if view.is_orthographic:
        table |= {"type": "orthographic", "height": view.ortho_scale * height}
    else:
        table |= {"fov": math.degrees(view.fov), "fov_axis": "larger"}
    return table | _shift(view.shift, width, height)


def _shift(shift, width, height):
    """Blender's shift is in wider sides and moves what the camera sees; ours moves the image, in its own sides."""
    point = [-shift[0] / width, shift[1] / height]
    return {} if point == [0.0, 0.0] else {"principal_point": [number + 0.0 for number in point]}


def _from_object(camera, context):
    if camera is None or camera.type != "CAMERA":
        raise ValueError("the scene has no camera")
    data = camera.data
    view_angle, span = _lens(data, context.settings)
    table = _place(camera.matrix_world)
    if data.type == "PERSP":
        table |= {"fov": math.degrees(view_angle), "fov_axis": "x" if span == "x" else "y"}
    return table


def _lens(data, settings):
    width, height = _size(settings)
    fit = data.sensor_fit
    if fit == "AUTO":
        span, sensor = ("x" if width >= height else "y"), data.sensor_width
    elif fit == "HORIZONTAL":
        span, sensor = "x", data.sensor_width
    else:
        span, sensor = "y", data.sensor_height
    return 2.0 * math.atan(sensor / (2.0 * data.lens)), span
