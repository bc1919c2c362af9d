#!/usr/bin/env python3
"""Which Mitsuba scenes of a folder beamfarm and Mitsuba can read, and what stops the others.

    cargo build --release
    python tests/mitsuba/read.py ~/scenes                    # a table, then refusals by number of files
    python tests/mitsuba/read.py ~/scenes --no-mitsuba       # without asking Mitsuba
    python tests/mitsuba/read.py ~/scenes --csv table.csv    # the table as a file

Every .xml below the folder that has a <scene> and a sensor, also through includes, gets one line: yes, or the refusals.
A missing file that a scene names is counted separately ("missing"): it says nothing about the reader. Mitsuba (pip
install mitsuba, variant scalar_rgb) loads each file in a separate process, with a time limit; its results are kept next
to the scenes (.mitsuba-reads.json), since they do not change.

The list at the end gives refusals without names and numbers, and how many files have each, those that Mitsuba reads
first. "alone" counts the files that nothing else stops.
"""

import argparse
import collections
import concurrent.futures
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
MISSING = re.compile(r"No such file|not found|no such file|cannot be read|Is a directory", re.I)

LOAD = """
import sys, mitsuba as mi
mi.set_variant("scalar_rgb")
mi.set_log_level(mi.LogLevel.Error)
mi.load_file(sys.argv[1])
"""


def scenes(folder):
    """Files with a scene and a sensor; files that are only included have none."""
    for path in sorted(folder.rglob("*.xml")):
        text = re.sub(r"<!--.*?-->", "", path.read_text(errors="replace"), flags=re.S)
        if "<scene" in text and re.search(r"<(sensor|camera|include)\b", text):
            yield path, version(text)


def version(text):
    found = re.search(r'<scene[^>]*version="([^"]*)"', text)
    return found.group(1) if found else "none"


def by_mitsuba(path, seconds):
    try:
        done = subprocess.run([sys.executable, "-c", LOAD, path.name], cwd=path.parent, capture_output=True, text=True,
                              timeout=seconds, errors="replace")
    except subprocess.TimeoutExpired:
        return "timeout"
    lines = [line.strip() for line in done.stderr.splitlines() if line.strip()]
    return "yes" if done.returncode == 0 else (lines[-1] if lines else f"exit code {done.returncode}")[:200]


def by_beamfarm(program, path, seconds):
    """The refusals, each a line without file and line number; empty if the file is read."""
    with tempfile.TemporaryDirectory() as folder:
        command = [*program, path.name, f"{folder}/scene.toml"]
        try:
            done = subprocess.run(command, cwd=path.parent, capture_output=True, text=True, timeout=seconds,
                                  errors="replace")
        except subprocess.TimeoutExpired:
            return ["timeout"]
    if done.returncode == 0:
        return []
    lines = (done.stdout + done.stderr).splitlines()
    place = re.compile(r"^(error: )?\S*?\.(xml|toml)(:\d+)?: ")
    found = [place.sub("", line) for line in lines if place.match(line)]
    return found or lines[-1:] or [f"exit code {done.returncode}"]


def normal(message):
    """A refusal without what differs between files."""
    message = re.sub(r"(/|\.\./)?[\w.$-]+(/[\w.$ -]+)+", "FILE", message)
    message = re.sub(r'(the id|object with the id|the file|parameter -D) "[^"]*"', r'\1 "NAME"', message)
    return re.sub(r"-?\d+(\.\d+)?(e-?\d+)?", "N", message)[:150]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path)
    default = HERE.parent.parent / "target" / "release" / "beamfarm"
    parser.add_argument("--beamfarm", default=f"{default} convert", help="the command that converts: gets XML and TOML")
    parser.add_argument("--no-mitsuba", action="store_true", help="do not ask Mitsuba")
    parser.add_argument("--seconds", type=float, default=60, help="time limit for each file")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--csv", type=pathlib.Path, help="write the table to this file")
    parser.add_argument("--only", default="", help="files whose path contains this")
    arguments = parser.parse_args()
    program = arguments.beamfarm.split()
    found = [(path, v) for path, v in scenes(arguments.folder) if arguments.only in str(path)]
    cache = arguments.folder / ".mitsuba-reads.json"
    known = json.loads(cache.read_text()) if cache.exists() else {}

    def ask(entry):
        path, _ = entry
        name = str(path.relative_to(arguments.folder))
        ours = by_beamfarm(program, path, arguments.seconds)
        theirs = known.get(name)
        if theirs is None and not arguments.no_mitsuba:
            theirs = known[name] = by_mitsuba(path, arguments.seconds)
        return name, ours, theirs or "not asked"

    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        rows = list(pool.map(ask, found))
    if not arguments.no_mitsuba:
        cache.write_text(json.dumps(known, indent=0))
    counts = collections.Counter()
    reasons = collections.defaultdict(lambda: [0, 0, 0])
    table = []
    for (name, ours, theirs), (_, v) in zip(rows, found):
        missing = bool(ours) and all(MISSING.search(message) for message in ours)
        state = "yes" if not ours else "missing" if missing else "no"
        old = v.split(".")[0] in ("0", "1")
        counts[("0.x" if old else "2, 3", state, "yes" if theirs == "yes" else "no")] += 1
        table.append([name, v, state, "; ".join(ours)[:300], theirs])
        kinds = {normal(message) for message in ours}
        for kind in kinds:
            reasons[kind][0] += 1
            reasons[kind][1] += theirs == "yes"
            reasons[kind][2] += len(kinds) == 1
    width = max((len(row[0]) for row in table), default=0)
    for name, v, state, why, theirs in table:
        theirs = theirs if theirs in ("yes", "timeout", "not asked") else "no"
        print(f"{name:<{width}}  {v:<6} beamfarm {state:<8} Mitsuba {theirs:<8} {why[:120]}")
    print("\nfiles  of those that Mitsuba reads  alone  refusal")
    for kind, (files, read, alone) in sorted(reasons.items(), key=lambda item: (-item[1][1], -item[1][0], item[0])):
        print(f"{files:5}  {read:5}  {alone:5}  {kind}")
    print()
    for group in ("2, 3", "0.x"):
        line = {(s, m): n for (g, s, m), n in counts.items() if g == group}
        total = sum(line.values())
        ours = sum(n for (s, _), n in line.items() if s == "yes")
        missing = sum(n for (s, _), n in line.items() if s == "missing")
        theirs = sum(n for (_, m), n in line.items() if m == "yes")
        print(f"format {group}: {total} files; read by beamfarm {ours} (files missing for {missing} more), "
              f"by Mitsuba {theirs}, by both {line.get(('yes', 'yes'), 0)}")
    if arguments.csv:
        with arguments.csv.open("w", newline="") as file:
            csv.writer(file).writerows([["file", "version", "beamfarm", "refusals", "Mitsuba"], *table])


if __name__ == "__main__":
    main()
