"""Builds the wheel like maturin, and includes the command `beamfarm`."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import maturin

HERE = Path(__file__).resolve().parent.parent
TOP = HERE.parent.parent
NAME = "beamfarm.exe" if os.name == "nt" else "beamfarm"

get_requires_for_build_wheel = maturin.get_requires_for_build_wheel
prepare_metadata_for_build_wheel = maturin.prepare_metadata_for_build_wheel
get_requires_for_build_editable = maturin.get_requires_for_build_editable
prepare_metadata_for_build_editable = maturin.prepare_metadata_for_build_editable


def _command() -> None:
    """Builds the command into the package."""
    cargo = ["cargo", "build", "--profile", "dist", "--locked", "-p", "beamfarm", "--features", "gpu"]
    subprocess.run([*cargo, "--config", "profile.dist.strip=true"], cwd=TOP, check=True)
    built = Path(os.environ.get("CARGO_TARGET_DIR") or TOP / "target") / "dist" / NAME
    place = HERE / "package" / "beamfarm" / "bin" / NAME
    place.parent.mkdir(exist_ok=True)
    shutil.copy2(built, place)


def build_wheel(*args: Any, **options: Any) -> str:
    _command()
    return maturin.build_wheel(*args, **options)


def build_editable(*args: Any, **options: Any) -> str:
    _command()
    return maturin.build_editable(*args, **options)


def build_sdist(*args: Any, **options: Any) -> str:
    raise SystemExit("beamfarm is built from a checkout of its repository, or from a wheel: there is no source archive")
