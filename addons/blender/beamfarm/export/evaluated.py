"""Evaluated meshes of objects, those in Edit Mode as well."""

from contextlib import contextmanager


@contextmanager
def mesh_of(object):
    """The mesh of an evaluated object, for as long as the block lasts."""
    mesh = object.data
    if not mesh.is_editmode:
        yield mesh
        return
    # What is edited, by this object or by another that shares it, shows Python no vertices, or none of its UV maps,
    # before it is copied, as Cycles does as well.
    try:
        yield object.to_mesh()
    finally:
        object.to_mesh_clear()
