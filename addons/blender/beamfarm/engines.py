"""Which engine of the command renders: processors, or a GPU by Vulkan. Nothing here depends on Blender."""

from __future__ import annotations

CPU, GPU, AUTO = "CPU", "GPU", "AUTO"
AS_PREFERRED = "PREFERENCES"

ITEMS = (
    (CPU, "Processors", "All cores of this machine"),
    (GPU, "GPU", "A Vulkan device, if there is one and it can render the scene; otherwise processors, with a warning"),
    (AUTO, "Automatic", "Final renders measure which is better; the viewport uses the GPU if it can"),
)
ITEMS_OF_SCENES = ((AS_PREFERRED, "As in Preferences", "The setting for this machine"), *ITEMS)

# Exit codes with which the command refuses a request before the first pass.
_REFUSALS = (1, 2)


def chosen(own: str, preferred: str) -> str:
    """The engine of a scene, from its setting and that of the machine."""
    return preferred if own == AS_PREFERRED else own


def tries(engine: str, verb: str) -> list[list[str]]:
    """Options of `render`, `serve` or `live` for an engine, to be tried in turn, processors last."""
    by_gpu = ["--engine", "gpu"]
    if engine == GPU or (engine == AUTO and verb == "live"):
        return [by_gpu, []]
    if engine == AUTO and verb == "render":
        return [["--engine", "auto"]]
    # For other machines nothing is measured.
    return [[]]


def is_refusal(code: int | None) -> bool:
    """Whether the exit code says that the command has done nothing."""
    return code in _REFUSALS


def instead(words: str) -> str:
    """One line for the user: that processors render, and why."""
    lines = [line.strip() for line in words.splitlines() if line.strip()]
    return f"On processors: {' '.join(lines[:2]) or 'the GPU is not available'}"
