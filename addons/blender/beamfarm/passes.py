"""Blender's render passes, and the layers of beamfarm that they come from."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class RenderPass:
    """A pass: `name`, channels (`X` of `XYZ` and so on) and kind as in Blender, and its source."""

    name: str
    channels: str
    kind: str
    aov: str
    """Its value for `--aov`."""
    layer: str
    """Name of the layer in the EXR."""

    @property
    def sources(self) -> list[str]:
        """Channels of the EXR, one for each channel of this pass."""
        return [f"{self.layer}.{channel}" for channel in self.channels]


DEPTH = RenderPass("Depth", "Z", "VALUE", "depth", "depth")
NORMAL = RenderPass("Normal", "XYZ", "VECTOR", "normal", "normal")
# Names that the compositor's node "Denoise" and users look for.
DENOISING_ALBEDO = RenderPass("Denoising Albedo", "RGB", "COLOR", "albedo", "albedo")
DENOISING_NORMAL = RenderPass("Denoising Normal", "XYZ", "VECTOR", "normal", "normal")
DIRECT = RenderPass("Direct", "RGB", "COLOR", "direct", "direct")
INDIRECT = RenderPass("Indirect", "RGB", "COLOR", "surface", "surface")
VOLUME = RenderPass("Volume", "RGB", "COLOR", "volume", "volume")
STANDARD_ERROR = RenderPass("Standard Error", "RGB", "COLOR", "stderr", "stderr")

COMBINED = ("R", "G", "B")
ALPHA, ALPHA_AOV = "A", "alpha"

# Passes of four numbers, two ids with their coverage, that the command writes for each Cryptomatte.
CRYPTOMATTE_PASSES = 3

# The renderer's limits for names of light groups.
_GROUP_CHARACTERS = 64
_NO_PLAIN = re.compile(r"[^0-9A-Za-z_\-+#:\[\]() ]")


def light_group(name: str) -> RenderPass:
    """The pass of a light group, named as in Cycles."""
    layer = _NO_PLAIN.sub("_", name[:_GROUP_CHARACTERS]) or "_"
    return RenderPass(f"Combined_{name}", "RGB", "COLOR", "lights", f"light_{layer}")


def cryptomatte(kind: str, number: int) -> RenderPass:
    """A pass of a Cryptomatte, `Object` or `Material`, named as in Cycles."""
    name = f"Crypto{kind}{number:02}"
    return RenderPass(name, "RGBA", "COLOR", f"crypto_{kind.lower()}", name)


def cryptomattes(view_layer) -> list[str]:
    """The enabled kinds."""
    ticked = {"Object": view_layer.use_pass_cryptomatte_object, "Material": view_layer.use_pass_cryptomatte_material}
    return [kind for kind, is_ticked in ticked.items() if is_ticked]


def of_layer(view_layer) -> Iterator[RenderPass]:
    """The passes enabled for a view layer."""
    if view_layer.use_pass_z:
        yield DEPTH
    if view_layer.use_pass_normal:
        yield NORMAL
    own = view_layer.beamfarm
    if own.use_denoising:
        yield DENOISING_ALBEDO
        yield DENOISING_NORMAL
    if own.use_direct:
        yield DIRECT
    if own.use_indirect:
        yield INDIRECT
    if own.use_volume:
        yield VOLUME
    if own.use_standard_error:
        yield STANDARD_ERROR
    if own.use_light_groups:
        for group in view_layer.lightgroups:
            yield light_group(group.name)
    # A pass holds two levels.
    count = min((view_layer.pass_cryptomatte_depth + 1) // 2, CRYPTOMATTE_PASSES)
    for kind in cryptomattes(view_layer):
        for number in range(count):
            yield cryptomatte(kind, number)


def aov(passes: list[RenderPass], has_alpha: bool = False) -> list[str]:
    """Options of the command that render these passes, and alpha."""
    names = list(dict.fromkeys([render_pass.aov for render_pass in passes] + [ALPHA_AOV] * has_alpha))
    return ["--aov", ",".join(names)] if names else []
