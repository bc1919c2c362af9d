#!/usr/bin/env python3
"""Makes the zip that Blender installs: `python package.py [OUT.zip]`.

The same files give the same bytes: names are sorted, and times are those of no day.
"""

from __future__ import annotations

import sys
import tomllib
import zipfile
from pathlib import Path

SOURCE = Path(__file__).resolve().parent / "beamfarm"
ENDINGS = {".py", ".toml"}


def build(out: Path) -> Path:
    """Write the zip."""
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(SOURCE.rglob("*")):
            if path.suffix in ENDINGS and "__pycache__" not in path.parts:
                info = zipfile.ZipInfo(path.relative_to(SOURCE).as_posix(), (1980, 1, 1, 0, 0, 0))
                info.compress_type = zipfile.ZIP_DEFLATED
                info.external_attr = 0o644 << 16
                archive.writestr(info, path.read_bytes())
    return out


def main() -> None:
    manifest = tomllib.loads((SOURCE / "blender_manifest.toml").read_text(encoding="utf-8"))
    name = f"{manifest['id']}-{manifest['version']}.zip"
    print(build(Path(sys.argv[1] if len(sys.argv) > 1 else name)))


if __name__ == "__main__":
    main()
