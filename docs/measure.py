#!/usr/bin/env python3
"""Measures this checkout on this machine and writes docs/measurements.md, whole: python3 docs/measure.py

All figures are made by commands of the repository, of one commit, in one run, so that none is older than another. The picture of
convergence goes to scenes/gallery/convergence.svg. Nothing else is changed. With --seconds 10, the default, it takes about
half an hour on two cores after everything is built; the machine should have nothing else to do. Python 3.9, Linux.

    python3 docs/measure.py --seconds 20                         # longer: less noise
    python3 docs/measure.py --only scenes,suite -o target/a.md   # some sections, for a look

With --engine gpu it measures a device beside the processors of the same machine, by the program alone: no cargo, and nothing but
the scenes of the checkout. What is measured is kept in a folder, scene by scene; the same command goes on where it was ended, or
where its minutes were over, and writes the table of what there is.

    python3 docs/measure.py --engine gpu --program ./beamfarm --folder out --minutes 8 -o out/gpu.md
"""

import argparse
import csv
import datetime
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import textwrap
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
BEAMFARM = ROOT / "target/release/beamfarm"
FIGURE = ROOT / "scenes/gallery/convergence.svg"
# One pass each, whatever --seconds says.
SCALING = {
    "disco": [
        {"width": 640, "height": 360},
        {"width": 1280, "height": 720},
        {"width": 1920, "height": 1080},
        {"width": 3840, "height": 2160},
        {"paths": 60000},
        {"paths": 200000},
        {"paths": 660000},
    ],
    "peers/box-iso": [
        {"width": 256, "height": 256, "paths": 71500},
        {"width": 512, "height": 512, "paths": 71500},
        {"width": 1024, "height": 1024, "paths": 71500},
        {"paths": 10000},
        {"paths": 30000},
        {"paths": 715000},
    ],
}


def run(*command, quiet=False):
    """What a command of the repository prints. Its stderr is passed on; it must end well."""
    command = [str(part) for part in command]
    if not quiet:
        print("$", " ".join(command), file=sys.stderr, flush=True)
    begun = time.time()
    done = subprocess.run(command, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    if not quiet:
        print(f"  {time.time() - begun:.1f} s", file=sys.stderr, flush=True)
    return done.stdout


def package_of(kind, name):
    """The package whose folder has this example or bench."""
    for manifest in run("git", "ls-files", "*Cargo.toml", quiet=True).split():
        path = ROOT / manifest
        if (path.parent / kind / f"{name}.rs").exists():
            return re.search(r'^name = "(.*)"', path.read_text(), re.M).group(1)
    sys.exit(f"no package has {kind}/{name}.rs")


def example(name, *arguments):
    command = ["cargo", "run", "--quiet", "--release", "-p", package_of("examples", name), "--example", name, "--"]
    return run(*command, *arguments)


def bench(folder, *arguments):
    """Rows of `beamfarm bench`, and what it printed."""
    said = run(BEAMFARM, "bench", *arguments, "-o", folder)
    with open(folder / "bench.csv", newline="") as file:
        return list(csv.DictReader(file)), said


def number(text, digits=3):
    """So many digits, no power of ten where people do not want one; a dash for nothing."""
    if text in (None, ""):
        return "–"
    value = float(text)
    if value == 0:
        return "0"
    if abs(value) >= 1e6 or abs(value) < 1e-3:
        return f"{value:.{digits - 1}e}".replace("e+0", "e").replace("e+", "e").replace("e-0", "e-")
    if abs(value) >= 10 ** (digits - 1):
        return f"{value:,.0f}"
    return f"{value:.{digits}g}"


def wrapped(text):
    """Paragraphs of 120 columns; tables, pictures and code as they are."""
    blocks, code = [], False
    for block in text.strip().split("\n\n"):
        is_prose = not code and not block.startswith(("#", "|", "!", "```"))
        code ^= block.count("```") % 2 == 1
        blocks.append(textwrap.fill(block, 120, break_long_words=False, break_on_hyphens=False) if is_prose else block)
    return "\n\n".join(blocks) + "\n"


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "| --- |" + " --: |" * (len(head) - 1)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows]) + "\n"


