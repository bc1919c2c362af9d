"""Evaluated meshes of objects, including those in Edit Mode."""

from contextlib import contextmanager


@contextmanager
def mesh_of(object):
    """The mesh of an evaluated object, for as long as the block lasts."""
    mesh = object.data
    if not mesh.is_editmode:
        yield mesh
        return
    # Until it is copied, Python sees no vertices, or no UV maps, of a mesh that is being edited through this object or
    # another one that shares it. Cycles copies it, too.
    try:
        yield object.to_mesh()
    finally:
        object.to_mesh_clear()
