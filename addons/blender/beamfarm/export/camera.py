"""Cameras as `[camera]`."""

import math

from mathutils import Vector


class NoCamera(ValueError):
    """There is no camera, or one that the scene file cannot express."""


def camera_table(context):
    """`[camera]` for the settings' view or camera object."""
    settings = context.settings
    if settings.pixel_aspect[0] != settings.pixel_aspect[1]:
        context.report.leave_out("the pixels' aspect ratio: they are square")
    if settings.view is not None:
        return _from_view(settings.view, settings)
    camera = settings.camera or context.scene.camera
    if camera is None or camera.type != "CAMERA":
        raise NoCamera("the scene has no camera")
    if context.scene.render.use_multiview:
        context.report.leave_out("stereoscopy: only the camera's own view is written")
    return _from_object(camera.evaluated_get(context.depsgraph), context)


def _place(matrix):
    """Origin, target and up of a camera that looks along -z; the object's scale does not count."""
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
        table |= _parallel(view.ortho_scale, axis, settings)
    else:
        table |= {"fov": math.degrees(view.fov), "fov_axis": axis}
    if view.lens is not None:
        table |= _focus(view.lens)
    return table | _shift(view.shift, axis, settings)


def _parallel(scale, axis, settings):
    """An orthographic camera; `scale` is the length of the side `axis`."""
    width = scale if axis == "x" else scale * settings.width / settings.height
    return {"projection": "orthographic", "view_width": float(width)}


def _shift(shift, axis, settings):
    """Blender's shift is relative to the side that the lens spans, the scene file's to each side of the picture."""
    fitted = settings.width if axis == "x" else settings.height
    x, y = +shift[0] * fitted / settings.width, -shift[1] * fitted / settings.height
    return {} if x == 0.0 and y == 0.0 else {"principal_point": [float(x), float(y)]}


def _from_object(camera, context):
    data, settings = camera.data, context.settings
    if data.type not in ("PERSP", "ORTHO", "PANO"):
        raise NoCamera(f"camera '{camera.name}' is of the kind {data.type.lower()}: use a perspective one")
    if data.sensor_fit == "AUTO":
        axis, sensor = ("x" if settings.width >= settings.height else "y"), data.sensor_width
    elif data.sensor_fit == "HORIZONTAL":
        axis, sensor = "x", data.sensor_width
    else:
        axis, sensor = "y", data.sensor_height
    table = _place(camera.matrix_world)
    if data.type == "PANO":
        return table | _panorama(camera, axis, sensor, context)
    if data.type == "ORTHO":
        table |= _parallel(data.ortho_scale, axis, settings)
    else:
        table |= {"fov": math.degrees(2.0 * math.atan(sensor / (2.0 * data.lens))), "fov_axis": axis}
    lens = lens_of(camera, context.depsgraph)
    if lens is not None:
        table |= _focus(lens)
        if data.dof.aperture_blades > 2 or data.dof.aperture_ratio != 1.0:
            context.report.note(f"camera '{camera.name}': its aperture is round")
    # Only if they differ from the values of new cameras.
    if data.clip_start > 0.1001 or data.clip_end < 99.9:
        context.report.note(f"camera '{camera.name}': nothing is clipped, near or far")
    return table | _shift((data.shift_x, data.shift_y), axis, settings)


def _panorama(camera, axis, sensor, context):
    data, report = camera.data, context.report
    # Their place depends on Blender's version.
    own = data if hasattr(data, "panorama_type") else data.cycles
    if data.dof.use_dof:
        report.leave_out(f"depth of field of camera '{camera.name}': panoramas are in focus everywhere")
    if data.shift_x != 0.0 or data.shift_y != 0.0:
        report.leave_out(f"the shift of camera '{camera.name}', a panoramic one")
    if own.panorama_type == "EQUIRECTANGULAR":
        across, up = own.longitude_max - own.longitude_min, own.latitude_max - own.latitude_min
        if not (0.0 < across <= math.tau * 1.0001 and 0.0 < up <= math.pi * 1.0001):
            raise NoCamera(f"camera '{camera.name}' has longitudes or latitudes that are not on the sphere")
        x = 0.5 * (own.longitude_min + own.longitude_max) / across
        y = -0.5 * (own.latitude_min + own.latitude_max) / up
        table = {
            "projection": "equirectangular",
            "fov": min(math.degrees(across), 360.0),
            "vertical_fov": min(math.degrees(up), 180.0),
        }
        is_middle = abs(x) < 1e-6 and abs(y) < 1e-6
        return table if is_middle else table | {"principal_point": [float(x), float(y)]}
    if own.panorama_type == "FISHEYE_EQUIDISTANT":
        angle = min(math.degrees(own.fisheye_fov), 360.0)
        if angle < math.degrees(own.fisheye_fov) * 0.999:
            report.leave_out(f"what camera '{camera.name}' sees a second time, beyond 360 degrees")
        # As wide as the picture, and as high.
        return {"projection": "fisheye", "fov": angle, "vertical_fov": angle}
    if own.panorama_type == "FISHEYE_EQUISOLID":
        half = sensor / (4.0 * own.fisheye_lens)
        if half > 1.0:
            raise NoCamera(f"camera '{camera.name}' has a sensor larger than the image of the whole sphere: "
                           "use a longer lens")
        return {
            "projection": "fisheye",
            "mapping": "equisolid",
            "fov": math.degrees(4.0 * math.asin(half)),
            "fov_axis": axis,
            "image_circle": min(math.degrees(own.fisheye_fov), 360.0),
        }
    kind = own.panorama_type.lower().replace("_", " ")
    raise NoCamera(f"camera '{camera.name}' is panoramic ({kind}): use an equirectangular or fisheye one")


def _focus(lens):
    aperture, distance = lens
    return {"aperture": aperture, "focus_distance": distance}


def lens_of(camera, depsgraph):
    """(radius of the aperture, distance of the focal plane) in scene units; None if everything is in focus."""
    data, dof = camera.data, camera.data.dof
    if not dof.use_dof:
        return None
    fstop = max(dof.aperture_fstop, 1e-5)
    # Focal lengths are in millimetres; Cycles uses 1 for orthographic cameras.
    aperture = (1.0 if data.type == "ORTHO" else data.lens * 1e-3) / (2.0 * fstop)
    distance = dof.focus_distance
    if dof.focus_object is not None:
        matrix = camera.matrix_world
        focus = dof.focus_object.evaluated_get(depsgraph).matrix_world.translation
        forward = (matrix.to_3x3() @ Vector((0.0, 0.0, -1.0))).normalized()
        distance = abs((focus - matrix.translation).dot(forward))
    return float(aperture), max(float(distance), 1e-4)