def markdown_tables(text):
    """Lines of tables, without what else was printed."""
    return "\n".join(line for line in text.splitlines() if line.startswith("|")) + "\n"


def a_pass(row, field):
    return float(row[field]) / float(row["passes"]) if row[field] else None


def megabytes(row):
    return number(float(row["peak_memory_bytes"]) / 1e6) + " MB" if row["peak_memory_bytes"] else "–"


def scenes(work, seconds):
    rows = []
    paths = sorted((ROOT / "scenes").glob("*.toml"))
    for path in paths:
        first, _ = bench(work / "one", path, "--passes", 1)
        passes = max(2, min(256, round(seconds / float(first[0]["wall_seconds"]))))
        row = bench(work / path.stem, path, "--passes", passes)[0][-1]
        error = row["estimated_relative_error"]
        rows.append([
            f"`{path.stem}`",
            f"{row['width']}x{row['height']}",
            number(row["prepare_seconds"], 2),
            number(a_pass(row, "beams")),
            number(a_pass(row, "surface_photons")),
            number(a_pass(row, "beam_evaluations")),
            number(a_pass(row, "wall_seconds")),
            number(a_pass(row, "core_seconds")),
            megabytes(row),
            number(row["bytes_per_beam"]),
            f"{passes}",
            f"{100 * float(error):.2g} %" if error else "–",
        ])
    head = ["scene", "pixels", "preparing, s", "beams a pass", "surface photons", "beam evaluations", "s a pass",
            "core-s a pass", "peak memory", "bytes a beam", "passes", "standard error after them"]
    return f"""## The example scenes

`beamfarm bench scenes/NAME.toml --passes N`, each scene as in its file, with N for about {seconds:g} seconds. Preparing means reading the
scene, building its trees and running the pilot of [photon targeting](method.md#light-where-the-camera-looks). Memory is that
of the whole process. The standard error is the estimate that `render` prints, which counts a few wild pixels in full: see
[manual.md](manual.md#what-a-render-writes-and-says).

{table(head, rows)}"""


def suite(work, seconds):
    passes = max(4, min(64, round(6.4 * seconds)))
    _, said = bench(work / "suite", "--suite", "scenes/peers/bench.toml", "--passes", passes)
    # The tables come after the last line of progress.
    lines = said.splitlines()
    last = max((i for i, line in enumerate(lines) if " core-s  relMSE " in line), default=-1)
    told = "\n".join(line for line in lines[last + 1:] if not line.startswith("wrote ")).strip()
    return f"""## Time to an error

`beamfarm bench --suite scenes/peers/bench.toml --passes {passes}`: two boxes of fog, with our own references in the repository. relMSE is
the mean of (x - ref)² / (ref² + 0.01), less the reference's own noise. The suite holds known figures of other renderers; they were
measured once, at another time ([notes.md](notes.md#against-other-renderers)), and are not remeasured here.

```text
{told}
```
"""


def mitsubas(work, seconds):
    _, said = bench(work / "mitsuba", "--suite", "tests/mitsuba/bench.toml", "--seconds", seconds)
    told = said[said.index("relMSE after "):].split("wrote ")[0].strip()
    return f"""## Error after {seconds:g} seconds

`beamfarm bench --suite tests/mitsuba/bench.toml --seconds {seconds:g}`: small scenes of most kinds (48x48 or 64x64 pixels), by passes and by the
path tracer of `beamfarm reference`. relMSE is as above, against references by the path tracer. Mitsuba 3.9.1 was measured once for
ten seconds, as the suite says, and is not remeasured here.

```text
{told}
```
"""


