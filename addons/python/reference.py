#!/usr/bin/env python3
"""Writes the second half of docs/python.md, the reference, from the package's docstrings: python reference.py [--check]

The package has to be importable. With --check it writes nothing, and fails if the page differs.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
import sys
from pathlib import Path
from typing import Any

import beamfarm

PAGE = Path(__file__).resolve().parents[2] / "docs" / "python.md"
MARK = "<!-- From here on: by addons/python/reference.py, of the docstrings. -->\n"

SECTIONS = {
    "Scenes": ["load", "Scene", "Mesh", "Grid", "Texture", "explain", "Explanation"],
    "Rendering": ["render", "reference", "passes", "pass_image", "Passes", "radius_scale", "average", "Progress"],
    "Images": ["Image", "Layers", "Bias", "Pass", "read", "compare", "Comparison", "Block"],
    "Farms": ["connect", "serve", "Farm", "Served", "program"],
    "Errors": [
        "BeamfarmError",
        "SceneError",
        "Fault",
        "ArgumentError",
        "RenderError",
        "OutOfMemoryError",
        "DeviceError",
        "FarmError",
        "ImageError",
        "SceneNote",
        "RenderInterrupted",
    ],
}


def plain(text: str) -> str:
    """A docstring as Markdown."""
    text = re.sub(r":(?:class|meth|func):`~?([^`]*)`", lambda found: f"`{found[1].removeprefix('beamfarm.')}`", text)
    text = text.replace("``", "`")
    lines = text.splitlines()
    out: list[str] = []
    for i, line in enumerate(lines):
        if set(line) == {"-"}:
            continue
        is_title = i + 1 < len(lines) and set(lines[i + 1]) == {"-"} and len(lines[i + 1]) > 2
        if is_title:
            out += [f"*{line}*", ""]
        elif line.startswith("    "):
            out.append(f"  {line.strip()}")
        elif line and is_entry(lines, i):
            name, _, kind = line.partition(" : ")
            described = f", {kind}" if kind else ""
            out.append(f"- {', '.join(f'`{one.strip()}`' for one in name.split(','))}{described}:")
        else:
            out.append(line)
    return "\n".join(out).strip()


def is_entry(lines: list[str], i: int) -> bool:
    """Whether this is a name whose description is indented below."""
    return i + 1 < len(lines) and lines[i + 1].startswith("    ")


def signature(value: Any) -> str:
    """How it is called."""
    try:
        found = str(inspect.signature(value))
    except (TypeError, ValueError):
        return "(...)"
    found = re.sub(r"(: |-> )'([^']*)'", r"\1\2", found)
    return found.replace(" -> None", "").replace("0.6666666666666666", "2/3")


def members(value: type[Any]) -> list[str]:
    """A class's own public members."""
    lines = []
    source = inspect.getsource(value)
    for name, member in vars(value).items():
        if name.startswith("_") and name not in ("__getitem__", "__call__"):
            continue
        doc = inspect.getdoc(member) if not isinstance(member, (int, str)) else None
        if isinstance(member, property):
            lines.append(f"- `.{name}`: {first(doc)}")
        elif inspect.isfunction(member) and doc:
            shown = signature(member).replace("(self, ", "(").replace("(self)", "()")
            call = {"__getitem__": "[index]", "__call__": shown}.get(name, f".{name}{shown}")
            lines.append(f"- `{call}`: {first(doc)}")
    # Fields of records, whose docstrings are below them.
    fields = getattr(value, "_fields", None) or (
        [field.name for field in dataclasses.fields(value)] if dataclasses.is_dataclass(value) else []
    )
    for name in fields:
        found = re.search(rf'^    {name}: [^\n]*\n    """(.*?)"""', source, re.M | re.S)
        lines.append(f"- `.{name}`: {first(found[1]) if found else ''}")
    own = re.findall(r'^        self\.([a-z]\w*)(?:: [^=\n]*)? = [^\n]*\n        """(.*?)"""', source, re.M | re.S)
    lines += [f"- `.{name}`: {first(text)}" for name, text in own]
    return [line for line in lines if not line.endswith(": ")]


def first(text: str | None) -> str:
    """Its first paragraph, as one line."""
    return plain(" ".join((text or "").split("\n\n")[0].split()))


def page() -> str:
    parts = []
    for title, names in SECTIONS.items():
        parts.append(f"## {title}\n")
        for name in names:
            value = getattr(beamfarm, name)
            is_class = inspect.isclass(value)
            is_record = is_class and (hasattr(value, "_fields") or dataclasses.is_dataclass(value))
            hides = is_class and (is_record or issubclass(value, (BaseException, dict)) or name in ("Layers", "Pass", "Image"))
            call = name if hides or name == "Served" else f"{name}{signature(value)}"
            parts.append(f"### {name}\n\n    {call}\n\n{plain(inspect.getdoc(value) or '')}\n")
            found = members(value) if is_class else []
            if found:
                parts.append("\n".join(found) + "\n")
    return "\n".join(parts)


def main() -> None:
    text = PAGE.read_text(encoding="utf-8")
    before, mark, old = text.partition(MARK)
    if not mark:
        sys.exit(f"{PAGE} lacks its mark")
    missing = set(beamfarm.__all__) - {name for names in SECTIONS.values() for name in names} - {"__version__"}
    if missing:
        sys.exit(f"names in no section: {', '.join(sorted(missing))}")
    new = "\n" + page()
    if "--check" in sys.argv:
        sys.exit(0 if new == old else f"{PAGE} is older than the docstrings: run addons/python/reference.py")
    PAGE.write_text(before + mark + new, encoding="utf-8")


if __name__ == "__main__":
    main()
