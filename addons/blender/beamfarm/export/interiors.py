"""Media inside and outside shapes.

Cycles adds up all volumes that contain a point; the scene file names the medium on either side of each boundary.
"""

from dataclasses import replace

import numpy as np

from .media import sum_of
from .records import Graphs
from .spaces import Volume

# Cells along the longest side of the grid on which a textured density is sampled.
RESOLUTION = 128

class Interiors:
    """Finds the closed meshes with a volume that contain each shape."""

    def __init__(self, context, groups):
        self.context = context
        self.volumes = []
        self.any = context.world_medium is not None
        self._trees = {}
        for group in groups:
            for _, found in group.slots:
                if found.medium is None:
                    continue
                self.any = True
                if group.geometry.is_closed() and len(group.slots) == 1:
                    self.volumes += [(placed, group, found) for placed in group.placed]

    def fields(self, group, found, placed):
        """`interior`, `exterior` and `boundary` of a shape."""
        if not found.is_boundary or not self.any:
            return {}
        medium = found.medium
        if medium is None:
            # Glass without its own volume is filled with its surroundings.
            return {"boundary": False}
        report, name = self.context.report, placed.name
        if medium.grid is not None and not medium.grid_is_optional:
            report.leave_out(f"the volume of '{name}', whose density is an attribute of a mesh: '{medium.grid}'")
            return {"boundary": False}
        if medium.glow is not None and medium.glow.grid is not None:
            report.leave_out(f"what the volume of '{name}' emits by an attribute of a mesh: '{medium.glow.grid}'")
            medium = replace(medium, glow=None)
        if len(group.slots) > 1:
            report.leave_out(f"the volume of '{name}', which has more than one material")
            return {"boundary": False}
        outside = self.context.world_medium
        around = []
        for other, other_group, other_found in self.volumes:
            if other is placed:
                continue
            inside = self._share_inside(placed, group, other, other_group)
            if 0.0 < inside < 1.0 and self.context.world_medium is not None:
                report.note(
                    f"the volumes of '{name}' and '{other.name}' overlap: where both are, that of the world counts twice"
                )
            if inside == 1.0:
                around.append((other, other_group, other_found))
        # A textured density cannot be added to another.
        shaded = next((entry for entry in around if entry[2].medium.is_shaded()), None)
        if shaded is not None:
            exterior = self._shaded(*shaded)
        elif around:
            for _, _, one in around:
                outside = sum_of(outside, one.medium)
            exterior = medium_name(self.context, outside, f"around {placed.name}")
        if medium.is_shaded() or shaded is not None:
            if outside is not None or around:
                report.note(f"the volume of '{name}': the volumes around it are not added in it")
            inside = medium
        else:
            inside = sum_of(outside, medium)
        if medium.is_shaded():
            fields = {"interior": self._shaded(placed, group, found)}
        else:
            fields = {"interior": medium_name(self.context, inside, placed.name)}
        if around:
            fields["exterior"] = exterior
        if not group.geometry.is_closed():
            report.note(f"the volume of '{name}', whose mesh is not closed: light is inside once it has crossed it")
            fields["open"] = True
        return fields

    def _shaded(self, placed, group, found):
        """Name of a medium with a textured density or colour, sampled on a grid in the object's box."""
        context, medium = self.context, found.medium
        name = context.media_names.get(("shaded", placed.key), placed.name)
        if name in context.media:
            return name
        points, _ = group.geometry.triangles()
        turn = np.array(placed.matrix, dtype=np.float64)
        points = points.astype(np.float64) @ turn[:3, :3].T + turn[:3, 3]
        owner = (medium.texture or medium.albedo).owner
        graphs = Graphs(context, owner, Volume(placed, group.geometry.box))
        density, albedo = (
            shade and graphs.named(shade.value, found.material, placed.name, what)
            for shade, what in ((medium.texture, "density"), (medium.albedo, "albedo"))
        )
        density = density or {}
        low, high = points.min(0), points.max(0)
        density |= {"min": low.tolist(), "max": high.tolist(), "voxel": float((high - low).max()) / RESOLUTION}
        what = "density" if medium.albedo is None else "volume"
        context.report.note(f"the {what} of {owner} is sampled on a grid of {RESOLUTION} cells along its longest side")
        context.add_medium(placed, name, {"type": "heterogeneous"} | medium.table(albedo=albedo) | {"density": density})
        return name

    def _share_inside(self, placed, group, other, other_group):
        """Share of sampled vertices of a mesh that lie inside another mesh; 0 and 1 are exact for the samples."""
        from mathutils import Vector

        to_other = other.matrix.inverted_safe() @ placed.matrix
        points, _ = group.geometry.triangles()
        step = max(len(points) // 24, 1)
        chosen = [to_other @ Vector(point) for point in points[::step].tolist()]
        tree, low, high = self._tree(other_group)
        count = sum(
            all(low[i] <= point[i] <= high[i] for i in range(3)) and _is_inside(tree, point) for point in chosen
        )
        return count / len(chosen) if chosen else 0.0

    def _tree(self, group):
        from mathutils.bvhtree import BVHTree

        if id(group) not in self._trees:
            points, triangles = group.geometry.triangles()
            tree = BVHTree.FromPolygons(points.tolist(), triangles.tolist(), all_triangles=True)
            self._trees[id(group)] = tree, points.min(0).tolist(), points.max(0).tolist()
        return self._trees[id(group)]


def medium_name(context, medium, wanted):
    """Name of a homogeneous medium, which is added to the scene file's media."""
    name = context.media_names.get(medium, wanted)
    context.media.setdefault(name, {"type": "homogeneous"} | medium.table())
    return name


def _is_inside(tree, point):
    from mathutils import Vector

    # A direction parallel to no axis and no likely edge.
    direction = Vector((0.5377, 0.6135, 0.5783))
    crossings = 0
    for _ in range(256):
        hit, _, _, distance = tree.ray_cast(point, direction)
        if hit is None:
            break
        crossings += 1
        point = hit + direction * max(1e-6 * max(distance, 1.0), 1e-7)
    return crossings % 2 == 1