def scaling(work, _seconds):
    text = """## Pixels and beams

One pass of two scenes (`beamfarm bench SCENE --passes 1` with `--width`, `--height`, `--paths`). Evaluations, and gathering with them,
grow as pixels times beams in reach. The rest of a pass grows with pixels alone or with photon paths alone, so ten times the
beams cost less than ten times the time.

"""
    head = ["scene", "pixels", "beams", "beam evaluations", "seconds", "core-s", "peak memory"]
    rows = []
    for name, cases in SCALING.items():
        for case in cases:
            options = [part for key, value in case.items() for part in (f"--{key}", value)]
            row = bench(work / "scaling", f"scenes/{name}.toml", "--passes", 1, *options)[0][-1]
            rows.append([
                f"`{name}`", f"{row['width']}x{row['height']}", number(row["beams"]), number(row["beam_evaluations"]),
                number(row["wall_seconds"]), number(row["core_seconds"]), megabytes(row),
            ])
    return text + table(head, rows)


def alpha(work, seconds):
    passes = max(4, min(64, round(3.2 * seconds)))
    rows = []
    for value in [0.5, 0.6666666666666666, 0.8]:
        found, _ = bench(work / "alpha", "scenes/peers/box-iso.toml", "--reference", "scenes/peers/box-iso.exr",
                         "--passes", passes, "--alpha", value)
        last = found[-1]
        rows.append([f"{value:.3g}", number(last["net_rel_mse"] or last["rel_mse"]), number(last["mean_ratio"], 5),
                     number(last["wall_seconds"])])
    return f"""## How quickly radii shrink

`beamfarm bench scenes/peers/box-iso.toml --reference scenes/peers/box-iso.exr --passes {passes} --alpha A`. A larger alpha gives less noise and
more blur.

{table(["alpha", "relMSE", "mean over the reference's", "seconds"], rows)}"""


def budget(_work, seconds):
    passes = max(4, min(64, round(1.6 * seconds)))
    told = example("budget", "scenes/peers/box-iso.toml", "scenes/peers/box-iso.exr", passes).strip()
    return f"""## Radii for a known number of passes

`cargo run --release -p {package_of("examples", "budget")} --example budget -- scenes/peers/box-iso.toml scenes/peers/box-iso.exr {passes}`: relMSE
with shrinking radii, and with one scale for all passes; `--budget` chooses the third of the four scales.

```text
{told}
```
"""


def targeting(_work, seconds):
    turns = max(4, min(12, round(0.6 * seconds)))
    pilots, ratios = [], []
    for path in sorted((ROOT / "scenes").glob("*.toml")):
        relative = path.relative_to(ROOT)
        name = f"`{path.stem}`"
        for line in example("targeting", relative, 64, 1, turns).splitlines():
            cells = [cell.strip() for cell in line.strip("|").split("|")]
            if line.startswith("| |"):
                ratios.append([name, cells[1].split(",")[0], *cells[2:]])
            elif line.startswith("|"):
                pilots.append([name, cells[1]])
    what = '`"auto"`, the pilot, of the time of the scene\'s own passes'
    return f"""## Photon targeting

`cargo run --release -p {package_of("examples", "targeting")} --example targeting -- scenes/NAME.toml 64 1 {turns}`: {turns} images of one pass, 64 pixels
wide, with and without aimed photons. The first table shows what `"auto"` decides and what its pilot costs; where it aims nothing,
the picture has the bits of `"off"`:

{table(["scene", what], pilots)}
The second has ratios to images without targeting: of processor time, of relMSE (as the variance of the images), and of their
product, which is below 1 where targeting pays. Where `"auto"` decides against it, `"on"` shows what would be lost:

{table(["scene", "targeting", "time", "relMSE", "both"], ratios)}"""


def gloss(_work, seconds):
    passes = max(4, min(32, round(0.8 * seconds)))
    told = markdown_tables(example("gloss", "scenes/glossy-gallery.toml", passes))
    return f"""## Gloss

`cargo run --release -p {package_of("examples", "gloss")} --example gloss -- scenes/glossy-gallery.toml {passes}`: several gather rays from gloss against
one, in pixels where the camera sees only gloss.

{told}"""


