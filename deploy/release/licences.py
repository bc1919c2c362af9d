#!/usr/bin/env python3
"""Prints the licences of all crates that the programs are made of, with their texts: licences.py TARGET FEATURES

The texts are those that the crates bring along, each text once. Ends with an error where a crate has none, and none
stands in OF_OTHERS: a release lacks nothing.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
STARTS = ("LICENSE", "LICENCE", "COPYING", "COPYRIGHT", "NOTICE", "UNLICENSE")
# Crates that have been published without the text that their repository has: whose files are the same, or the
# repository's, which is the standard text of Apache 2.0.
OF_OTHERS = {
    "draco-core": "LICENSE-APACHE",
    "profiling": "LICENSE-APACHE",
    "spirv": "LICENSE-APACHE",
    "tonic-prost": "tonic",
    "zune-inflate": "zune-core",
}


def cargo(*arguments: str) -> str:
    """What cargo says."""
    line = ["cargo", *arguments]
    done = subprocess.run(line, cwd=ROOT, capture_output=True, text=True, encoding="utf-8", check=False)
    if done.returncode:
        sys.exit(done.stderr)
    return done.stdout


def crates(target: str, features: str) -> list[dict]:
    """What is linked into the programs, but for the workspace's own, by name and version."""
    programs = ["-p", "beamfarm", "-p", "beamfarm-worker", "--features", features]
    tree = cargo("tree", *programs, "-e", "normal", "--target", target, "--prefix", "none", "--locked", "-f", "{p}")
    names = {tuple(line.split()[:2]) for line in tree.splitlines() if line}
    packages = json.loads(cargo("metadata", "--format-version", "1", "--locked", "--filter-platform", target))
    own = set(packages["workspace_members"])
    others = [one for one in packages["packages"] if one["id"] not in own]
    found = [one for one in others if (one["name"], "v" + one["version"]) in names]
    return sorted(found, key=lambda one: (one["name"], one["version"]))


def texts(crate: dict) -> list[Path]:
    """The files of a crate that are its licences."""
    folder = Path(crate["manifest_path"]).parent
    found = {path for path in folder.iterdir() if path.is_file() and path.name.upper().startswith(STARTS)}
    # Some keep each in a folder.
    for inner in ("LICENSES", "licenses", "license"):
        if (folder / inner).is_dir():
            found |= {path for path in (folder / inner).iterdir() if path.is_file()}
    if crate["license_file"] and (folder / crate["license_file"]).is_file():
        found.add(folder / crate["license_file"])
    return sorted(path for path in found if path.suffix not in (".rs", ".py"))


def main() -> None:
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    all_of_them = crates(*sys.argv[1:])
    by_name = {crate["name"]: crate for crate in all_of_them}
    users: dict[str, list[str]] = {}
    lines = []
    for crate in all_of_them:
        label = f"{crate['name']} {crate['version']}"
        lines.append(f"{label}: {crate['license'] or 'see its text'}, {crate['repository'] or 'no repository'}")
        files = texts(crate)
        if not files:
            other = OF_OTHERS.get(crate["name"])
            if other is None:
                sys.exit(f"error: {label} has no text of its licence, {crate['license']}; see OF_OTHERS in {__file__}")
            files = texts(by_name[other]) if other in by_name else [ROOT / other]
        for file in files:
            text = "\n".join(line.rstrip() for line in file.read_text(encoding="utf-8", errors="replace").splitlines())
            users.setdefault(text.strip("\n"), []).append(label)
    sys.stdout.reconfigure(encoding="utf-8", newline="\n")
    print("The programs of beamfarm contain these crates, each under the licence that it names, and Rust's standard")
    print("library (MIT OR Apache-2.0, https://github.com/rust-lang/rust). Their texts are below.\n")
    print("\n".join(lines))
    for text, labels in sorted(users.items(), key=lambda item: item[1]):
        names = list(dict.fromkeys(labels))
        print(f"\n{'-' * 80}\n{', '.join(names)}\n\n{text}")


if __name__ == "__main__":
    main()
