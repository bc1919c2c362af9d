"""Bumps whose heights are lengths in object space, like displacement: they grow with the object's scale."""

from dataclasses import replace

import numpy as np


def growth(arrays, slot, matrix):
    """The factor by which lengths along the normals of a slot's triangles grow, to three digits: the mean over their
    area."""
    turn = np.array(matrix.to_3x3(), dtype=np.float64)
    corners = arrays.positions[arrays.vertex_of[arrays.corners[arrays.slots == slot]]].astype(np.float64)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    if not areas.sum() > 0.0:
        return 1.0
    normals = normals[areas > 0.0] / areas[areas > 0.0, None]
    # A normal n becomes N = M^-T n, normalised, and its image M n reaches 1 / |M^-T n| along N.
    along = 1.0 / np.linalg.norm(normals @ np.linalg.inv(turn), axis=1)
    return float(f"{np.average(along, weights=areas[areas > 0.0]):.3g}")


def grown(context, found, factor):
    """A `materials.Slot` with bumps higher by this factor."""
    if factor == 1.0:
        return found
    names = {
        name: context.material_names.get((name, factor), f"{name} at {factor:g}")
        for name in (found.material, *found.extra)
    }

    def higher(bump):
        # Displacement lies below all bumps.
        if "over" in bump:
            return bump | {"over": higher(bump["over"])}
        return bump | {"scale": bump["scale"] * factor}

    def table_of(table):
        table = dict(table)
        for name in ("bump", "coat_bump"):
            if name in table:
                table[name] = higher(table[name])
        if "materials" in table:
            table["materials"] = [names[part] for part in table["materials"]]
        return table

    extra = {names[name]: table_of(table) for name, table in found.extra.items()}
    return replace(found, material=names[found.material], table=table_of(found.table), extra=extra)
