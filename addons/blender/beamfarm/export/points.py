"""Point clouds as balls."""

import numpy as np

from .materials import slot, take
from .spaces import space_of
from .transforms import matrix_step


def add_points(placed, context):
    """Adds a point cloud: an instance of a ball for each point. Returns a reason if there is none."""
    object, points = placed.object, placed.object.data.points
    places = np.empty(3 * len(points), dtype=np.float32)
    radii = np.empty(len(points), dtype=np.float32)
    points.foreach_get("co", places)
    points.foreach_get("radius", radii)
    numbers = _numbers(object.data)[radii > 0.0]
    places = places.reshape(-1, 3)[radii > 0.0].astype(np.float64)
    radii = radii[radii > 0.0].astype(np.float64)
    if len(radii) == 0:
        return "no points with a radius"
    found = take(context, slot(context, object.material_slots[0].material if len(object.material_slots) else None))
    name = context.names.get(("object", placed.key), placed.name)
    context.show(placed, name)
    if found.emission is not None:
        context.report.leave_out(f"the light of the points of '{placed.name}'")
    if found.medium is not None:
        context.report.leave_out(f"the volume in the points of '{placed.name}'")
    ball = {"type": "sphere", "material": found.material}
    if found.is_boundary:
        ball["boundary"] = False
    if found.own:
        corners = [tuple(corner) for corner in object.bound_box]
        ball["space"] = space_of(placed, [[f(axis) for axis in zip(*corners)] for f in (min, max)])
    shape = {"name": name, "type": "instances"}
    if placed.visible is not None:
        shape["visible"] = placed.visible
    to_world = np.array(placed.matrix, dtype=np.float64)
    steps = np.tile(np.eye(4), (len(radii), 1, 1))
    steps[:, :3, :3] *= radii[:, None, None]
    steps[:, :3, 3] = places
    shape |= {"shape": ball, "transforms": [[matrix_step(to_world @ step)] for step in steps]}
    context.add_copies([(placed, int(number)) for number in numbers], shape, "point")
    return None


def _numbers(cloud):
    """What identifies each point at another time: its id, if it has one."""
    ids = cloud.attributes.get("id")
    if ids is None or ids.data_type != "INT" or ids.domain != "POINT":
        return np.arange(len(cloud.points))
    numbers = np.empty(len(cloud.points), dtype=np.int32)
    ids.data.foreach_get("value", numbers)
    return numbers
