"""Objects with a surface as `[[shapes]]`."""

from collections import defaultdict
from dataclasses import dataclass

from .displacement import displacement, edge_of
from .evaluated import mesh_of
from .geometry import Geometry
from .heights import grown
from .interiors import Interiors
from .materials import slot, take
from .nothing import without_faces
from .panes import Panes
from .spaces import is_deformed, space_of
from .transforms import matrix_step, solid, steps

# Up to this many copies of one mesh become separate shapes if their textures require it.
MOST = 1000


@dataclass
class Group:
    """One mesh with its materials, at one place or many."""

    placed: list
    geometry: Geometry
    slots: list
    """(index of the slot, `materials.Slot`) for the slots that have triangles."""


class Shapes:
    """Collects objects while the depsgraph shows them, and adds their shapes when all are known."""

    def __init__(self, context):
        self.context = context
        self.groups = {}
        self.panes = Panes()

    def add(self, placed):
        """Takes a mesh object at its place. Returns why nothing of it is visible, or None if something is."""
        placed.matrix = solid(placed.matrix)
        if placed.matrix is None:
            return "its scale makes it a line or a point"
        placed.edge = edge_of(placed.object, placed.matrix, self.context)
        data = placed.object.data
        placed.mesh = (placed.uid, data.original.session_uid, data.as_pointer(), placed.instancer)
        with mesh_of(placed.object) as mesh:
            slots = self._add_mesh(placed, mesh)
            return without_faces(mesh) if slots == [] else None

    def _add_mesh(self, placed, mesh):
        """Returns the slots that have triangles; None for what does not exist at the first of several times."""
        context, key, motion = self.context, placed.mesh, self.context.motion
        group = self.groups.get(key)
        if motion is not None and not motion.is_first:
            geometry = motion.known(context, placed, mesh)
            if geometry is None:
                return None
        else:
            geometry = context.geometries.get(key) if group is None else group.geometry
        if geometry is None:
            geometry = context.geometries[key] = Geometry(placed.name)
        if motion is not None and motion.is_first:
            motion.remember(context, placed, geometry)
        if group is not None:
            group.placed.append(placed)
            return group.slots
        geometry.hold(mesh)
        try:
            materials = [(index, _material(context, placed.object, mesh, index)) for index in geometry.slots()]
            slots = [(index, self._slot(placed, geometry, index, material)) for index, material in materials]
            if any("generated" in found.own for _, found in slots) and is_deformed(placed.object):
                context.report.note(f"generated coordinates of '{placed.name}' are those of its deformed mesh")
            group = Group([placed], geometry, slots)
            self._write(group)
            if motion is not None and motion.is_first and placed.deforms:
                geometry.may_move()
            self.groups[key] = group
            return slots
        finally:
            geometry.release()

    def _slot(self, placed, geometry, index, material):
        found = self._read(placed, geometry, material)
        if found.pane is not None and geometry.is_open(index):
            self.panes.add(found, placed.name)
            found = found.pane
        if found.grows:
            is_first = self.context.motion is None or self.context.motion.is_first
            found = grown(self.context, found, geometry.growth(index, placed, is_first))
        return take(self.context, found)

    def _read(self, placed, geometry, material):
        """The `Slot` of a material on an object, parts of which may be baked."""
        bakes = self.context.bakes
        if material is None or bakes is None:
            return slot(self.context, material)
        is_first = self.context.motion is None or self.context.motion.is_first
        if bakes.has_surface(placed, material) and (not is_first or bakes.is_alike(placed, geometry.vertex_of())):
            found = slot(self.context, material, placed)
        else:
            found = slot(self.context, material)
        bakes.ask(placed, material, found.wants)
        return found

    def _write(self, group):
        """Writes a group's files while its mesh is available."""
        context, geometry = self.context, group.geometry
        if any(found.medium is not None or found.is_boundary or found.is_beneath for _, found in group.slots):
            geometry.is_closed()
            geometry.triangles()
        for index, found in group.slots:
            if found.emission is not None:
                geometry.is_closed()
                geometry.triangles()
            geometry.file(context.files, *_variant(group, index, found))

    def finish(self):
        """Adds all shapes and their media."""
        self.panes.tell(self.context.report)
        interiors = Interiors(self.context, self.groups.values())
        for group in self.groups.values():
            for index, found in group.slots:
                self._add(group, index, found, interiors)

    def _add(self, group, index, found, interiors):
        context = self.context
        if found.table["type"] == "null" and found.emission is None and found.medium is None:
            return
        file = group.geometry.file(context.files, *_variant(group, index, found))
        plain = []
        by_look = defaultdict(list)
        for placed in group.placed:
            if found.emission is not None or placed.instancer is None or self._is_alone(group, found):
                plain.append(placed)
                continue
            media = interiors.fields(group, found, placed)
            by_look[repr(media)].append((placed, media))
        for entries in by_look.values():
            if len(entries) == 1:
                plain.append(entries[0][0])
            else:
                self._instances(group, index, found, file, entries)
        for placed in plain:
            name = self._name(placed)
            media = interiors.fields(group, found, placed)
            shape = {"name": name, "type": "mesh", "file": file} | _look(found) | media
            shape |= displacement(found, placed, self.context)
            if found.is_beneath and len(group.slots) > 1 and group.geometry.is_closed():
                # A part of a closed mesh: light enters through one material and leaves through another.
                shape["open"] = True
            if found.own:
                shape["space"] = space_of(placed, group.geometry.box)
            if found.emission is not None:
                shape["emission"] = found.emission | ({"two_sided": True} if self._shines_inside(group, placed) else {})
            if placed.visible is not None:
                shape["visible"] = placed.visible
            transform = steps(placed.matrix)
            if transform:
                shape["transform"] = transform
            source = {"geometry": group.geometry, "variant": _variant(group, index, found)}
            context.add_shape(placed, shape, ("mesh", index), **source)

    def _is_alone(self, group, found):
        """Whether each copy must be a separate shape because its textures use its own coordinates."""
        if not found.own:
            return False
        if len(group.placed) <= MOST:
            return True
        self.context.report.leave_out(f"separate coordinates for the {len(group.placed)} copies of "
                                      f"'{group.placed[0].name}': their textures use those of the first")
        return False

    def _shines_inside(self, group, placed):
        """Whether an emitter shines on both sides, as all do in Cycles: not if nobody can see the inside."""
        if not group.geometry.is_closed():
            return True
        points, _ = group.geometry.triangles()
        low, high = points.min(0), points.max(0)
        inverse = placed.matrix.inverted_safe()
        there = [inverse @ place for other, place in self._places() if other is not placed]
        return any(all(low[i] < point[i] < high[i] for i in range(3)) for point in there)

    def _places(self):
        """(`Placed`, position) for all places, and for the camera with None."""
        settings = self.context.settings
        camera = settings.view or (settings.camera or self.context.scene.camera)
        places = [(placed, placed.matrix.translation) for group in self.groups.values() for placed in group.placed]
        return places if camera is None else [*places, (None, camera.matrix_world.translation)]

    def _instances(self, group, index, found, file, entries):
        context = self.context
        first, media = entries[0]
        shape = {"name": self._name(first), "type": "instances"}
        if first.visible is not None:
            shape["visible"] = first.visible
        shape["shape"] = {"type": "mesh", "file": file} | _look(found) | media | displacement(found, first, context)
        if found.own:
            shape["shape"]["space"] = space_of(first, group.geometry.box)
        shape["transforms"] = [[matrix_step(placed.matrix)] for placed, _ in entries]
        source = {"geometry": group.geometry, "variant": _variant(group, index, found)}
        context.add_copies([(placed, index) for placed, _ in entries], shape, "mesh", **source)

    def _name(self, placed):
        """All slots of an object at one place share a name, and so do all instances."""
        key = ("object", placed.key if placed.instancer is None else placed.mesh)
        name = self.context.names.get(key, placed.name)
        self.context.show(placed, name)
        return name


def _look(found):
    return {} if found.material is None else {"material": found.material}


def _variant(group, index, found):
    return (None if len(group.slots) == 1 else index), found.uv_map, found.attribute


def _material(context, object, mesh, index):
    override = context.depsgraph.view_layer_eval.material_override
    if override is not None:
        return override
    slots = object.material_slots
    # An index beyond the last slot counts as the last one, as in Blender.
    if len(slots):
        return slots[min(index, len(slots) - 1)].material
    materials = mesh.materials
    return materials[min(index, len(materials) - 1)] if len(materials) else None