def transmittance(_work, _seconds):
    told = markdown_tables(example("transmittance"))
    return f"""## Transmittance of media that vary

`cargo run --release -p {package_of("examples", "transmittance")} --example transmittance`: rays through lumps with a mean optical depth of 20 and of 0.2.
Transmittance as a function of distance is kept and looked up by many (beams, camera segments), or used once (shadow rays).

{told}"""


def gather(_work, _seconds):
    rows = []
    for name in ["gather", "rules"]:
        said = run("cargo", "bench", "--quiet", "-p", package_of("benches", name), "--bench", name, "--", "--noplot")
        # A long name stands on a line of its own.
        for found in re.finditer(r"^(\S.*?)\s+time:\s+\[\S+ \S+ (\S+ \S+) .*?\](?:\s+thrpt:\s+\[\S+ \S+ (\S+ \S+) )?", said, re.M):
            rows.append([f"`{name}`: {found[1].strip()}", found[2], found[3] or "–"])
    return f"""## Inner loops

`cargo bench -p {package_of("benches", "gather")} --bench gather` and `--bench rules`: beams gathered along packets of camera segments in homogeneous,
constant and lumpy media; the peak of the same arithmetic, with every lane in use and no search, for each vector instruction set;
walks for a transmittance; rays and passes with and without visibility rules on every object. Elements are beam evaluations, walks
or rays.

{table(["what", "time", "elements"], rows)}"""


def farm(_work, seconds):
    passes = max(2, min(24, round(0.6 * seconds)))
    overhead = example("farm_overhead", BEAMFARM, "scenes/ocean.toml", passes).strip()
    command = example("render_overhead", BEAMFARM, 5, "scenes/ocean.toml", passes).strip()
    scale = example("farm_scale", 400, 600).strip()
    return f"""## The farm

`cargo run --release -p beamfarm-tests --example farm_overhead -- target/release/beamfarm scenes/ocean.toml {passes}`: `serve` with two
single-threaded workers, two bare processes, and one process with two threads.

```text
{overhead}
```

`cargo run --release -p beamfarm-tests --example render_overhead -- target/release/beamfarm 5 scenes/ocean.toml {passes}`: the whole command
`render` against the whole command `bench`, which renders as many passes in one process.

```text
{command}
```

`cargo run --release -p beamfarm-tests --example farm_scale -- 400 600`: simulated workers that all send blocks of 1280x720 at once, on the
same cores as the coordinator.

```text
{scale}
```
"""


def convergence(work, seconds):
    runs = max(10, round(10 * seconds))
    folder = work / "convergence"
    command = ["convergence", "tests/data/convergence.toml", "--passes", 256, "--runs", runs, "--truth", 0.592516]
    told = markdown_tables(run(BEAMFARM, *command, "-o", folder))
    return f"""## Convergence

`beamfarm convergence tests/data/convergence.toml --passes 256 --runs {runs} --truth 0.592516`: one pixel, rendered over and over; see
[method.md](method.md#does-it-converge-as-it-should). Dots are measured, lines are the theory.

![variance of a pass, variance and bias of the average](../scenes/gallery/convergence.svg)

{told}"""


def hard_cases(_work, _seconds):
    told = markdown_tables(example("hard_cases"))
    return f"""## Hard cases

`cargo run --release -p beamfarm-tests --example hard_cases`: variations of one furnace in which every point sees the same radiance; see
[method.md](method.md#what-is-hard-on-the-numbers). Time is relative to an earlier render of the first line; errors are standard
errors of the mean. There are more evaluations where kernels are wider: in early passes, and around a camera inside beams.

{told}"""


def kept(folder, name, make):
    """Text that a command has told before, or tells now."""
    path = folder / f"{name}.txt"
    if not path.exists():
        text = make()
        folder.mkdir(parents=True, exist_ok=True)
        temporary = path.with_name(path.name + ".new")
        temporary.write_text(text)
        temporary.replace(path)
    return path.read_text()


