#!/usr/bin/env python3
"""Compares beamfarm with Mitsuba 3, LuxCore and Cycles on five scenes, and writes a report with pictures.

    cargo build --release
    python3 tests/peers/run.py --program target/release/beamfarm                # all of it: about 75 minutes
    python3 tests/peers/run.py --program target/release/beamfarm --references   # only what can be done beforehand
    python3 tests/peers/run.py --program target/release/beamfarm --size 96 --seconds 1,2 --denoised 2 \\
        --check-seconds 2 --reference-seconds 10 --folder /tmp/peers            # does it work here?

The other renderers are installed from PyPI into a virtual environment, target/peers/venv, with Python 3.11 (bpy has
packages for no other). What cannot be installed is left out, and the report says so. What has been measured is kept, in
target/peers: another call goes on from there; delete files to measure them again. README.md says what is compared.
"""

import argparse
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
TARGET = HERE.parent.parent / "target" / "peers"
TOOLS = ["numpy", "pillow", "OpenEXR"]
PEERS = {"mitsuba": "mitsuba", "luxcore": "pyluxcore", "cycles": "bpy==4.5.*"}


def arguments():
    numbers = lambda text: sorted(float(part) for part in text.split(","))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default="target/release/beamfarm", help="beamfarm (%(default)s)")
    parser.add_argument("--seconds", type=numbers, default=[10.0, 60.0], help="of rendering (10,60)")
    parser.add_argument("--denoised", type=numbers, default=[5.0, 10.0],
                        help="the same for denoised pictures of beamfarm and Cycles (5,10)")
    parser.add_argument("--threads", type=int, default=2, help="for each renderer (%(default)s)")
    parser.add_argument("--size", type=int, default=384, help="width and height in pixels (%(default)s)")
    parser.add_argument("--scenes", help="names, separated by commas (all)")
    parser.add_argument("--renderers", help="names, separated by commas (beamfarm,mitsuba,luxcore,cycles)")
    parser.add_argument("--references", action="store_true", help="make references and checks only")
    parser.add_argument("--reference-seconds", type=float, default=120.0,
                        help="for each half of a reference, and for the peer it is compared with (%(default)s)")
    parser.add_argument("--check-seconds", type=float, default=16.0, help="for each renderer and scene (%(default)s)")
    parser.add_argument("--folder", type=pathlib.Path, default=TARGET, help="of all results (target/peers)")
    parser.add_argument("--venv", type=pathlib.Path, help="virtual environment (venv in the folder)")
    return parser.parse_args()


def in_environment(venv):
    """Makes the virtual environment if need be, and starts this script again inside it."""
    python = venv / "bin" / "python"
    if pathlib.Path(sys.prefix).resolve() == venv.resolve():
        return
    if not python.exists():
        creator = shutil.which("python3.11") or sys.executable
        print(f"making {venv} with {creator}", flush=True)
        subprocess.run([creator, "-m", "venv", str(venv)], check=True)
    marker = venv / "peers.json"
    failed = json.loads(marker.read_text()) if marker.exists() else None
    if failed is None or failed:
        failed = {}
        for packages in [TOOLS, *([package] for package in PEERS.values())]:
            print("installing", *packages, flush=True)
            done = subprocess.run([str(python), "-m", "pip", "install", "--quiet", *packages], capture_output=True,
                                  text=True)
            if done.returncode:
                reason = ([line for line in done.stderr.splitlines() if "ERROR" in line] or ["pip failed"])[-1]
                failed[packages[0]] = reason.removeprefix("ERROR: ")
                print(f"  {packages[0]} cannot be installed: {failed[packages[0]]}", flush=True)
        if TOOLS[0] in failed:
            sys.exit("run.py needs " + ", ".join(TOOLS))
        marker.write_text(json.dumps(failed))
    os.execv(str(python), [str(python), *sys.argv])


