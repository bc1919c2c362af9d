"""Builds the wheel as maturin does, with the command `beamfarm` in it.

`BEAMFARM_CARGO` may have another way to call cargo for the command, as `cargo zigbuild --target
x86_64-unknown-linux-gnu.2.28`; what maturin is told the same by is `MATURIN_PEP517_ARGS`.
"""

from __future__ import annotations

import os
import shlex
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
    """Build the command into the package."""
    cargo = shlex.split(os.environ.get("BEAMFARM_CARGO", "cargo build"))
    target = os.environ.get("CARGO_TARGET_DIR") or str(TOP / "target")
    # The same features and profile as the module: what both are made of is compiled once.
    subprocess.run(
        [*cargo, "--profile", "dist", "--locked", "-p", "beamfarm", "-p", "beamfarm-python"]
        + ["--features", "beamfarm/gpu,beamfarm-python/gpu", "--config", "profile.dist.strip=true"],
        cwd=TOP,
        check=True,
    )
    # A build for a named target has a folder of its own.
    where = [arg for arg in cargo if arg.startswith("x86_64-") or arg.startswith("aarch64-")]
    parts = [where[-1].split(".")[0]] if where else []
    built = Path(target).joinpath(*parts, "dist", NAME)
    place = HERE / "beamfarm" / "bin" / NAME
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