def by_engine(program, folder, path, args):
    """Rows of both engines for a scene, and the memory that its passes take on the device; made if they are not there."""
    device = ["--gpu", args.gpu] if args.gpu else []
    smaller = [part for part in args.options.split() if part]
    name = path.stem

    def explain():
        command = [program, "explain", path, "--engine", "gpu", *device, *smaller]
        return next((line for line in run(*command).splitlines() if line.startswith("engine:")), "engine: not told")

    told = kept(folder / name, "explain", explain)
    takes = re.search(r"takes (\S+ \S+?)[:,]", told)
    if not takes:
        return None, told.strip()
    output = folder / name / "bench"

    def measure():
        return run(program, "bench", path, "--engine", "gpu", "--against", "cpu", "--seconds", args.seconds, *device,
                   *smaller, "-o", output)

    kept(folder / name, "bench", measure)
    with open(output / "bench.csv", newline="") as file:
        rows = {}
        for row in csv.DictReader(file):
            # The last number of passes of each.
            rows[row["run"].split()[0]] = row
    return rows, takes[1]


def devices(args):
    """The table of a device beside processors, as far as there is time for it. Whether all of it is there."""
    program = pathlib.Path(args.program or BEAMFARM).resolve()
    folder = args.folder.resolve()
    until = time.time() + 60 * args.minutes
    wanted = args.scenes.split(",") if args.scenes else None
    paths = [path for path in sorted((ROOT / "scenes").glob("*.toml")) if wanted is None or path.stem in wanted]
    tested = kept(folder, "devices", lambda: run(program, "devices")).strip()
    rows, missing, longest = [], [], 0.0
    for path in paths:
        is_known = (folder / path.stem / "bench.txt").exists()
        if not is_known and time.time() + max(longest, 2 * args.seconds) > until:
            missing.append(path.stem)
            continue
        begun = time.time()
        found, takes = by_engine(program, folder, path, args)
        if not is_known:
            longest = max(longest, time.time() - begun)
        if found is None or not {"gpu", "cpu"} <= found.keys():
            rows.append([f"`{path.stem}`", "–", *["–"] * 6, takes])
            continue
        gpu, cpu = found["gpu"], found["cpu"]
        times = [a_pass(row, "wall_seconds") for row in (gpu, cpu)]
        errors = [row["net_rel_mse"] or row["rel_mse"] or row["estimated_rel_mse"] for row in (gpu, cpu)]
        both = all(errors) and float(errors[0]) > 0
        rows.append([
            f"`{path.stem}`", f"{gpu['width']}x{gpu['height']}", *[number(1000 * value) for value in times],
            number(times[1] / times[0]), *[number(error) for error in errors],
            number(float(errors[1]) / float(errors[0])) if both else "–", takes,
        ])
    head = ["scene", "pixels", "ms a pass, device", "processors", "ratio", "relMSE, device", "processors", "ratio",
            "memory of the device"]
    left = f"\nNot measured yet: {', '.join(missing)}.\n" if missing else ""
    text = f"""## A device against processors

`beamfarm bench scenes/NAME.toml --engine gpu --against cpu --seconds {args.seconds:g}`, each scene as in its file{
    f", with `{args.options}`" if args.options else ""}, one engine after the other on one machine. relMSE is that of the picture
after that many seconds of rendering, estimated from the differences between its passes; preparing does not count, but what the
driver compiles in the first pass does. Memory is what `explain` expects for the passes that are rendered together.

```text
{tested}
```

{table(head, rows)}{left}"""
    output = args.output or folder / "devices.md"
    output.write_text(wrapped(text))
    print(f"wrote {output}" + (f"; not measured yet: {', '.join(missing)}" if missing else ""), file=sys.stderr)
    return not missing


