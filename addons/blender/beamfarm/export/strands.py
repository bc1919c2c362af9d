"""Hair: curves objects, and the strands of particle systems."""

import numpy as np

from .materials import slot, take
from .names import file_name
from .spaces import space_of
from .transforms import solid, steps

# Cycles' radius for points of curves without one.
RADIUS = 0.005
BOUNDARIES = {"dielectric", "rough_dielectric", "null"}


def add_curves(placed, context):
    """Adds a curves object. Returns why nothing of it is visible."""
    data = placed.object.data
    slots = placed.object.material_slots
    material = slots[0].material if len(slots) else None
    return _add(placed, context, ("curves", data.original.session_uid), material, lambda: _curves_of(data))


def add_hair(placed, context):
    """Adds the strands that an object's particle systems show. Returns whether there are any."""
    object, found = placed.object, False
    for number, system in enumerate(object.particle_systems):
        if system.settings.render_type != "PATH" or system.settings.type != "HAIR" or not _is_shown(object, system, context):
            continue
        slots = object.material_slots
        index = min(system.settings.material, len(slots)) - 1
        material = slots[index].material if index >= 0 else None
        key = ("hair", object.data.original.session_uid, number)
        matrix = placed.matrix
        why = _add(placed, context, key, material, lambda system=system: _strands_of(system, object, context))
        placed.matrix = matrix
        if why is not None:
            context.report.leave_out(f"the hair '{system.name}' of '{object.name}': {why}")
        found = found or why is None
    return found


def _is_shown(object, system, context):
    modifiers = [m for m in object.modifiers if m.type == "PARTICLE_SYSTEM" and m.particle_system.name == system.name]
    in_render = context.depsgraph.mode == "RENDER" or context.settings.view is None
    return all(m.show_render if in_render else m.show_viewport for m in modifiers)


def _add(placed, context, kind, material, read):
    placed.matrix = solid(placed.matrix)
    if placed.matrix is None:
        return "its scale makes it a line or a point"
    override = context.depsgraph.view_layer_eval.material_override
    found = slot(context, override or material)
    found = found.pane or found
    if found.table["type"] == "null":
        return "its material is only a volume" if found.medium is not None else "nothing of it is visible"
    if _has_inside(found.table, found.extra):
        return "its material is glass, which curves cannot have"
    if found.attribute is not None:
        return "its material uses attributes"
    # At other times it is as at the first.
    key = (placed.uid, kind[1], kind, placed.instancer)
    if key not in context.geometries:
        content = read()
        path = None if content is None else context.files.put("meshes", file_name(placed.name), ".ply", content)
        context.geometries[key] = path
    path = context.geometries[key]
    if path is None:
        return "no strands"
    context.files.use(path)
    found = take(context, found)
    for what, is_there in (("light", found.emission), ("volume", found.medium)):
        if is_there is not None:
            context.report.leave_out(f"the {what} of the strands of '{placed.name}'")
    if found.uv_map or found.own or _has_images([found.table, found.extra]):
        context.report.note(f"textures on the strands of '{placed.name}' lie along them")
    name = context.names.get(("object", placed.key, *kind), placed.name, *(() if kind[0] == "curves" else ("hair",)))
    context.show(placed, name)
    shape = {"name": name, "type": "curves", "file": path, "basis": _basis(context.scene), "material": found.material}
    if found.own:
        corners = [tuple(corner) for corner in placed.object.bound_box]
        shape["space"] = space_of(placed, [[f(axis) for axis in zip(*corners)] for f in (min, max)])
    if placed.visible is not None:
        shape["visible"] = placed.visible
    transform = steps(placed.matrix)
    if transform:
        shape["transform"] = transform
    context.add_shape(placed, shape, kind)
    return None


def _basis(scene):
    """The basis that Cycles uses for the points of curves."""
    settings = getattr(scene, "cycles_curves", None)
    return "linear" if getattr(settings, "shape", "") == "THICK_LINEAR" else "catmull_rom"


