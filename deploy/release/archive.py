#!/usr/bin/env python3
"""Packs a folder: the same files give the same bytes.

    archive.py FOLDER OUT.tar.gz|OUT.zip     names are sorted, owners nobody, times SOURCE_DATE_EPOCH
    archive.py --sums FOLDER                 writes FOLDER/SHA256SUMS, as sha256sum does
"""

from __future__ import annotations

import gzip
import hashlib
import os
import sys
import tarfile
import time
import zipfile
from pathlib import Path

# The oldest time that a zip can tell.
OLDEST = 315532800


def files(folder: Path) -> list[Path]:
    """All of them, by name."""
    return sorted((path for path in folder.rglob("*") if path.is_file()), key=lambda path: path.as_posix())


def mode(path: Path) -> int:
    """Whether it is a program: whatever the umask is."""
    return 0o755 if os.access(path, os.X_OK) else 0o644


def tar(folder: Path, out: Path, when: int) -> None:
    """A .tar.gz with the folder in it."""
    with out.open("wb") as file, gzip.GzipFile("", "wb", 9, file, mtime=when) as packed:
        with tarfile.open(fileobj=packed, mode="w", format=tarfile.USTAR_FORMAT) as archive:
            for path in files(folder):
                info = tarfile.TarInfo(path.relative_to(folder.parent).as_posix())
                info.size, info.mtime, info.mode = path.stat().st_size, when, mode(path)
                with path.open("rb") as content:
                    archive.addfile(info, content)


def zipped(folder: Path, out: Path, when: int) -> None:
    """A .zip with the folder in it."""
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for path in files(folder):
            told = time.gmtime(max(when, OLDEST))[:6]
            info = zipfile.ZipInfo(path.relative_to(folder.parent).as_posix(), told)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3
            info.external_attr = (0o100000 | mode(path)) << 16
            archive.writestr(info, path.read_bytes())


def sums(folder: Path) -> None:
    """The digest of each file."""
    lines = []
    for path in files(folder):
        if path.name != "SHA256SUMS":
            with path.open("rb") as file:
                digest = hashlib.file_digest(file, "sha256").hexdigest()
            lines.append(f"{digest}  {path.relative_to(folder).as_posix()}\n")
    (folder / "SHA256SUMS").write_text("".join(lines), encoding="utf-8", newline="\n")


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    first, second = sys.argv[1:]
    if first == "--sums":
        return sums(Path(second))
    when = int(os.environ.get("SOURCE_DATE_EPOCH", OLDEST))
    pack = zipped if second.endswith(".zip") else tar
    return pack(Path(first), Path(second), when)


if __name__ == "__main__":
    main()
