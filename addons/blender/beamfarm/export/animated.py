"""What may change over time."""


def is_animated(block):
    """Whether a light, world or material has keys or drivers: on itself, its nodes, or those of its groups."""
    if block is None:
        return False
    return getattr(block, "animation_data", None) is not None or _tree_is(getattr(block, "node_tree", None), set())


def _tree_is(tree, seen):
    if tree is None or tree.original.session_uid in seen:
        return False
    seen.add(tree.original.session_uid)
    if tree.animation_data is not None:
        return True
    return any(_tree_is(getattr(node, "node_tree", None), seen) for node in tree.nodes)
