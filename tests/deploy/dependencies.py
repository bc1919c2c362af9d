#!/usr/bin/env python3
"""Checks deny.toml's rules on licences, banned crates and sources with `cargo metadata` alone, for machines without
cargo-deny. Python 3.11."""

import json
import re
import subprocess
import sys
import tomllib
from collections import defaultdict
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[2]


def allowed(expression, licences):
    """Whether an SPDX expression can be satisfied; a slash in old manifests means OR."""
    tokens = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))

    def either():
        met = both()
        while tokens and tokens[0] == "OR":
            tokens.pop(0)
            met = both() or met
        return met

    def both():
        met = one()
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            met = one() and met
        return met

    def one():
        if tokens[0] == "(":
            tokens.pop(0)
            met = either()
            tokens.pop(0)
            return met
        name = tokens.pop(0)
        if tokens and tokens[0] == "WITH":
            name = f"{name} {tokens.pop(0)} {tokens.pop(0)}"
        return name in licences

    return either() and not tokens


def main():
    rules = tomllib.loads((REPOSITORY / "deny.toml").read_text())
    command = ["cargo", "metadata", "--format-version=1", "--locked", "--all-features"]
    for target in rules["graph"]["targets"]:
        command.append(f"--filter-platform={target}")
    metadata = json.loads(subprocess.check_output(command, cwd=REPOSITORY))
    licences = set(rules["licenses"]["allow"])
    banned = {rule["name"] for rule in rules["bans"]["deny"]}
    registries = {f"registry+{url}" for url in rules["sources"]["allow-registry"]}
    wrong, versions = [], defaultdict(set)
    for package in metadata["packages"]:
        name = f"{package['name']} {package['version']}"
        versions[package["name"]].add(package["version"])
        if package["name"] in banned:
            wrong.append(f"{name} is banned")
        if package["source"] not in registries | {None}:
            wrong.append(f"{name} comes from {package['source']}")
        licence = package["license"] or "no licence"
        if not allowed(licence, licences):
            wrong.append(f"{name}: {licence}")
        for dependency in package["dependencies"]:
            if package["source"] is None and dependency["req"] == "*" and not dependency.get("path"):
                wrong.append(f"{name} takes any version of {dependency['name']}")
    twice = sorted(name for name, found in versions.items() if len(found) > 1)
    print(f"{len(metadata['packages'])} packages; in two versions: {', '.join(twice)}")
    for line in wrong:
        print(line, file=sys.stderr)
    sys.exit(bool(wrong))


if __name__ == "__main__":
    main()
