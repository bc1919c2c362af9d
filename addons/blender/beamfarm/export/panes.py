"""Glass on surfaces that enclose nothing: panes, for example windows made of one plane.

Light would never leave the inside of a single boundary of glass: seen from outside, everything behind it would be
squeezed together, seen from inside spread, and its brightness would change by the square of the index.
"""

import numpy as np

from .arithmetic import calculate
from .values import NotShown, constant, is_white

SOLID = {"dielectric", "rough_dielectric"}
KEPT = ("specular_reflectance", "specular_transmittance")


def pane_of(bsdf):
    """Fields of the material with panes in place of solid glass; None if it has no glass."""
    if bsdf is None:
        return None
    if bsdf["type"] == "blend":
        panes = [pane_of(part) for part in bsdf["materials"]]
        if not any(panes):
            return None
        return bsdf | {"materials": [pane or part for pane, part in zip(panes, bsdf["materials"])]}
    if bsdf["type"] in SOLID:
        return _pane(bsdf["ior"]) | {name: bsdf[name] for name in KEPT if name in bsdf}
    return _partly(bsdf) if "spec_trans" in bsdf else None


def is_rough(bsdf):
    """Whether it contains glass that is not smooth."""
    if bsdf["type"] == "blend":
        return any(is_rough(part) for part in bsdf["materials"])
    if bsdf["type"] == "principled" and "spec_trans" in bsdf:
        rough = bsdf["roughness"]
        return not (rough.is_constant and rough.number() ** 2 < 0.001)
    return bsdf["type"] == "rough_dielectric"


def _pane(ior):
    # On a single plane the index may be that of the inside against the outside or the reverse.
    return {"type": "thin_dielectric", "ior": max(ior, 1.0 / ior)}


def _partly(bsdf):
    """A principled material that is partly glass: a blend of the rest with a pane."""
    share = bsdf["spec_trans"]
    rest = {name: value for name, value in bsdf.items() if name != "spec_trans"} | {"two_sided": True}
    pane, base, metallic = _pane(bsdf["ior"]), bsdf["base_color"], bsdf["metallic"]
    try:
        if not is_white(base):
            pane["specular_transmittance"] = calculate(lambda base: np.sqrt(np.clip(base, 0.0, 1.0)), base)
    except NotShown:
        pane["specular_transmittance"] = base
    if not _is_zero(metallic):
        try:
            # Metal comes first; glass takes its share of the rest.
            glass = calculate(lambda share, metal: share * (1.0 - metal), share, metallic)
            rest["metallic"] = calculate(
                lambda glass, metal: np.clip(metal / np.maximum(1.0 - glass, 1e-6), 0.0, 1.0), glass, metallic
            )
            share = glass
        except NotShown:
            rest["metallic"] = constant(0.0)
    if share.is_constant and share.number() >= 1.0:
        return pane
    return {"type": "blend", "weight": share, "materials": [rest, pane]}


def _is_zero(value):
    return value.is_constant and value.number() == 0.0


class Panes:
    """The objects on which a material acts as panes, for notes."""

    def __init__(self):
        self._names = {}

    def add(self, slot, name):
        """Records an object on which the `materials.Slot` of a solid is a pane."""
        self._names.setdefault((slot.material, slot.pane.is_rough), {})[name] = None

    def tell(self, report):
        for (material, is_rough), names in self._names.items():
            names = list(names)
            more = f" and {len(names) - SHOWN} more" if len(names) > SHOWN else ""
            where = ", ".join(f"'{name}'" for name in names[:SHOWN]) + more
            smooth = ", as if it were smooth" if is_rough else ""
            report.note(f"the glass of material '{material}' is a thin pane{smooth} on {where}: meshes that are not "
                        "closed hold no glass; a Solidify modifier closes them")


SHOWN = 3
