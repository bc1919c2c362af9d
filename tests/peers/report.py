"""The report as Markdown, and a sheet of pictures for each scene."""

import datetime
import io
import pathlib
import platform

import numpy as np
from PIL import Image, ImageDraw, ImageFont

import measure
from scenes import SCENES

NAMES = {"beamfarm": "beamfarm", "mitsuba": "Mitsuba", "luxcore": "LuxCore", "cycles": "Cycles"}
CELL = 224


def machine():
    lines = pathlib.Path("/proc/cpuinfo").read_text().splitlines() if pathlib.Path("/proc/cpuinfo").exists() else []
    models = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


def number(value):
    """Two digits, as 3.1e-4 or 0.28."""
    return f"{value:.2g}" if 0.01 <= value < 100 else f"{value:.1e}".replace("e-0", "e-").replace("e+0", "e")


def duration(points, error):
    seconds, guessed = measure.seconds_to(points, error)
    if seconds > 100 * points[-1][0]:
        return f"> {100 * points[-1][0]:,.0f} s"
    digits = seconds if seconds == 0 else round(seconds, 1 - int(np.floor(np.log10(seconds))))
    return f"{'≈ ' if guessed else ''}{digits:,.{0 if digits >= 10 else 1}f} s"


def table(result, reference):
    """Rows of one scene, and what times are to."""
    rows, points = [], {}
    for kind in ("runs", "denoised"):
        for name, runs in result[kind].items():
            for seconds, run in runs.items():
                image = measure.read(run["file"])
                errors = reference.errors(image)
                rows.append((kind, name, seconds, run, errors, image.mean() / reference.image.mean()))
                if kind == "runs":
                    points.setdefault(name, []).append((run["seconds"], *errors))
    out = ["| renderer | seconds | relMSE | without the worst 0.1 % | mean | time to error A | to error B | |",
           "| --- | --: | --: | --: | --: | --: | --: | --- |"]
    common = points["beamfarm"][0][1:] if "beamfarm" in points else None
    for kind, name, seconds, run, errors, mean in rows:
        times = ["", ""]
        if kind == "runs" and common and seconds == max(result[kind][name]):
            times = [duration([(p[0], p[1 + i]) for p in points[name]], common[i]) for i in range(2)]
        out.append(f"| {NAMES[name]}{', denoised' if kind == 'denoised' else ''} | {run['seconds']:.1f} | "
                   f"{number(errors[0])} | {number(errors[1])} | {mean:.3f} | {times[0]} | {times[1]} | "
                   f"{run['note']} |")
    return out, common


def shown(image, exposure):
    x = np.clip(image * 2**exposure, 0, 1)
    x = np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055)
    return Image.fromarray((x * 255 + 0.5).astype(np.uint8))


def sheet(file, scene, result, reference):
    """Reference and last pictures above; denoised and first ones below. Each with its enlarged part and its name."""
    first, last = [], [("reference", reference.image)]
    for name, runs in result["denoised"].items():
        for run in [runs[seconds] for seconds in sorted(runs)[-1:]]:
            first.append((f"{NAMES[name]}, denoised, {run['seconds']:.1f} s", measure.read(run["file"])))
    for name, runs in result["runs"].items():
        for row, seconds in ((last, max(runs)), (first, min(runs))) if runs else []:
            row.append((f"{NAMES[name]}, {runs[seconds]['seconds']:.1f} s", measure.read(runs[seconds]["file"])))
    columns, gap, high = max(len(first), len(last)), 4, 2 * CELL + 26
    page = Image.new("RGB", (columns * (CELL + gap) - gap, 2 * high), "white")
    font = ImageFont.load_default(14)
    for j, row in enumerate((last, first)):
        for i, (name, image) in enumerate(row):
            picture, x, y = shown(image, scene.exposure), i * (CELL + gap), j * high
            left, top, side = (round(part * picture.width) for part in scene.crop)
            page.paste(picture.resize((CELL, CELL), Image.LANCZOS), (x, y))
            part = picture.crop((left, top, left + side, top + side)).resize((CELL, CELL), Image.NEAREST)
            page.paste(part, (x, y + CELL + 2))
            ImageDraw.Draw(page).text((x + 2, y + 2 * CELL + 5), name, "black", font)
    page.save(file.with_suffix(".png"))
    for quality in range(90, 20, -5):
        data = io.BytesIO()
        page.save(data, "WEBP", quality=quality, method=6)
        if data.tell() <= 250_000:
            break
    file.with_suffix(".webp").write_bytes(data.getvalue())


def write(bench, versions, results):
    folder, options = bench.folder, bench.options
    (folder / "peers").mkdir(exist_ok=True)
    out = ["# beamfarm and other renderers", "",
           "The scenes, what is measured and what is fair about it: [tests/peers](../tests/peers/README.md), whose "
           "`run.py` makes this page.", "",
           f"{datetime.date.today()}, {machine()}, {options.threads} threads, {options.size} x {options.size} pixels. "
           + "; ".join(versions.values()) + ".", "",
           "Errors A and B are those of beamfarm after the first of its times; ≈: extrapolated. `mean` is the "
           "picture's over the reference's. Seconds of denoised pictures include the denoising."]
    for name, why in bench.problems.items():
        out += ["", f"**{name}** was left out: {why}"]
    for name, result in results.items():
        scene, reference = SCENES[name], result["reference"]
        out += ["", f"## {name}", "", scene.title + ".", ""]
        for peer, check in result["checks"].items():
            out.append(f"- Check of {NAMES[peer]}: {check or 'failed to render'}."
                       + ("" if check and check.usable else " It was not timed."))
        if reference is None:
            out += ["", "There is no reference."]
            continue
        line = (f"- Reference: beamfarm, twice {options.reference_seconds:g} s; relMSE of its own noise "
                f"{number(reference.noise.mean())}.")
        if reference.witness:
            peer, seconds, agreement = reference.witness
            line += f" {NAMES[peer]} after {seconds:g} s: {agreement}."
        rows, common = table(result, reference)
        if any(check and check.usable and not check.good for check in result["checks"].values()):
            line += "\n- Where it is not quite the same, an error of about the square of the difference remains."
        out += [line, "", *rows]
        if common:
            out += ["", f"A is a relMSE of {number(common[0])}; B is one of {number(common[1])} without the worst "
                        "0.1 %."]
        sheet(folder / "peers" / name, scene, result, reference)
        out += ["", f"![{scene.title}, side by side](peers/{name}.webp)"]
    file = folder / "report.md"
    file.with_suffix(".part").write_text("\n".join(out) + "\n")
    file.with_suffix(".part").replace(file)
    print(file)
