"""What the scene file lacks compared with the Blender scene, and what it has in another form."""


class Report:
    """Two lists of lines, each line once, in order of occurrence."""

    def __init__(self):
        self._left_out = {}
        self._nothing = {}
        self._notes = {}

    def leave_out(self, what):
        """`what` is missing from the scene file."""
        self._left_out[f"left out: {what}"] = None

    def comes_to_nothing(self, name, why):
        """Nothing is visible of the object `name`. This rarely matters, so it comes after everything that is
        missing."""
        self._nothing[f"left out: object '{name}': {why}"] = None

    def note(self, what):
        """`what` is in the scene file, but not as in Blender."""
        self._notes[what] = None

    @property
    def left_out(self):
        return [*self._left_out, *self._nothing]

    @property
    def notes(self):
        return list(self._notes)
