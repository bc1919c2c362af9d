"""Exports every .blend of a folder, and prints what is left out, and in how many files.

    PYTHON_WITH_BPY survey.py FOLDER… [--limit N] [--patience SECONDS] [--notes]

Each file is opened in a separate process, without running its scripts, and exported at its own frame and camera (a
camera is added if it has none); nothing is rendered, and nothing is written next to the file. First it prints the
number of files from which nothing is left out, and of those that lose only what cannot be shown: objects of which
Blender shows nothing either, and missing images and other files. Three tables follow, each line with the first file
concerned: what is left out, with names of objects and materials as "…", by the number of files and of lines; objects
of which nothing is seen, and why; files that cannot be read or exported, or take longer than the patience.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import tomllib
import traceback
from collections import Counter
from pathlib import Path

# A name in quotes; an apostrophe within a word does not end it.
_NAME = re.compile(r"(\w+ )?'((?:[^']|'(?=\w))*)'(?: \(([^)]*)\))?")
_NUMBER = re.compile(r"(?<![\w'])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_NOTHING = re.compile(r"object '.*?(?:'(?!\w): | of the kind )(.*)", re.DOTALL)

# Reasons why Blender shows nothing of an object either.
NOTHING_TO_SHOW = ("no face", "no points", "its scale makes")
_NOT_THERE = re.compile(r": image '.*' cannot be read|: no image$|there is no file '|which has no text$")


def kind_of(line: str) -> str:
    """A line of the list without what is specific to this file: names and numbers."""

    def without(match: re.Match) -> str:
        before, name, label = match.groups()
        if before == "node ":
            # The node's label identifies it; a different name does not.
            return f"node '{label or name}'"
        return f"{before or ''}'…'" + (f" ({label})" if label else "")

    return _NUMBER.sub("N", _NAME.sub(without, line.removeprefix("left out: ")))


def nothing_of(line: str) -> str | None:
    """From a line that says so, why nothing is seen of an object; None for others."""
    found = _NOTHING.fullmatch(line.removeprefix("left out: "))
    return found and found[1]


def can_be_shown(line: str) -> bool:
    """Whether a line is about something that is in the file and that Blender shows."""
    why = nothing_of(line)
    if why is not None:
        return not why.startswith(NOTHING_TO_SHOW)
    return not _NOT_THERE.search(line)


class Table:
    """Kinds of lines with the numbers of files and of lines, and the first file."""

    def __init__(self, title: str) -> None:
        self.title = title
        self.files: Counter[str] = Counter()
        self.lines: Counter[str] = Counter()
        self.first: dict[str, str] = {}

    def add(self, file: str, kinds: list[str]) -> None:
        """Takes the kinds of all lines of one file."""
        self.lines.update(kinds)
        self.files.update(set(kinds))
        for kind in kinds:
            self.first.setdefault(kind, file)

    def text(self) -> str:
        rows = sorted(self.files.items(), key=lambda row: (-row[1], -self.lines[row[0]], row[0]))
        lines = [f"{files:7} {self.lines[kind]:7}  {kind}  [{self.first[kind]}]" for kind, files in rows]
        return "\n".join([self.title, f"{'files':>7} {'lines':>7}", *(lines or ["      -"]), ""])


def export(path: Path, folder: Path) -> dict:
    """Exports one file into a folder, in this process. Returns what to print about it."""
    import bpy
    import compare

    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    if scene.camera is None:
        # Libraries of models lack nothing else; nothing is rendered.
        scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        scene.collection.objects.link(scene.camera)
    result = compare.export_scene(folder)
    shapes = len(tomllib.loads(result.text).get("shapes", []))
    return {"left_out": result.left_out, "notes": result.notes, "shapes": shapes}


def _in_a_child(path: Path, patience: float) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        command = [sys.executable, __file__, str(path), "--one", folder]
        try:
            done = subprocess.run(command, capture_output=True, text=True, errors="replace", timeout=patience)
        except subprocess.TimeoutExpired:
            return {"failed": f"not done after {patience:g} s"}
        if not answer.is_file():
            return {"failed": f"ended with {done.returncode}"}
        return json.loads(answer.read_text(encoding="utf-8"))


def _one(path: Path, folder: Path) -> None:
    try:
        found = export(path, folder / "scene")
    except Exception as error:
        traceback.print_exc()
        found = {"failed": " ".join(str(error).split()) or type(error).__name__}
    answer = folder / "answer.json"
    partial = answer.with_suffix(".part")
    partial.write_text(json.dumps(found), encoding="utf-8")
    partial.replace(answer)


def files_of(paths: list[Path], limit: int | None) -> list[tuple[str, Path]]:
    """(name relative to the folder that they share, file) for the first `limit` files."""
    found = [each for path in paths for each in ([path] if path.is_file() else sorted(path.rglob("*.blend")))]
    root = os.path.commonpath([path.parent for path in found]) if found else ""
    return [(str(path.relative_to(root)), path) for path in found[:limit]]


def survey(files: list[tuple[str, Path]], patience: float, has_notes: bool) -> str:
    """The tables of these files."""
    left_out, nothing = Table("Left out"), Table("Objects of which nothing is seen")
    notes, failed, bare, whole, shown = Table("Notes"), [], [], 0, 0
    for number, (name, path) in enumerate(files, 1):
        print(f"{number}/{len(files)} {name}", file=sys.stderr, flush=True)
        found = _in_a_child(path, patience)
        if "failed" in found:
            failed.append(f"    {name}: {found['failed']}")
            continue
        if not found["shapes"]:
            bare.append(f"    {name}")
        whole += not found["left_out"]
        shown += bool(found["left_out"]) and not any(map(can_be_shown, found["left_out"]))
        whys = [nothing_of(line) for line in found["left_out"]]
        nothing.add(name, [kind_of(why) for why in whys if why is not None])
        left_out.add(name, [kind_of(line) for line, why in zip(found["left_out"], whys) if why is None])
        notes.add(name, [kind_of(line) for line in found["notes"]])
    counts = f"{len(failed)} of them failed, {len(bare)} without any shape, {whole} with nothing left out"
    counts += f", {shown} with nothing but what nobody can show"
    parts = [f"{len(files)} files, {counts}\n"]
    parts += [table.text() for table in [left_out, nothing, *([notes] if has_notes else [])]]
    for title, lines in (("Without any shape", bare), ("Failed", failed)):
        if lines:
            parts.append("\n".join([title, *lines, ""]))
    return "\n".join(parts)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+", metavar="FOLDER", help="folders, or files")
    parser.add_argument("--limit", type=int, help="only so many files, the first by name")
    parser.add_argument("--patience", type=float, default=120.0, help="seconds after which a file is given up")
    parser.add_argument("--notes", action="store_true", help="a table of the notes as well")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one is not None:
        _one(arguments.paths[0], arguments.one)
        return
    files = files_of(arguments.paths, arguments.limit)
    if not files:
        sys.exit(f"there is no .blend in {', '.join(map(str, arguments.paths))}")
    print(survey(files, arguments.patience, arguments.notes))


if __name__ == "__main__":
    main()
