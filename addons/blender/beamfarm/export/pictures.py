"""Images of Blender as files of the scene: copied where possible, otherwise written as OpenEXR."""

import os
import struct

import numpy as np

from .names import file_name

SIGNATURES = [(b"\x89PNG\r\n\x1a\n", ".png"), (b"\xff\xd8\xff", ".jpg"), (b"\x76\x2f\x31\x01", ".exr"), (b"#?", ".hdr")]
LINEAR = {"Linear", "Linear Rec.709", "Linear BT.709 I-D65", "scene_linear", "Raw", "Non-Color", "Generic Data"}
SRGB = {"sRGB", "sRGB OETF"}


def pixels(image, times_alpha=False):
    """Linear RGBA of an image, bottom row first, (height, width, 4) of floats; None if it has no pixels.

    `times_alpha`: encoded colours are first multiplied by alpha.
    """
    width, height = image.size
    if width == 0 or height == 0:
        return None
    channels = image.channels
    values = np.empty(width * height * channels, dtype=np.float32)
    image.pixels.foreach_get(values)
    values = values.reshape(height, width, channels)
    if channels == 1:
        values = np.repeat(values, 3, axis=2)
    if values.shape[2] == 2:
        values = np.concatenate([np.repeat(values[..., :1], 3, axis=2), values[..., 1:]], axis=2)
    if values.shape[2] == 3:
        values = np.concatenate([values, np.ones((height, width, 1), dtype=np.float32)], axis=2)
    if times_alpha:
        values = np.concatenate([values[..., :3] * values[..., 3:], values[..., 3:]], axis=2)
    if not image.is_float and image.colorspace_settings.name not in LINEAR:
        values = np.concatenate([to_linear(values[..., :3]), values[..., 3:]], axis=2)
    return values


def to_linear(values):
    """Linear values from sRGB-encoded ones."""
    low = values / 12.92
    high = ((np.maximum(values, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(values <= 0.04045, low, high).astype(np.float32)


def exr(values, half=False):
    """Bytes of an OpenEXR of (height, width, 3) or (height, width) numbers, bottom row first, not compressed.

    Format: https://openexr.com/en/latest/OpenEXRFileLayout.html
    """
    values = np.asarray(values, dtype=np.float32)[::-1]
    names = "Y" if values.ndim == 2 else "BGR"
    planes = values[..., None] if values.ndim == 2 else values[..., ::-1]
    height, width, _ = planes.shape
    kind = 1 if half else 2
    channels = b"".join(name.encode() + struct.pack("<xiiii", kind, 0, 1, 1) for name in names) + b"\0"
    box = struct.pack("<iiii", 0, 0, width - 1, height - 1)
    attributes = [
        ("channels", "chlist", channels),
        ("compression", "compression", b"\0"),
        ("dataWindow", "box2i", box),
        ("displayWindow", "box2i", box),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<ff", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
    ]
    header = b"\x76\x2f\x31\x01" + struct.pack("<i", 2)
    for name, form, content in attributes:
        header += name.encode() + b"\0" + form.encode() + b"\0" + struct.pack("<i", len(content)) + content
    header += b"\0"
    rows = np.ascontiguousarray(planes.transpose(0, 2, 1), dtype="<f2" if half else "<f4")
    size = rows[0].nbytes
    begin = len(header) + 8 * height
    offsets = (begin + np.arange(height, dtype="<u8") * (size + 8)).astype("<u8").tobytes()
    lines = b"".join(struct.pack("<ii", y, size) + rows[y].tobytes() for y in range(height))
    return header + offsets + lines


class Pictures:
    """Writes images, each once; keeps the files until an image changes."""

    def __init__(self, files):
        self.files = files
        self._kept = {}

    def file(self, image, path, report):
        """(path in the scene's folder, raw) of an image, whose own file is `path`; None without pixels."""
        state = _state(image, path)
        kept = self._kept.get((image.original.session_uid, path))
        if kept is not None and kept[0] == state and state is not None:
            self.files.use(kept[1][0])
            return kept[1]
        written = self._write(image, path, report)
        if written is not None:
            self._kept[image.original.session_uid, path] = state, written
        return written

    def _write(self, image, path, report):
        stem = file_name(image.name.rsplit(".", 1)[0])
        space = image.colorspace_settings.name
        content = None if image.is_dirty else _bytes(image, path)
        ending = next((ending for start, ending in SIGNATURES if content and content.startswith(start)), None)
        if ending in (".png", ".jpg") and (space in SRGB or space in LINEAR):
            return self.files.put("textures", stem, ending, content), space in LINEAR
        if space not in SRGB and space not in LINEAR:
            report.note(f"image '{image.name}': colour space '{space}' is taken as Blender converts it")
        values = pixels(image)
        if values is None:
            return None
        colors = values[..., :3]
        if not np.isfinite(colors).all() or (colors < 0.0).any():
            report.note(f"image '{image.name}': numbers below 0 or not finite are taken as 0")
            colors = np.maximum(np.nan_to_num(colors, nan=0.0, posinf=0.0, neginf=0.0), 0.0)
        elif ending == ".hdr" and space in LINEAR:
            return self.files.put("textures", stem, ending, content), False
        return self.files.put("textures", stem, ".exr", exr(colors)), False

    def is_see_through(self, image, path):
        """Whether Cycles multiplies an image's colours by alpha, which it does unless alpha is used as well."""
        if image.alpha_mode != "STRAIGHT" or image.channels != 4 or image.is_float:
            return False
        if image.colorspace_settings.name in LINEAR:
            return False
        state, key = _state(image, path), (image.original.session_uid, path, "alpha")
        if state is None or self._kept.get(key, (None,))[0] != state:
            self._kept[key] = state, bool((pixels(image)[..., 3] < 1.0).any())
        return self._kept[key][1]

    def baked(self, name, values):
        """Path of an EXR with baked values, which belong to no image of Blender."""
        return self.files.put("textures", file_name(name), ".exr", exr(np.maximum(np.nan_to_num(values), 0.0)))


def _bytes(image, path):
    if image.source not in ("FILE", "SEQUENCE"):
        return None
    if image.packed_file is not None:
        return bytes(image.packed_file.data)
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError:
        return None


def _state(image, path):
    """The state that changes with an image; None for one that may change at any time."""
    if image.is_dirty:
        return None
    space = image.colorspace_settings.name
    if image.packed_file is not None:
        return space, image.packed_file.size
    if image.source == "GENERATED":
        return space, image.generated_type, tuple(image.size), tuple(image.generated_color)
    try:
        there = os.stat(path)
        return space, there.st_mtime_ns, there.st_size
    except OSError:
        return None