def _has_inside(table, others):
    if table["type"] == "blend":
        return any(_has_inside(others[name], others) for name in table["materials"])
    return table["type"] in BOUNDARIES or "spec_trans" in table


def _has_images(tables):
    if isinstance(tables, dict):
        return "image" in tables or any(map(_has_images, tables.values()))
    return isinstance(tables, list) and any(map(_has_images, tables))


def _curves_of(data):
    count = len(data.points)
    if count == 0:
        return None
    places = np.empty(3 * count, dtype=np.float32)
    data.attributes["position"].data.foreach_get("vector", places)
    radii = np.full(count, RADIUS, dtype=np.float32)
    radius = data.attributes.get("radius")
    if radius is not None and radius.domain == "POINT" and radius.data_type == "FLOAT":
        radius.data.foreach_get("value", radii)
    ends = np.empty(len(data.curves) + 1, dtype=np.int32)
    data.curve_offset_data.foreach_get("value", ends)
    return ply(places.reshape(-1, 3), radii, np.diff(ends))


def _strands_of(system, object, context):
    """Strands as Cycles reads them (`ObtainCacheParticleData` of its `blender/curves.cpp`)."""
    settings = system.settings
    in_render = context.depsgraph.mode == "RENDER"
    count = 2 ** (settings.render_step if in_render else settings.display_step) + 1
    if settings.kink == "SPIRAL":
        count += settings.kink_extra_steps
    parents, children = len(system.particles), len(system.child_particles)
    numbers = range(parents)
    if children:
        share = 1.0 if in_render else settings.display_percentage / 100.0
        children = int(children * share)
        numbers = range(parents if settings.child_type != "NONE" else 0, parents + children)
    if not len(numbers):
        return None
    places = np.empty((len(numbers), count, 3), dtype=np.float64)
    for i, number in enumerate(numbers):
        for step in range(count):
            places[i, step] = system.co_hair(object, particle_no=number, step=step)
    to_object = np.array(object.matrix_world.inverted_safe(), dtype=np.float64)
    places = places @ to_object[:3, :3].T + to_object[:3, 3]
    # The points of strands that are cut or absent coincide.
    ways = np.linalg.norm(np.diff(places, axis=1), axis=2)
    length = ways.sum(axis=1)
    is_there = np.isfinite(length) & (length > 0.0)
    places, ways, length = places[is_there], ways[is_there], length[is_there]
    if not len(places):
        return None
    along = np.concatenate([np.zeros((len(ways), 1)), np.cumsum(ways, axis=1)], axis=1) / length[:, None]
    radii = _radii(settings, np.clip(along, 0.0, 1.0))
    if settings.use_close_tip:
        radii[:, -1] = 0.0
    return ply(places.reshape(-1, 3), radii.ravel(), np.full(len(places), count))


def _radii(settings, along):
    root, tip = (0.5 * settings.radius_scale * radius for radius in (settings.root_radius, settings.tip_radius))
    shape, left = settings.shape, 1.0 - along
    if shape != 0.0:
        left = left ** (1.0 + shape if shape < 0.0 else 1.0 / max(1.0 - shape, 1e-6))
    return left * (root - tip) + tip


def ply(places, radii, lengths):
    """Bytes of a PLY file of curves with these numbers of points; those with fewer than two are left out."""
    if (lengths < 2).any():
        keep = np.repeat(lengths >= 2, lengths)
        places, radii, lengths = places[keep], radii[keep], lengths[lengths >= 2]
    if not len(lengths):
        return None
    rows = np.concatenate([places, np.maximum(radii, 0.0)[:, None]], axis=1).astype("<f4")
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(rows)}"]
    header += [f"property float {name}" for name in ("x", "y", "z", "radius")]
    header += [f"element curve {len(lengths)}", "property int vertices", "end_header", ""]
    return "\n".join(header).encode("ascii") + rows.tobytes() + lengths.astype("<i4").tobytes()
