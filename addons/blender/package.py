#!/usr/bin/env python3
"""Makes the zip that Blender installs: `python package.py [--wheel WHEEL]… [OUT.zip]`.

If it contains the wheel of the Python package `beamfarm`, nothing else has to be installed. Such a zip is for the
platform of its wheels, and named after it as by `blender --command extension build --split-platforms`.

The same files give the same bytes: names are sorted, and times are fixed.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tomllib
import zipfile
from collections.abc import Sequence
from pathlib import Path

SOURCE = Path(__file__).resolve().parent / "beamfarm"
MANIFEST = "blender_manifest.toml"
ENDINGS = {".py", ".toml"}

# Blender's names of systems and machines, by those in wheels' names.
SYSTEMS = {"linux": "linux", "manylinux": "linux", "macosx": "macos", "win": "windows"}
MACHINES = {
    "x86_64": ["x64"],
    "amd64": ["x64"],
    "aarch64": ["arm64"],
    "arm64": ["arm64"],
    "universal2": ["x64", "arm64"],
}


class PackageError(Exception):
    """No zip can be made from these files."""


def platforms(wheel: str) -> list[str]:
    """Blender's names for the platforms of a wheel with this name; none if it is for all."""
    parts = wheel.removesuffix(".whl").split("-")
    if not wheel.endswith(".whl") or len(parts) not in (5, 6):
        raise PackageError(f"{wheel} is not named as wheels are: NAME-VERSION-PYTHON-ABI-PLATFORM.whl")
    found = []
    for tag in parts[-1].split("."):
        if tag == "any":
            return []
        said = re.fullmatch(r"([a-z]+)\d*(?:_\d+)*_(x86_64|amd64|aarch64|arm64|universal2)", tag)
        if said is None or said[1] not in SYSTEMS:
            raise PackageError(f"{wheel} is for {tag}, for which there is no Blender")
        found += [f"{SYSTEMS[said[1]]}-{machine}" for machine in MACHINES[said[2]]]
    return sorted(set(found))


def common(wheels: Sequence[Path]) -> list[str]:
    """The platforms that all wheels share."""
    found = [(wheel.name, names) for wheel in wheels if (names := platforms(wheel.name))]
    for name, names in found:
        if names != found[0][1]:
            raise PackageError(f"{name} is for {', '.join(names)}, but {found[0][0]} for {', '.join(found[0][1])}")
    return found[0][1] if found else []


def manifest(wheels: Sequence[Path] = ()) -> str:
    """The manifest including these wheels."""
    text = (SOURCE / MANIFEST).read_text(encoding="utf-8")
    if not wheels:
        return text
    lines = [("wheels", [f"./wheels/{wheel.name}" for wheel in wheels]), ("platforms", common(wheels))]
    # JSON strings are valid TOML strings, and fields above the first table belong to no table.
    added = "".join(f"{name} = {json.dumps(values)}\n" for name, values in lines if values)
    top, table, rest = text.partition("\n[")
    return top + added + table + rest


def name(wheels: Sequence[Path] = ()) -> str:
    """The usual name of the zip."""
    fields = tomllib.loads(manifest(wheels))
    names = [one.replace("-", "_") for one in fields.get("platforms", [])]
    return "-".join([fields["id"], fields["version"], *names]) + ".zip"


def build(out: Path, wheels: Sequence[Path] = ()) -> Path:
    """Writes the zip."""
    wheels = sorted(wheels, key=lambda wheel: wheel.name)
    files = [path for path in SOURCE.rglob("*") if path.suffix in ENDINGS and "__pycache__" not in path.parts]
    parts = {path.relative_to(SOURCE).as_posix(): path for path in files}
    parts |= {f"wheels/{wheel.name}": wheel for wheel in wheels}
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for inside, path in sorted(parts.items()):
            info = zipfile.ZipInfo(inside, (1980, 1, 1, 0, 0, 0))
            # Wheels are compressed already.
            info.compress_type = zipfile.ZIP_STORED if path.suffix == ".whl" else zipfile.ZIP_DEFLATED
            info.external_attr = 0o644 << 16
            content = manifest(wheels).encode() if inside == MANIFEST else path.read_bytes()
            archive.writestr(info, content)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description="Makes the zip that Blender installs.")
    parser.add_argument("--wheel", action="append", default=[], type=Path, help="a wheel that goes into it")
    parser.add_argument("out", nargs="?", type=Path, help="the zip [default: its usual name, in this folder]")
    asked = parser.parse_args()
    try:
        print(build(asked.out or Path(name(asked.wheel)), asked.wheel))
    except (OSError, PackageError) as error:
        sys.exit(f"error: {error}")


if __name__ == "__main__":
    main()
