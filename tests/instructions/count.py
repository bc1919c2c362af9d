#!/usr/bin/env python3
"""Instructions that three small renders take, and where, against recorded counts.

    python3 tests/instructions/count.py            compare with tests/instructions/recorded.json; exit 1 beyond 2 %
    python3 tests/instructions/count.py --record   record the present counts

Needs valgrind. Instruction counts are nearly the same from run to run; times on a shared machine are not. valgrind has
no 512-bit vectors, so the AVX2 code is counted; counts of another compiler or processor differ. One thread, one pass.
"""

import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
RECORDED = HERE / "recorded.json"
SCENES = ["fog", "smoke", "glass"]
# Below this share of a render a function is noise; smaller changes are not reported.
SHARE = 0.005
TOLERANCE = 0.02


def build():
    subprocess.run(["cargo", "build", "--release", "-p", "beamfarm"], cwd=ROOT, check=True)
    return ROOT / "target" / "release" / "beamfarm"


def short(name):
    """A function's name without its file, hash and type parameters."""
    name = re.sub(r"^[^:]*:(?!:)", "", name)
    name = re.sub(r" \[.*\]$", "", name)
    depth, out = 0, []
    for c in name.replace("'2", ""):
        depth += c == "<"
        if depth == 0:
            out.append(c)
        depth -= c == ">" and depth > 0
    return "".join(out).strip(":").replace("::::", "::") or name


def measure(binary, scene):
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "callgrind"
        command = ["valgrind", "--tool=callgrind", f"--callgrind-out-file={out}", str(binary), "replay"]
        command += [str(HERE / f"{scene}.toml"), "--pass", "0", "--threads", "1"]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            sys.exit(f"{scene}: {done.stderr[-2000:]}")
        listing = subprocess.run(["callgrind_annotate", "--threshold=99.5", str(out)], capture_output=True, text=True, check=True).stdout
    total, parts = 0, {}
    for line in listing.splitlines():
        match = re.match(r"\s*([\d,]+) \([\s\d.]+%\)\s+(.*)", line)
        if not match:
            continue
        count = int(match[1].replace(",", ""))
        if "PROGRAM TOTALS" in line:
            total = count
        else:
            parts[short(match[2])] = parts.get(short(match[2]), 0) + count
    parts = {name: count for name, count in parts.items() if count > SHARE * total}
    return {"total": total, "functions": dict(sorted(parts.items(), key=lambda p: -p[1]))}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", action="store_true")
    args = parser.parse_args()
    binary = build()
    now = {scene: measure(binary, scene) for scene in SCENES}
    if args.record:
        RECORDED.write_text(json.dumps(now, indent=1) + "\n")
    before = json.loads(RECORDED.read_text())
    slower = False
    for scene, counts in now.items():
        was = before[scene]
        ratio = counts["total"] / was["total"]
        slower |= ratio > 1 + TOLERANCE
        print(f"{scene:<8} {counts['total'] / 1e6:10.1f} M instructions, {ratio:.3f} of what was recorded")
        names = {**was["functions"], **counts["functions"]}
        moves = [(counts["functions"].get(n, 0) - was["functions"].get(n, 0), n) for n in names]
        for move, name in sorted(moves, key=lambda m: -abs(m[0])):
            if abs(move) > SHARE * was["total"]:
                print(f"    {move / 1e6:+10.1f} M  {name}")
    sys.exit(slower)


main()
