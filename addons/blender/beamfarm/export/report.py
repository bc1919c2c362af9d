"""What the scene file lacks of the Blender scene, and what stands in it in another form."""


class Report:
    """Two lists of lines, each line once, in the order in which they came up."""

    def __init__(self):
        self._left_out = {}
        self._nothing = {}
        self._notes = {}

    def leave_out(self, what):
        """`what` is missing in the scene file."""
        self._left_out[f"left out: {what}"] = None

    def comes_to_nothing(self, name, why):
        """Nothing is seen of the object `name`. That is rarely missed, and comes after all that is."""
        self._nothing[f"left out: object '{name}': {why}"] = None

    def note(self, what):
        """`what` stands in the scene file, but not as in Blender."""
        self._notes[what] = None

    @property
    def left_out(self):
        return [*self._left_out, *self._nothing]

    @property
    def notes(self):
        return list(self._notes)
