"""Volume objects, whose density is an OpenVDB file."""

import pathlib

from mathutils import Matrix, Vector

from .media import read_volume
from .names import file_name
from .transforms import matrix_step


def add_volume(placed, context):
    """Adds a volume object: a medium from its file in a box that contains it."""
    object, report = placed.object, context.report
    volume = object.data
    material = object.material_slots[0].material if len(object.material_slots) else None
    if material is None or not material.use_nodes:
        report.leave_out(f"volume '{object.name}', which has no material")
        return
    owner = f"material '{material.name}'"
    medium = read_volume(context, material.node_tree, "ShaderNodeOutputMaterial", owner)
    if medium is None:
        report.leave_out(f"volume '{object.name}', whose material has no volume")
        return
    if medium.texture is not None:
        report.leave_out(f"volume '{object.name}', whose density is a texture")
        return
    volume.grids.load()
    path = pathlib.Path(volume.grids.frame_filepath or "")
    if not path.is_file():
        report.leave_out(f"volume '{object.name}': there is no file '{path}'")
        return
    grids = [grid.name for grid in volume.grids]
    if medium.grid is not None and medium.grid not in grids:
        if not medium.grid_is_optional:
            report.leave_out(f"volume '{object.name}': its file has no grid '{medium.grid}'")
            return
        medium_grid = None
    else:
        medium_grid = medium.grid
    by_grid = medium.glow is not None and {medium.glow.grid, medium.glow.temperature} & set(grids)
    if medium_grid is None and not by_grid:
        report.leave_out(f"volume '{object.name}', whose material uses no grid of its file")
        return
    name = context.names.get(("object", placed.key), object.name)
    context.show(placed, name)
    file = context.files.copy("volumes", file_name(path.stem), ".vdb", path)
    # Coefficients are per length in object space, unless set otherwise.
    if volume.render.space == "OBJECT":
        length = (placed.matrix.to_3x3() @ Vector((1.0, 1.0, 1.0)).normalized()).length
        medium = medium.scaled(1.0 / length if length > 0.0 else 1.0)
    if context.world_medium is not None:
        report.note(f"volume '{object.name}': the world's medium is not in it")
    key = ("volume", placed.key)
    medium_name = context.media_names.get(key, object.name)
    table = medium.table(lambda grid: {"file": file, "grid": grid} if grid in grids else None)
    if medium_grid is None:
        table = {"type": "homogeneous"} | table
    else:
        table = {"type": "heterogeneous"} | table | {"density": {"file": file, "grid": medium_grid}}
    context.add_medium(placed, medium_name, table | {"transform": [matrix_step(placed.matrix)]})
    material_name = context.material_names.get(("boundary",), "boundary")
    context.materials[material_name] = {"type": "null"}
    corners = [Vector(corner) for corner in object.bound_box]
    low = Vector(min(corner[i] for corner in corners) for i in range(3))
    high = Vector(max(corner[i] for corner in corners) for i in range(3))
    # Slightly larger, so that its faces do not coincide with those of a fog cube around it.
    half = (high - low) * 0.5 * 1.0001
    box = Matrix.Translation((low + high) * 0.5) @ Matrix.Diagonal((*half, 1.0))
    shape = {"name": name, "type": "cube", "material": material_name, "interior": medium_name}
    if placed.visible is not None:
        shape["visible"] = placed.visible
    context.add_shape(placed, shape | {"transform": [matrix_step(placed.matrix @ box)]}, within=box)
