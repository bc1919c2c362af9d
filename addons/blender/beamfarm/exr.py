"""Reads the EXR files that beamfarm writes: one part, scan lines, 32-bit floats, ZIP.

Blender has other ways to read an EXR, but none that is always available (some builds lack OpenImageIO), reads from
memory and gives single channels of any name. Most of the time goes to zlib.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Collection
from concurrent.futures import ThreadPoolExecutor

import numpy as np

_MAGIC = b"\x76\x2f\x31\x01"
_FLOAT = 2
_LINES = {0: 1, 2: 1, 3: 16}  # rows per block by compression: none, ZIPS, ZIP
_MOST_PIXELS = 1 << 28
# Largest expansion of ZIP: bytes per compressed byte.
_LARGEST_RATIO = 1032
_THREADS = min(8, os.cpu_count() or 1)


class ExrError(ValueError):
    """Not such a file, or a damaged one."""


class Header:
    """The description of the pixels in a file's header."""

    def __init__(self, data: bytes) -> None:
        try:
            self._parse(data)
        except (struct.error, IndexError, OverflowError) as error:
            raise ExrError(f"damaged: {error}") from error

    def _parse(self, data: bytes) -> None:
        if data[:4] != _MAGIC:
            raise ExrError("not an OpenEXR file")
        (flags,) = struct.unpack_from("<I", data, 4)
        if flags & 0x1A00:
            raise ExrError("tiles, deep pixels and several parts are not read")
        self.attributes: dict[str, bytes] = {}
        at = 8
        while data[at : at + 1] != b"\0":
            name, at = _name(data, at)
            _, at = _name(data, at)
            (size,) = struct.unpack_from("<i", data, at)
            if size < 0 or at + 4 + size > len(data):
                raise ExrError(f"the attribute {name} reaches beyond the file")
            self.attributes[name] = data[at + 4 : at + 4 + size]
            at += 4 + size
        self.end = at + 1
        left, top, right, bottom = struct.unpack("<4i", self._needed("dataWindow"))
        self.top, self.width, self.height = top, right - left + 1, bottom - top + 1
        if self.width < 1 or self.height < 1 or self.width * self.height > _MOST_PIXELS:
            raise ExrError(f"{self.width} x {self.height} pixels")
        self.compression = self._needed("compression")[0]
        if self.compression not in _LINES:
            raise ExrError(f"compression {self.compression} is not read")
        self.channels = self._channels()
        claimed = 4 * self.width * self.height * len(self.channels)
        if claimed > _LARGEST_RATIO * len(data):
            raise ExrError(f"{claimed} bytes of pixels are claimed, which {len(data)} bytes cannot hold")

    def _needed(self, name: str) -> bytes:
        if name not in self.attributes:
            raise ExrError(f"there is no attribute {name}")
        return self.attributes[name]

    def _channels(self) -> list[str]:
        listed, at, names = self._needed("channels"), 0, []
        while listed[at : at + 1] not in (b"\0", b""):
            name, at = _name(listed, at)
            kind, _, x, y = struct.unpack_from("<i4s2i", listed, at)
            if (kind, x, y) != (_FLOAT, 1, 1):
                raise ExrError(f"the channel {name} is not one of whole 32-bit floats")
            names.append(name)
            at += 16
        return names


def _name(data: bytes, at: int) -> tuple[str, int]:
    end = data.find(b"\0", at)
    if end < 0:
        raise ExrError("ends within the header")
    return data[at:end].decode("utf-8", "replace"), end + 1


def read(data: bytes, wanted: Collection[str] | None = None) -> dict[str, np.ndarray]:
    """Channels by name, those of `wanted` or all, each of shape (height, width), the first row at the bottom.

    The file has the rows in the opposite order: Blender counts them from the bottom.
    """
    try:
        return _read(data, wanted)
    except (struct.error, zlib.error, IndexError, ValueError, OverflowError) as error:
        raise error if isinstance(error, ExrError) else ExrError(f"damaged: {error}") from error


def _read(data: bytes, wanted: Collection[str] | None) -> dict[str, np.ndarray]:
    header = Header(data)
    width, height, names = header.width, header.height, header.channels
    picked = [(place, name) for place, name in enumerate(names) if wanted is None or name in wanted]
    channels = {name: np.empty((height, width), np.float32) for _, name in picked}
    rows_of_block = _LINES[header.compression]
    count = -(-height // rows_of_block)

    def take(offset: int) -> None:
        line, size = struct.unpack_from("<ii", data, offset)
        row = line - header.top
        if not 0 <= row < height or size < 0:
            raise ExrError(f"a block at row {row}")
        rows = min(rows_of_block, height - row)
        shape = rows, len(names), width
        packed = data[offset + 8 : offset + 8 + size]
        values = np.frombuffer(_unpacked(packed, 4 * rows * len(names) * width), "<f4").reshape(shape)
        bottom = height - row
        for place, name in picked:
            channels[name][bottom - rows : bottom] = values[::-1, place]

    # Blocks are independent, and everything slow here releases the interpreter lock.
    with ThreadPoolExecutor(max_workers=min(_THREADS, count)) as pool:
        for _ in pool.map(take, struct.unpack_from(f"<{count}Q", data, header.end)):
            pass
    return channels


def _unpacked(packed: bytes, size: int) -> np.ndarray:
    """OpenEXR's ZIP: byte differences, with even and odd bytes separated. Data that would grow are stored."""
    if len(packed) == size:
        return np.frombuffer(packed, np.uint8)
    # One byte more than allowed: anything larger is not unpacked further.
    raw = np.frombuffer(zlib.decompressobj().decompress(packed, size + 1), np.uint8)
    if len(raw) != size:
        raise ExrError(f"a block without the {size} bytes that it claims")
    # Each byte is the previous one plus this one minus 128, modulo 256; the first one is itself.
    steps = raw + np.uint8(128)
    steps[0] = raw[0]
    apart = np.add.accumulate(steps, dtype=np.uint8)
    together = np.empty(size, np.uint8)
    half = (size + 1) // 2
    together[0::2] = apart[:half]
    together[1::2] = apart[half:]
    return together


def passes(data: bytes) -> int | None:
    """How many passes a picture is made of, if it says so."""
    said = Header(data).attributes.get("beamfarmPasses", b"")
    return int(said) if said.isdigit() else None


def manifests(data: bytes) -> dict[str, str]:
    """JSON of names and ids for each Cryptomatte, by its name."""
    said = Header(data).attributes
    found = {}
    for key, value in said.items():
        if key.startswith("cryptomatte/") and key.endswith("/name"):
            manifest = said.get(key.removesuffix("name") + "manifest", b"{}")
            found[value.decode("utf-8", "replace")] = manifest.decode("utf-8", "replace")
    return found
