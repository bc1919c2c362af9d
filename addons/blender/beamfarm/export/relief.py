"""What perturbs the normals of a surface: normal maps, bumps, and displacement."""

from dataclasses import replace

import numpy as np

from .arithmetic import calculate
from .graph import follow
from .nodes import Reader
from .records import inputs_of
from .values import NotShown, combine


class ReliefReader(Reader):
    """Reads what is linked to Normal and Displacement inputs."""

    def turned(self, place, name="Normal"):
        """`bump` or `normal_map` of a Normal input; None if nothing perturbs it."""
        socket = place.input(name)
        found = None if socket is None else follow(socket)
        if found is None or not found.socket.is_output:
            return None
        try:
            if found.node.type == "NORMAL_MAP":
                return self._normal_map(found)
            if found.node.type == "BUMP":
                return self._bump(found)
        except NotShown as problem:
            self.lack(found.node, str(problem))
            return None
        if found.node.type not in ("NEW_GEOMETRY", "TEX_COORD"):
            self.lack(found.node)
        return None

    def _normal_map(self, place):
        node = place.node
        if node.space != "TANGENT":
            raise NotShown(f"normals in {node.space.lower().replace('_', ' ')} space")
        value = self.get(place, "Color")
        if value.is_constant:
            return None
        strength = self.get(place, "Strength")
        if value.special is not None:
            raise NotShown("normals that are not from an image")
        if node.uv_map and value.lookup.uv_map and node.uv_map != value.lookup.uv_map:
            raise NotShown("tangents of another UV map than the image's")
        if strength.is_constant and strength.number() == 1.0 and value.source is not None and not value.source.channel:
            return {"normal_map": value}
        mixed = combine(lambda map, by: (map - FLAT) * np.maximum(by, 0.0) + FLAT, value, strength)
        return {"normal_map": mixed}

    def _bump(self, place):
        node = place.node
        below = self.turned(place)
        height = self.get(place, "Height")
        if height.is_constant:
            return below
        strength, distance = self.get(place, "Strength"), self.get(place, "Distance")
        scale, share = (-1.0 if node.invert else 1.0), 1.0
        if distance.is_constant:
            scale *= distance.number()
        else:
            height = calculate(lambda height, factor: height * factor, height, distance)
        if strength.is_constant:
            share = min(max(strength.number(), 0.0), 1.0)
        else:
            self.context.report.note(
                f"{self.owner}: a bump's strength by texture scales its height, where Blender blends the normals"
            )
            height = calculate(lambda height, factor: height * factor, height, strength)
        if scale == 0.0 or share == 0.0:
            return below
        bump = {"bump": height, "scale": scale} | ({} if share == 1.0 else {"strength": share})
        if below is None:
            return bump
        return _over(bump, below)

    def true_displacement(self, place):
        """`height`, `midlevel` and `scale` of a Displacement input; None if the report says why not."""
        found = follow(place)
        if found is None or not found.socket.is_output or found.node.mute:
            return None
        if found.node.type != "DISPLACEMENT":
            return None
        try:
            height = self.get(found, "Height")
            numbers = [self.get(found, name) for name in ("Midlevel", "Scale")]
        except NotShown:
            return None
        if not all(number.is_constant for number in numbers) or _of_mesh(height):
            return None
        midlevel, scale = (number.number() for number in numbers)
        return {"height": height, "midlevel": midlevel, "scale": scale, "in_world": found.node.space == "WORLD"}

    def displacement(self, place):
        """`bump` of a Displacement input whose material is set to "Bump Only"; None if it is flat."""
        found = follow(place)
        if found is None or not found.socket.is_output or found.node.mute:
            return None
        try:
            if found.node.type != "DISPLACEMENT":
                raise NotShown("as a displacement")
            height, scale = self.get(found, "Height"), self.get(found, "Scale")
            if height.is_constant:
                return None
            if not scale.is_constant:
                raise NotShown("a scale by texture")
        except NotShown as problem:
            self.lack(found.node, str(problem))
            return None
        turned = {"bump": height, "scale": scale.number(), "grows": found.node.space == "OBJECT"}
        return turned if scale.number() != 0.0 else None


FLAT = np.array([0.5, 0.5, 1.0], dtype=np.float32)


def displaced(reader, surface, place, method):
    """The surface with its displacement as bumps."""
    report = reader.context.report
    found = follow(place)
    if found is None or not found.socket.is_output:
        return surface
    if method != "BUMP" and surface.bsdf is not None:
        moved = reader.true_displacement(place)
        if moved is not None:
            return replace(surface, displacement=moved)
    turned = reader.displacement(place)
    if method != "BUMP":
        report.leave_out(f"displacement of {reader.owner}" + (": bumps stand in for it" if turned is not None else ""))
    if turned is None or surface.bsdf is None:
        return surface
    own = surface.turned
    surface = replace(surface, bsdf=_coats_over(reader, surface.bsdf, turned))
    if own is None:
        return replace(surface, turned=turned)
    if "normal_map" in own:
        report.leave_out(f"displacement of {reader.owner}: it has a normal map as well")
        return surface
    over = _over(own, turned)
    if turned["grows"] and "over" not in over:
        report.note(f"{reader.owner}: its bumps grow with the object's scale, as its displacement does")
    return replace(surface, turned=turned | over)


def _coats_over(reader, bsdf, turned):
    """The same for coats with their own normals over displacement that is written as bumps."""
    if "materials" in bsdf:
        return bsdf | {"materials": [_coats_over(reader, part, turned) for part in bsdf["materials"]]}
    own = bsdf.get("coat_turned")
    if own is None:
        return bsdf
    if "normal_map" in own:
        reader.context.report.leave_out(f"displacement of {reader.owner} beneath its coat, which has a normal map")
        return bsdf
    return bsdf | {"coat_turned": _over(own, turned) if own else turned}


def _of_mesh(height):
    """Whether heights depend on mesh attributes, which displacement cannot use."""
    leaves = (leaf for _, leaf in inputs_of(height) if leaf is not None)
    return any(leaf.special is not None and "attribute" in leaf.special for leaf in leaves)


def _over(upper, lower):
    """Bumps over bumps, or over a normal map. For small slopes, two perturbations equal one by the sum of the
    heights."""
    if "bump" not in lower:
        return upper | lower
    if any(key in turned for turned in (upper, lower) for key in ("strength", "over", "normal_map")):
        normals = {key: lower[key] for key in ("normal_map",) if key in lower}
        return upper | normals | {"over": {key: value for key, value in lower.items() if key not in normals}}
    share = upper["scale"] / lower["scale"]
    total = calculate(lambda below, above: below + above * share, lower["bump"].as_float(), upper["bump"].as_float())
    return {"bump": total, "scale": lower["scale"]}
