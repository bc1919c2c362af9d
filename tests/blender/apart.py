"""Renders each .blend in a separate process: a file that crashes Blender does not end the rest."""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path

import survey


def parser(description: str) -> argparse.ArgumentParser:
    """The parser for a script that takes files: the options that `each` needs, and room for more."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("paths", type=Path, nargs="+", help="files, or folders")
    parser.add_argument("--keep", type=Path, help="folder for pictures and what was said of each file")
    parser.add_argument("--one", type=Path, help=argparse.SUPPRESS)
    return parser


def each(
    arguments: argparse.Namespace,
    render: Callable[[Path, argparse.Namespace, Path], dict],
    script: str,
    options: list[str],
    patience: float,
) -> Iterator[tuple[str, dict]]:
    """The name of each file, relative to the folder that they share, and what `render` returns for it.

    `script` is started again for each, with `options`; there it renders that file and does not return. A file that
    takes longer than `patience` seconds is given up.
    """
    if arguments.one is not None:
        try:
            found = render(arguments.paths[0], arguments, arguments.one)
        except Exception:
            traceback.print_exc()
            sys.exit(1)
        beside(arguments.one, ".json").write_text(json.dumps(found), encoding="utf-8")
        sys.exit(0)
    folder = arguments.keep or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    for name, path in survey.files_of(arguments.paths, None):
        keep = folder / name.replace("/", "_").removesuffix(".blend")
        yield name, _answer([sys.executable, script, str(path), "--one", str(keep), *options], keep, patience)


def beside(keep: Path, ending: str) -> Path:
    """The path of an output for one .blend."""
    return keep.with_name(keep.name + ending)


def _answer(command: list[str], keep: Path, patience: float) -> dict:
    answer = beside(keep, ".json")
    answer.unlink(missing_ok=True)
    with beside(keep, ".log").open("wb") as log:
        try:
            done = subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, timeout=patience)
        except subprocess.TimeoutExpired:
            return {"refused": f"not done after {patience:g} s"}
    if done.returncode or not answer.is_file():
        return {"refused": f"ended with {done.returncode}, see {log.name}"}
    return json.loads(answer.read_text(encoding="utf-8"))
