"""Renders bpy's scene with Cycles and, exported, with beamfarm, and prints how far apart the pictures are.

Used by the tests test_export_*.py. Printed for each scene: mean ratio beamfarm / Cycles by channel with its standard
error, and the block of 8 x 8 pixels that is off by most.
"""

import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass

import bpy
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "addons" / "blender" / "beamfarm"))

from export import ExportSettings, write_scene  # noqa: E402

BLOCK = 8
RUNS = 4
# How far means may differ, apart from noise, where both renderers are right.
TOLERANCE = 0.01


def program():
    """The command: BEAMFARM, or that of this checkout, or the one on PATH; None if there is none."""
    built = ROOT / "target" / "release" / "beamfarm"
    return os.environ.get("BEAMFARM") or (str(built) if built.exists() else shutil.which("beamfarm"))


def knows(table, field):
    """Whether the command's scene files have this field; `table` is the name in its schema."""
    if program() is None:
        return False
    done = subprocess.run([program(), "schema"], capture_output=True, text=True, check=True)
    return f'"{field}"' in json.dumps(json.loads(done.stdout)["definitions"].get(table, {}))


def reads(table):
    """Whether the command's scene files may have this table."""
    if program() is None:
        return False
    done = subprocess.run([program(), "schema"], capture_output=True, text=True, check=True)
    return table in json.loads(done.stdout)["properties"]


@dataclass
class Estimate:
    """Mean of independent images, with standard errors of the whole and of blocks."""

    mean: np.ndarray
    whole_error: np.ndarray
    blocks: np.ndarray
    block_error: np.ndarray

    @staticmethod
    def of(images):
        def error(values):
            return np.std(values, 0, ddof=1) / np.sqrt(len(images))

        grid = [blocks(image) for image in images]
        return Estimate(
            np.mean(images, 0), error([image.mean((0, 1)) for image in images]), np.mean(grid, 0), error(grid)
        )


def blocks(image):
    height, width = (size // BLOCK * BLOCK for size in image.shape[:2])
    cut = image[:height, :width]
    return cut.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, -1).mean((1, 3))


def read(path):
    """Linear RGB of an EXR, top row first."""
    image = bpy.data.images.load(str(path), check_existing=False)
    try:
        image.colorspace_settings.name = "Non-Color"
        width, height = image.size
        pixels = np.empty(width * height * image.channels, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        return pixels.reshape(height, width, image.channels)[::-1, :, :3].astype(np.float64)
    finally:
        bpy.data.images.remove(image)


def use_cycles(width=64, height=48, samples=256):
    """Settings under which Cycles is a plain path tracer."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.filepath = ""
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.use_persistent_data = False
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples = samples
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.use_fast_gi = False
    cycles.light_sampling_threshold = 0.0
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = 64
    cycles.transmission_bounces = cycles.volume_bounces = cycles.transparent_max_bounces = 64
    return scene


def with_cycles(folder, runs=RUNS, times=None):
    """`times`: where Cycles blurs no motion, the result is the mean of stills at these times."""
    scene = bpy.context.scene
    images = []
    for _ in range(runs):
        if times is None:
            images.append(_of_cycles(folder, len(images) + 1))
            continue
        scene.render.use_motion_blur = False
        stills = []
        for time in times:
            go_to(time)
            stills.append(_of_cycles(folder, len(images) * len(times) + len(stills) + 1))
        images.append(np.mean(stills, 0))
    return Estimate.of(images)


def _of_cycles(folder, seed):
    scene = bpy.context.scene
    scene.cycles.seed = seed
    scene.render.filepath = str(folder / f"cycles-{seed}.exr")
    bpy.ops.render.render(write_still=True)
    return read(scene.render.filepath)


@dataclass
class Exported:
    """The files and messages of an export."""

    scene: pathlib.Path
    text: str
    left_out: list
    notes: list


def go_to(time):
    """Sets the time of bpy's scene, frames."""
    whole = math.floor(time)
    bpy.context.scene.frame_set(whole, subframe=time - whole)


def export_scene(folder=None, all_frames=False, bakes=True):
    """Exports bpy's scene at its own resolution."""
    with tempfile.TemporaryDirectory() as temporary:
        render = bpy.context.scene.render
        settings = ExportSettings(render.resolution_x, render.resolution_y, bakes=bakes)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        result = write_scene(depsgraph, pathlib.Path(folder or temporary), settings, go_to, all_frames)
        return Exported(result.scene, result.scene.read_text(encoding="utf-8"), result.left_out, result.notes)


def with_beamfarm(folder, passes, runs=RUNS, arguments=()):
    result = export_scene(folder / "scene")
    images = []
    for seed in range(runs):
        output = folder / f"beamfarm-{seed}.exr"
        command = [program(), "render", str(result.scene), "-o", str(output), "--seed", str(seed + 1)]
        command += ["--passes", str(passes), "--quiet", "--workers", "1", "--threads", "2", *arguments]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise AssertionError(f"beamfarm refuses the scene:\n{done.stderr}\n{result.text}")
        images.append(read(output))
    return Estimate.of(images), result


@dataclass
class Comparison:
    """Two estimates of one picture."""

    name: str
    ours: Estimate
    theirs: Estimate
    result: object

    @property
    def ratio(self):
        return self.ours.mean.mean((0, 1)) / self.theirs.mean.mean((0, 1))

    @property
    def ratio_error(self):
        mean = self.theirs.mean.mean((0, 1))
        return np.hypot(self.ours.whole_error, self.theirs.whole_error) / np.maximum(mean, 1e-30)

    def worst_block(self):
        """The block and channel with the largest share of its allowance: place, difference over the mean, share of the
        allowance.

        The allowance is 5 standard errors (the largest of some hundreds), 4 % of the block and 2 % of the picture's
        mean: within a block, edges of shapes fall on other pixels, and beams are as wide as their radius.
        """
        mean = np.maximum(self.theirs.mean.mean((0, 1)), 1e-30)
        allowed = 5.0 * np.hypot(self.ours.block_error, self.theirs.block_error)
        allowed = allowed + 0.04 * np.abs(self.theirs.blocks) + 0.02 * mean
        off = self.ours.blocks - self.theirs.blocks
        score = np.abs(off) / allowed
        place = np.unravel_index(np.argmax(score), score.shape)
        return place, (off / mean)[place], score[place]

    def line(self):
        ratios = " ".join(f"{value:.4f}" for value in self.ratio)
        errors = " ".join(f"{value:.4f}" for value in self.ratio_error)
        place, off, score = self.worst_block()
        block = f"block {place[0]},{place[1]}: {100 * off:+.1f} % of mean ({score:.2f} of allowed)"
        return f"{self.name:36} {ratios}  +- {errors}  {block}"


def check(test, name, tolerance=TOLERANCE, blocks=1.0, **how):
    """Fails `test` if the pictures differ by more than `tolerance` and 3 standard errors, or a block by more than its
    allowance."""
    found = compare(name, **how)
    allowed = tolerance + 3.0 * found.ratio_error
    test.assertTrue((np.abs(found.ratio - 1.0) <= allowed).all(), found.line())
    test.assertLessEqual(found.worst_block()[2], blocks, found.line())
    return found.result


def compare(name, passes=16, arguments=(), keep=None, runs=RUNS, times=None):
    """Renders bpy's scene both ways; see `with_cycles`."""
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(keep or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        ours, result = with_beamfarm(folder, passes, runs, arguments)
        comparison = Comparison(name, ours, with_cycles(folder, runs, times), result)
    print(comparison.line(), flush=True)
    return comparison
