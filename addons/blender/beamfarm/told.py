"""What the last export of each scene left out or wrote in another form, for a panel, since few users read a console."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass
class Told:
    """Lines for the user."""

    left_out: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def text(self, scene: str) -> str:
        """All of it."""
        lines = [f"What beamfarm's picture of the scene {scene} lacks:", ""]
        lines += self.left_out or ["Nothing."]
        if self.notes:
            lines += ["", "What it shows in another form:", "", *self.notes]
        return "\n".join(lines) + "\n"


_of_scenes: dict[str, Told] = {}


def remember(scene: str, left_out: list[str], notes: list[str]) -> None:
    """Replaces what was known about this scene."""
    _of_scenes[scene] = Told(list(left_out), list(notes))


def of(scene: str) -> Told | None:
    """What is known about it; None before the first export."""
    return _of_scenes.get(scene)


def forget() -> None:
    """Forgets everything, because another file has been opened."""
    _of_scenes.clear()


def warning(left_out: list[str]) -> str:
    """One line for users who look at the render."""
    first = "; ".join(line.removeprefix("left out: ") for line in left_out[:3])
    more = len(left_out) - 3
    rest = f"; and {more} more, see Render Properties > Left Out" if more > 0 else ""
    return f"Left out: {first}{rest}"