SECTIONS = [scenes, suite, mitsubas, scaling, alpha, budget, targeting, gloss, transmittance, gather, farm, convergence, hard_cases]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0, help="of rendering a scene, about [10]")
    parser.add_argument("--only", help="sections, by name: " + ", ".join(section.__name__ for section in SECTIONS))
    parser.add_argument("-o", "--output", type=pathlib.Path, help="[docs/measurements.md]")
    parser.add_argument("--dirty", action="store_true", help="measure files that are in no commit")
    parser.add_argument("--engine", choices=["gpu"], help="measure a device beside processors, and nothing else")
    of_devices = parser.add_argument_group("with --engine gpu")
    of_devices.add_argument("--program", type=pathlib.Path, help="beamfarm, built with the feature gpu [target/release/beamfarm]")
    of_devices.add_argument("--folder", type=pathlib.Path, default=ROOT / "target/devices", help="what is measured [target/devices]")
    of_devices.add_argument("--gpu", help="which device, as the program's option")
    of_devices.add_argument("--minutes", type=float, default=8.0, help="no scene is begun that may not be over by then [8]")
    of_devices.add_argument("--scenes", help="names, with commas between [all]")
    of_devices.add_argument("--options", default="", help="options of bench and explain, as \"--width 64 --paths 1000\"")
    args = parser.parse_args()
    if args.engine:
        # What is left is for the same command again.
        sys.exit(0 if devices(args) else 3)
    names = [section.__name__ for section in SECTIONS]
    wanted = args.only.split(",") if args.only else names
    if unknown := set(wanted) - set(names):
        parser.error(f"no section {', '.join(sorted(unknown))}")
    if args.only and not args.output:
        parser.error("--only needs --output: docs/measurements.md is made whole")
    if args.seconds <= 0:
        parser.error("--seconds must be positive")
    changed = run("git", "status", "--porcelain", quiet=True).strip()
    if changed and not args.dirty:
        parser.error("there are changes that are in no commit; --dirty measures them all the same")
    commit = run("git", "rev-parse", "--short=12", "HEAD", quiet=True).strip() + (" with changes" if changed else "")

    run("cargo", "build", "--release", "--workspace", "--quiet")
    run("cargo", "build", "--release", "--workspace", "--examples", "--quiet")
    if "gather" in wanted:
        run("cargo", "bench", "--workspace", "--benches", "--no-run", "--quiet")
    load = os.getloadavg()[0]
    begun = time.time()
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        bench(work / "machine", "scenes/sphere-caustic.toml", "--passes", 1)
        machine = json.loads((work / "machine/bench.json").read_text())["machine"]
        texts = [section(work, args.seconds) for section in SECTIONS if section.__name__ in wanted]
        minutes = (time.time() - begun) / 60
        rustc = run("rustc", "--version", quiet=True).split()[1]
        text = f"""# Measurements

Made in one go by `python3 docs/measure.py --seconds {args.seconds:g}`, from one commit on one machine. Do not edit this page: run the
command again. Figures that no command of the repository can make, such as comparisons with other programs, are in
[notes.md](notes.md), with dates.

| | |
| --- | --- |
| commit | {commit} |
| date | {datetime.date.today().isoformat()} |
| processor | {machine["cpu"]}, {machine["cores"]} usable cores; {", ".join(machine["vectors"])} |
| system | {machine["system"]}, {machine["architecture"]}, Rust {rustc} |
| load | {load:.1f} processes running or waiting in the minute before, including those of the build |
| time | {minutes:.0f} minutes, {args.seconds:g} seconds a scene |

""" + "\n".join(texts)
        output = args.output or ROOT / "docs/measurements.md"
        temporary = output.with_name(output.name + ".new")
        temporary.write_text(wrapped(text))
        if not args.only:
            figure = FIGURE.with_name(FIGURE.name + ".new")
            figure.write_bytes((work / "convergence/convergence.svg").read_bytes())
            figure.replace(FIGURE)
        temporary.replace(output)
    print(f"wrote {output}, {minutes:.0f} minutes", file=sys.stderr)


if __name__ == "__main__":
    main()
