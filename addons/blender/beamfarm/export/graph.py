"""Paths through node trees: through reroutes, groups and muted nodes, to the node that a socket's value comes from."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Place:
    """A socket, and the group nodes that contain its tree, the outermost first."""

    socket: object
    groups: tuple = ()

    @property
    def node(self):
        return self.socket.node

    def input(self, name):
        """Input of this socket's node, by name; None if it has no such input or hides it."""
        found = find(self.node.inputs, name)
        return None if found is None else Place(found, self.groups)

    def output(self, name):
        found = find(self.node.outputs, name)
        return None if found is None else Place(found, self.groups)


def find(sockets, name):
    return next((socket for socket in sockets if socket.name == name and socket.enabled), None)


def follow(place):
    """The source of an input's value: a node's output, or an unlinked input.

    None if a loop or an empty group is in the way.
    """
    for _ in range(1000):
        socket, groups = place.socket, place.groups
        if not socket.is_output:
            link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
            if link is None:
                return place
            place = Place(link.from_socket, groups)
            continue
        node = socket.node
        if node.mute:
            through = next((link for link in node.internal_links if link.to_socket == socket), None)
            if through is None:
                return place
            place = Place(through.from_socket, groups)
        elif node.type == "REROUTE":
            place = Place(node.inputs[0], groups)
        elif node.type == "GROUP":
            if node.node_tree is None:
                return None
            output = group_output(node.node_tree)
            inner = output and _by_identifier(output.inputs, socket.identifier)
            if inner is None:
                return None
            place = Place(inner, (*groups, node))
        elif node.type == "GROUP_INPUT":
            if not groups:
                return None
            outer = _by_identifier(groups[-1].inputs, socket.identifier)
            if outer is None:
                return None
            place = Place(outer, groups[:-1])
        else:
            return place
    return None


def _by_identifier(sockets, identifier):
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def group_output(tree):
    outputs = [node for node in tree.nodes if node.type == "GROUP_OUTPUT"]
    return next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)


def output_node(tree, kind):
    """The output node that Cycles uses: an active one for Cycles, or for every renderer."""
    outputs = [node for node in tree.nodes if node.bl_idname == kind and node.target in ("ALL", "CYCLES")]
    outputs.sort(key=lambda node: (not node.is_active_output, node.target != "CYCLES"))
    return outputs[0] if outputs else None