class Bench:
    """Renders what is asked for, unless it is there already."""

    def __init__(self, options):
        self.options, self.folder = options, options.folder / str(options.size)
        self.program = str(pathlib.Path(options.program).resolve())
        self.problems = {}

    def start(self, renderer, limit, **values):
        """A process that renders; its result, or None and a line in `problems`."""
        folder = self.folder / "work" / f"{renderer}-{values.get('scene', 'version')}"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        job = dict(renderer=renderer, program=self.program, threads=self.options.threads, folder=str(folder),
                   version=False, scene="", check=False, size=self.options.size, seconds=[], seed=0, denoise=False)
        (folder / "job.json").write_text(json.dumps(job | values))
        try:
            done = subprocess.run([sys.executable, str(HERE / "job.py"), str(folder / "job.json")], timeout=limit,
                                  capture_output=True, text=True)
            said = (done.stderr.strip() or f"exit code {done.returncode}").splitlines()[-1]
        except subprocess.TimeoutExpired:
            said = f"not done after {limit:.0f} s"
        if not (folder / "result.json").exists():
            where = f"{renderer}, {values['scene']}" if values.get("scene") else renderer
            self.problems[where] = said
            print(f"  {where} FAILED: {said}", flush=True)
            return None
        return json.loads((folder / "result.json").read_text()), folder

    def render(self, name, renderer, scene, seconds, **values):
        """Pictures after each of `seconds`, as (file, seconds it took, note); those that exist are kept."""
        files = {s: self.folder / name / f"{scene}-{renderer}-{s:g}.exr" for s in seconds}
        missing = [s for s, file in files.items() if not file.with_suffix(".json").exists()]
        if missing:
            print(f"{name}: {scene}, {renderer}, {', '.join(f'{s:g}' for s in missing)} s", flush=True)
            made = self.start(renderer, 8 * sum(missing) + 300, scene=scene, seconds=missing, **values)
            for s in missing if made else []:
                files[s].parent.mkdir(parents=True, exist_ok=True)
                (made[1] / f"{s:g}.exr").replace(files[s])
                part = files[s].with_suffix(".part")
                part.write_text(json.dumps(made[0][f"{s:g}"]))
                part.replace(files[s].with_suffix(".json"))
        return {s: json.loads(file.with_suffix(".json").read_text()) | {"file": file}
                for s, file in files.items() if file.with_suffix(".json").exists()}

    def independent(self, name, renderer, scene, seconds, count, **values):
        """`count` pictures with different seeds, `seconds` in all."""
        from measure import read

        out = []
        for seed in range(1, count + 1):
            made = self.render(f"{name}/{seed}", renderer, scene, [seconds / count], seed=1000 + seed, **values)
            out += [read(result["file"]) for result in made.values()]
        return out

    def check(self, renderer, scene):
        """Whether the renderer means the same scene as beamfarm: compares an easy variant of it."""
        from measure import Agreement

        # Four times as long where noise leaves it open, as on a busy machine.
        for seconds in (self.options.check_seconds, 4 * self.options.check_seconds):
            both = [self.independent("checks", each, scene, seconds, 4, check=True, size=96)
                    for each in (renderer, "beamfarm")]
            if min(map(len, both)) < 4:
                return None
            agreement = Agreement(*both)
            if agreement.clear:
                break
        return agreement

    def reference(self, scene):
        """Two halves by beamfarm, and how far a long render by a peer agrees with them."""
        from measure import Agreement, Reference
        from scenes import SCENES

        seconds = self.options.reference_seconds
        halves = self.independent("references", "beamfarm", scene, 2 * seconds, 2)
        if len(halves) < 2:
            return None
        reference = Reference(halves)
        for peer in dict.fromkeys((SCENES[scene].witness, *PEERS)):
            if peer in self.renderers:
                images = self.independent("references", peer, scene, seconds, 4)
                if len(images) == 4:
                    reference.witness = peer, seconds, Agreement(images, halves)
                    break
        return reference


def main():
    options = arguments()
    # Renderers start in other folders.
    options.folder = options.folder.resolve()
    venv = (options.venv or options.folder / "venv").resolve()
    in_environment(venv)
    sys.path.insert(0, str(HERE))
    import report
    from scenes import SCENES

    bench = Bench(options)
    if not shutil.which(bench.program):
        sys.exit(f"{options.program}: expected the program beamfarm; cargo build --release makes it")
    failed = json.loads((venv / "peers.json").read_text()) if (venv / "peers.json").exists() else {}
    missing = {name: f"cannot be installed: {failed[package]}" for name, package in PEERS.items() if package in failed}
    bench.problems |= missing
    wanted = (options.renderers or ",".join(["beamfarm", *PEERS])).split(",")
    unknown = [name for name in wanted if name not in ("beamfarm", *PEERS)]
    scenes = (options.scenes or ",".join(SCENES)).split(",")
    unknown += [name for name in scenes if name not in SCENES]
    if unknown:
        sys.exit(f"{unknown[0]}: expected one of beamfarm, {', '.join(PEERS)}; scenes are {', '.join(SCENES)}")
    versions = {name: bench.start(name, 300, version=True) for name in dict.fromkeys(["beamfarm", *wanted])
                if name not in missing}
    bench.renderers = [name for name, made in versions.items() if made]
    print("; ".join(versions[name][0] for name in bench.renderers), flush=True)

    results = {scene: dict(checks={}, runs={}, denoised={}) for scene in scenes}
    for scene, result in results.items():
        for name in bench.renderers:
            if name != "beamfarm":
                check = result["checks"][name] = bench.check(name, scene)
                print(f"check: {scene}, {name}: {check or 'failed'}", flush=True)
    for scene, result in results.items():
        result["reference"] = bench.reference(scene)
    if options.references:
        return
    for scene, result in results.items():
        for name in bench.renderers:
            if name == "beamfarm" or result["checks"][name] and result["checks"][name].usable:
                result["runs"][name] = bench.render("runs", name, scene, options.seconds)
                if name in ("beamfarm", "cycles"):
                    result["denoised"][name] = bench.render("denoised", name, scene, options.denoised, denoise=True)
    shutil.rmtree(bench.folder / "work", ignore_errors=True)
    report.write(bench, {name: versions[name][0] for name in bench.renderers}, results)


if __name__ == "__main__":
    begun = time.time()
    main()
    print(f"{time.time() - begun:.0f} s")
