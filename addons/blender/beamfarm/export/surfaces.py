"""Shader nodes of surfaces as materials."""

from dataclasses import dataclass, replace

import numpy as np

from . import subsurface, tangents
from .arithmetic import calculate, is_graph, scaled
from .gloss import constant_of, dielectric, is_smooth, keeps_energy
from .graph import Place, follow, output_node
from .hair import hair
from .nodes import Reader, fresnel_index
from .principled import film_over, principled
from .records import inputs_of
from .sheen import diffuse as diffuse_sheen
from .sheen import sheen
from .texture_nodes import GRAPHS
from .values import NotShown, Value, combine, constant, is_black, is_white


@dataclass
class Surface:
    """What light that meets a surface does there."""

    bsdf: dict | None = None
    """Fields of a material, values being `Value`; None absorbs all light."""
    opacity: Value = None
    """Share of the light that meets it at all."""
    emission: Value | None = None
    """Radiance."""
    turned: dict | None = None
    """`bump` or `normal_map`."""
    wants: tuple = ()
    """Outputs of nodes that are to be baked."""
    displacement: dict | None = None
    """`height`, a `Value`, `midlevel`, `scale`, and whether these are lengths of the world."""


def opaque(bsdf, emission=None, turned=None):
    return Surface(bsdf, constant(1.0), emission, turned)


BLACK = {"type": "diffuse", "reflectance": constant(0.0, 0.0, 0.0), "two_sided": True}


class SurfaceReader(Reader):
    """Reads the shader nodes of one material."""

    graphs = GRAPHS
    sees_surface = True

    def surface(self, place):
        """Surface of a shader socket."""
        found = follow(place)
        if found is None or not found.socket.is_output or found.node.mute:
            return opaque(None)
        if found.socket.type != "SHADER":
            # A colour in the place of a shader shines.
            return opaque(None, emission=scaled(self.value(place).as_color(), constant(1.0)))
        handler = SHADERS.get(found.node.type)
        if handler is None:
            self.lack(found.node)
            return opaque(None)
        return handler(self, found)

    def shader(self, place, name_or_index):
        sockets = place.node.inputs
        socket = sockets[name_or_index]
        return self.surface(Place(socket, place.groups))

    def turned(self, place, name="Normal"):
        """`bump` or `normal_map` of a Normal input; None where nothing turns it."""
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
            raise NotShown("normals that are no image")
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
        """`height`, `midlevel` and `scale` of a Displacement input; None where the report says why not."""
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
        """`bump` of a Displacement input whose material is set to "Bump Only"; None where it is flat."""
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


def _diffuse(reader, place):
    rough = reader.get(place, "Roughness")
    bsdf = {"type": "diffuse", "reflectance": reader.get(place, "Color"), "two_sided": True}
    if not rough.is_constant or rough.number() != 0.0:
        bsdf["roughness"] = rough
    return opaque(bsdf, turned=reader.turned(place))


def _translucent(reader, place):
    color = reader.get(place, "Color")
    bsdf = {"type": "translucent", "reflectance": constant(0.0, 0.0, 0.0), "transmittance": color}
    return opaque(bsdf, turned=reader.turned(place))


def _subsurface(reader, place):
    return opaque(subsurface.node(reader, place), turned=reader.turned(place))


def _glossy(reader, place):
    turned = reader.turned(place)
    color, rough = reader.get(place, "Color"), reader.get(place, "Roughness")
    if is_smooth(rough):
        return opaque({"type": "mirror", "reflectance": color, "two_sided": True}, turned=turned)
    # eta = 0 and k = 1 reflect everything at every angle.
    bsdf = {"type": "rough_conductor", "eta": 0.0, "k": 1.0, "reflectance": color, "two_sided": True}
    if not keeps_energy(place.node):
        bsdf["multiple_scattering"] = False
    return opaque(bsdf | tangents.of_glossy(reader, place, rough), turned=turned)


def _glass(reader, place):
    color, rough, ior = (reader.get(place, name) for name in ("Color", "Roughness", "IOR"))
    film = film_over(reader, place)
    if not film:
        return opaque(dielectric(reader, place, rough, ior, color, color), turned=reader.turned(place))
    if not is_white(color):
        reader.context.report.note(f"{reader.owner}: what glass beneath a film reflects is white")
    bsdf = {
        "type": "principled",
        "base_color": calculate(lambda c: np.clip(c, 0.0, 1.0) ** 2, color),
        "roughness": rough,
        "ior": max(constant_of(reader, place, ior, "IOR", 1.45), 1.0001),
        "spec_trans": constant(1.0),
    }
    if not keeps_energy(place.node):
        bsdf["multiple_scattering"] = False
    return opaque(bsdf | film, turned=reader.turned(place))


def _refraction(reader, place):
    color, rough, ior = (reader.get(place, name) for name in ("Color", "Roughness", "IOR"))
    bsdf = dielectric(reader, place, rough, ior, constant(0.0, 0.0, 0.0), color)
    reader.context.report.note(f"{reader.owner}: what Fresnel's law reflects is taken off '{place.node.name}'")
    return opaque(bsdf, turned=reader.turned(place))


def _transparent(reader, place):
    color = reader.get(place, "Color")
    if is_white(color):
        return Surface(None, constant(0.0))
    if is_black(color):
        return opaque(None)
    return opaque({"type": "thin_dielectric", "ior": 1.0, "specular_transmittance": color})


def _emission(reader, place):
    strength = reader.get(place, "Strength")
    return opaque(None, emission=scaled(reader.get(place, "Color"), strength))


def _sheen(reader, place):
    turned = reader.turned(place)
    return opaque(sheen(reader, place), turned=turned)


def _hair(reader, place):
    return opaque(hair(reader, place))


def _sum(a, b):
    if a is None or b is None:
        return a if b is None else b
    return calculate(lambda a, b: a + b, a, b)


def _inverse(value):
    return calculate(lambda value: 1.0 - value, value)


def _times(a, b):
    if a.is_constant and a.number() == 1.0:
        return b
    if b.is_constant and b.number() == 1.0:
        return a
    return calculate(lambda a, b: a * b, a, b)


def _by_fresnel(reader, place):
    """Surface of two shaders mixed by Fresnel's law, where they are what one material of the scene file is."""
    factor, *parts = (follow(Place(socket, place.groups)) for socket in place.node.inputs[:3])
    if any(part is None or not part.socket.is_output or part.node.mute for part in (factor, *parts)):
        return None
    index = fresnel_index(reader, factor)
    base, coat = parts
    if index is None or index <= 1.0 or coat.node.type not in ("BSDF_GLOSSY", "BSDF_ANISOTROPIC"):
        return None
    if base.node.type == "BSDF_REFRACTION":
        return _glass_of_two(reader, index, base, coat)
    return _plastic_of_two(reader, index, base, coat) if base.node.type == "BSDF_DIFFUSE" else None


def _glass_of_two(reader, index, base, coat):
    inner, rough = reader.get(base, "IOR"), reader.get(base, "Roughness")
    shine = reader.get(coat, "Roughness")
    if not inner.is_constant or abs(inner.number() - index) > 0.01:
        note = f"{reader.owner}: refracts and reflects by the index {index:.3g} of its Fresnel node"
        reader.context.report.note(note)
    if not (rough.is_constant and shine.is_constant and abs(rough.number() - shine.number()) < 1e-3):
        reader.context.report.note(f"{reader.owner}: reflects with the roughness with which it refracts")
    _leave_out_anisotropy(reader, coat)
    bsdf = dielectric(reader, base, rough, constant(index), reader.get(coat, "Color"), reader.get(base, "Color"))
    return opaque(bsdf, turned=reader.turned(base) or reader.turned(coat))


def _leave_out_anisotropy(reader, coat):
    if not tangents.is_even(reader.get(coat, "Anisotropy")):
        reader.context.report.leave_out(f"anisotropy of node '{coat.node.name}' of {reader.owner}")


def _plastic_of_two(reader, index, base, coat):
    rough = reader.get(coat, "Roughness")
    if not rough.is_constant or rough.number() > PLASTIC_ROUGHNESS:
        return None
    _leave_out_anisotropy(reader, coat)
    rough_base = reader.get(base, "Roughness")
    if not rough_base.is_constant or rough_base.number() != 0.0:
        reader.context.report.note(f"{reader.owner}: the roughness of '{base.node.name}' does not count below a coat")
    color, shine = reader.get(base, "Color"), reader.get(coat, "Color")
    bsdf = {"type": "plastic", "ior": index, "reflectance": color, "two_sided": True}
    if not is_white(shine):
        bsdf["specular_reflectance"] = shine
    if not is_smooth(rough):
        alpha = rough.number() ** 2
        bsdf |= {"type": "rough_plastic", "alpha": alpha}
        if getattr(coat.node, "distribution", "GGX") == "BECKMANN":
            bsdf["distribution"] = "beckmann"
    reader.context.report.note(f"{reader.owner}: diffuse and glossy mixed by Fresnel's law count as plastic")
    turned = reader.turned(base) or reader.turned(coat)
    return opaque(bsdf, turned=turned)


# Above it the scene file's plastic keeps too much of the light.
PLASTIC_ROUGHNESS = 0.3


def _mix(reader, place):
    try:
        whole = _by_fresnel(reader, place)
    except NotShown:
        whole = None
    if whole is not None:
        return whole
    factor = _factor(reader, place)
    if factor.is_constant:
        share = min(max(factor.number(), 0.0), 1.0)
        factor = constant(share)
        if share in (0.0, 1.0):
            return reader.shader(place, 2 if share == 1.0 else 1)
    a, b = reader.shader(place, 1), reader.shader(place, 2)
    try:
        return mixed(reader, factor, a, b)
    except NotShown as problem:
        reader.lack(place.node, str(problem))
        return a


def _factor(reader, place):
    """Share of the second shader of a mix."""
    socket = Place(place.node.inputs[0], place.groups)
    found = follow(socket)
    if found is not None and found.node.type == "LIGHT_PATH" and found.socket.name == "Is Shadow Ray":
        reader.context.report.note(f"{reader.owner}: what lets light through for its shadow alone stands in for "
                                   "caustics, which there are here")
        return constant(0.0)
    return reader.value(socket).as_float()


def mixed(reader, factor, a, b):
    """`factor` of `b`, the rest of `a`."""
    rest = _inverse(factor)
    opacity = _opacity(factor, rest, a.opacity, b.opacity)
    emission = _sum(scaled(a.emission, rest), scaled(b.emission, factor))
    turned = _one_turned(reader, a, b)
    for one, other in ((a, b), (b, a)):
        if other.opacity.is_constant and other.opacity.number() == 0.0:
            return Surface(one.bsdf, opacity, emission, turned)
    if a.bsdf is None and b.bsdf is None:
        return Surface(None, opacity, emission, turned)
    weight = factor
    if not (_is_one(a.opacity) and _is_one(b.opacity)):
        weight = calculate(
            lambda f, a, b: f * b / np.maximum(f * b + (1.0 - f) * a, 1e-12), factor, a.opacity, b.opacity
        )
    second = b.bsdf
    if subsurface.is_in(a.bsdf) and subsurface.is_in(second):
        reader.context.report.leave_out(f"subsurface scattering of the second shader in a mix of {reader.owner}")
        second = subsurface.without(second)
    blend = {"type": "blend", "weight": weight, "materials": [a.bsdf or BLACK, second or BLACK]}
    return Surface(_simple(blend), opacity, emission, turned)


def _simple(blend):
    """Two diffuse materials of constant colours are one."""
    a, b = blend["materials"]
    weight = blend["weight"]
    is_smooth = not ("roughness" in a or "roughness" in b)
    if a["type"] == b["type"] == "diffuse" and is_smooth and not (a["reflectance"].special or b["reflectance"].special):
        try:
            mix = combine(lambda a, b, f: a * (1.0 - f) + b * f, a["reflectance"], b["reflectance"], weight)
        except NotShown:
            return blend
        return {"type": "diffuse", "reflectance": mix, "two_sided": True}
    return blend


def _is_one(value):
    return value.is_constant and value.number() == 1.0


def _opacity(factor, rest, a, b):
    if _is_one(a) and _is_one(b):
        return a
    if a.is_constant and a.number() == 0.0:
        return _times(factor, b)
    if b.is_constant and b.number() == 0.0:
        return _times(rest, a)
    return calculate(lambda f, a, b: (1.0 - f) * a + f * b, factor, a, b)


def _one_turned(reader, a, b):
    if a.turned and b.turned and _shown(a.turned) != _shown(b.turned):
        reader.context.report.note(f"{reader.owner}: of two bumps or normal maps in a mix the first counts")
    return a.turned or b.turned


def _shown(turned):
    """What tells one bump or normal map from another."""
    return [(name, _shown(value) if isinstance(value, dict) else
             (value.name, value.lookup) if isinstance(value, Value) else value) for name, value in turned.items()]


def _add(reader, place):
    a, b = reader.shader(place, 0), reader.shader(place, 1)
    try:
        emission = _sum(a.emission, b.emission)
    except NotShown as problem:
        reader.lack(place.node, str(problem))
        emission = a.emission or b.emission
    if a.bsdf is None and _is_one(a.opacity):
        return replace(b, emission=emission)
    if b.bsdf is None and _is_one(b.opacity):
        return replace(a, emission=emission)
    both = _leaf(reader, a, b) or _leaf(reader, b, a) or _beneath(reader, place, a, b) or _beneath(reader, place, b, a)
    if both is not None:
        return Surface(both, constant(1.0), emission, _one_turned(reader, a, b))
    try:
        if _is_one(a.opacity) and _is_one(b.opacity):
            bsdf = _added(reader, place, a.bsdf, b.bsdf)
            if bsdf is not None:
                return Surface(bsdf, a.opacity, emission, _one_turned(reader, a, b))
    except NotShown:
        pass
    for one, other in ((a, b), (b, a)):
        if one.bsdf is None and one.opacity.is_constant and _is_one(other.opacity):
            through = _before_nothing(reader, place, other)
            if through is not None:
                return replace(through, emission=emission)
    reader.lack(place.node, "a sum of two shaders that both scatter light; the first counts")
    return replace(a, emission=emission)


def _leaf(reader, a, b):
    """A diffuse and a translucent shader in one; None of others."""
    if not (_is_one(a.opacity) and _is_one(b.opacity)) or a.bsdf is None or b.bsdf is None:
        return None
    if a.bsdf["type"] != "diffuse" or b.bsdf["type"] != "translucent":
        return None
    if "roughness" in a.bsdf:
        reader.context.report.note(f"{reader.owner}: beside translucent shaders diffuse ones are Lambertian")
    return b.bsdf | {"reflectance": a.bsdf["reflectance"]}


def _beneath(reader, place, a, b):
    """A diffuse shader or sheen added to a Principled one that has a diffuse base; None of others."""
    if not (_is_one(a.opacity) and _is_one(b.opacity)) or a.bsdf is None or b.bsdf is None:
        return None
    if b.bsdf["type"] not in ("diffuse", *FLEECY) or "subsurface" in a.bsdf or "spec_trans" in a.bsdf:
        return None
    field = {"principled": "base_color", "plastic": "reflectance", "rough_plastic": "reflectance"}.get(a.bsdf["type"])
    metallic = a.bsdf.get("metallic")
    if field is None or metallic is not None and not (metallic.is_constant and metallic.number() == 0.0):
        return None
    reader.context.report.note(f"{reader.owner}: what is added to its base lies below its gloss")
    below = b.bsdf
    if below["type"] in FLEECY:
        below = diffuse_sheen(reader, place, FLEECY[below["type"]], below["reflectance"], below["roughness"])
    elif "roughness" in below:
        reader.context.report.note(f"{reader.owner}: what is added to its base is as rough as that")
    color = calculate(lambda a, b: np.clip(a + b, 0.0, 1.0), a.bsdf[field].as_color(), below["reflectance"].as_color())
    return a.bsdf | {field: color}


def _before_nothing(reader, place, shown):
    """What reflects before what lets all light through: it covers as much as it sends back. None of others."""
    if shown.bsdf is None or shown.bsdf["type"] not in TINTED:
        return None
    color = shown.bsdf["reflectance"]
    most = _most(color)
    if most <= 0.0 or most >= 1.0:
        return None
    what = f"a sum that sends back up to {1.0 + most:.2f} of the light is dimmed to what arrives"
    if most > SLIGHT:
        reader.lack(place.node, what)
    else:
        reader.context.report.note(f"{reader.owner}: {what}")
    bsdf = shown.bsdf | {"reflectance": calculate(lambda color: color / most, color)}
    return replace(shown, bsdf=bsdf, opacity=constant(most))


# So much more than arrives may be cut off without a word that something is missing.
SLIGHT = 0.05

# Materials all of whose light is multiplied by one colour.
TINTED = {"diffuse", "mirror", "rough_conductor", "velvet", "sheen"}
# Of these, those that send back as much as their colour to few directions alone, and Blender's names of them.
FLEECY = {"velvet": "ASHIKHMIN", "sheen": "MICROFIBER"}


def _added(reader, place, a, b):
    """Both of two materials, as a mix of ones that are brighter by what a mix takes of them; None for others."""
    if a["type"] not in TINTED or b["type"] not in TINTED:
        return None
    shares = [_most(part["reflectance"]) for part in (a, b)]
    total = sum(shares)
    if min(shares) <= 0.0:
        return a if shares[1] <= 0.0 else b
    is_known = a["reflectance"].special is None and b["reflectance"].special is None
    kept = list(shares)
    fleecy = [i for i, part in enumerate((a, b)) if part["type"] in FLEECY]
    if total > 1.0 and len(fleecy) == 1 and shares[1 - fleecy[0]] < 1.0:
        # What lies below it is as it is.
        (i,) = fleecy
        kept[i] = 1.0 - shares[1 - i]
        reader.lack(place.node, f"{(a, b)[i]['type']} of {shares[i]:.2f} over what is as bright is dimmed to "
                                f"{kept[i]:.2f}")
    elif total > 1.0 and (is_known or a["type"] != b["type"]):
        reader.lack(place.node, f"a sum that sends back up to {total:.2f} of the light is dimmed to what arrives")
    are_rough = ["roughness" in part for part in (a, b) if part["type"] == "diffuse"]
    if any(are_rough):
        reader.context.report.note(f"{reader.owner}: rough diffuse shaders of a sum are somewhat brighter")
    if len(are_rough) == 2 and not any(are_rough):
        # As where one looks at grazing angles at sheen, which is then cut off.
        both = calculate(lambda a, b: np.clip(a + b, 0.0, 1.0), a["reflectance"], b["reflectance"])
        return a | {"reflectance": both}
    weight = kept[1] / sum(kept)
    gains = [of_kept / share / max(sum(kept), 1.0) / of_mix
             for of_kept, share, of_mix in zip(kept, shares, (1.0 - weight, weight))]
    parts = [part | {"reflectance": calculate(lambda color, gain=gain: color * gain, part["reflectance"])}
             for part, gain in zip((a, b), gains)]
    return _simple({"type": "blend", "weight": constant(weight), "materials": parts})


def _most(value):
    """The most that a colour is anywhere; 1 for what is not known."""
    return 1.0 if value.special is not None else float(np.clip(value.data, 0.0, 1.0).max())


def _principled(reader, place):
    bsdf, alpha, emission = principled(reader, place)
    turned = reader.turned(place)
    if alpha.is_constant and alpha.number() >= 1.0:
        return Surface(bsdf, constant(1.0), emission, turned)
    # Cycles takes alpha off what shines as well.
    return Surface(bsdf, alpha, scaled(emission, alpha), turned)


SHADERS = {
    "BSDF_DIFFUSE": _diffuse,
    "BSDF_TRANSLUCENT": _translucent,
    "SUBSURFACE_SCATTERING": _subsurface,
    "BSDF_GLOSSY": _glossy,
    "BSDF_ANISOTROPIC": _glossy,
    "BSDF_GLASS": _glass,
    "BSDF_REFRACTION": _refraction,
    "BSDF_TRANSPARENT": _transparent,
    "BSDF_PRINCIPLED": _principled,
    "BSDF_SHEEN": _sheen,
    "BSDF_HAIR_PRINCIPLED": _hair,
    "EMISSION": _emission,
    "BACKGROUND": _emission,
    "MIX_SHADER": _mix,
    "ADD_SHADER": _add,
}


def read_surface(context, material, owner, scope, bake=None, bakes_attributes=False):
    """Surface of a Blender material. `bake`, `bakes_attributes`: those of a `Reader`."""
    if not material.use_nodes or material.node_tree is None:
        value = constant(*material.diffuse_color[:3])
        return opaque({"type": "diffuse", "reflectance": value, "two_sided": True})
    output = output_node(material.node_tree, "ShaderNodeOutputMaterial")
    if output is None:
        return opaque(None)
    socket = output.inputs["Surface"]
    if not socket.is_linked:
        return Surface(None, constant(0.0)) if output.inputs["Volume"].is_linked else opaque(None)
    reader = SurfaceReader(context, owner, scope)
    reader.bake, reader.bakes_attributes = bake, bakes_attributes
    surface = reader.surface(Place(socket))
    displacement = output.inputs.get("Displacement")
    if displacement is not None and displacement.is_linked:
        method = getattr(material, "displacement_method", "BUMP")
        surface = _displaced(reader, surface, Place(displacement), method)
    return replace(surface, wants=tuple(reader.wants))


def _displaced(reader, surface, place, method):
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
    """The same with coats of normals of their own over displacement that is bumps."""
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
    """Whether heights are made of what a mesh holds, which displacement does not take."""
    leaves = (leaf for _, leaf in inputs_of(height) if leaf is not None)
    return any(leaf.special is not None and "attribute" in leaf.special for leaf in leaves)


def _over(upper, lower):
    """Bumps over bumps, or over a normal map. What is turned twice by little is turned by the sum of the heights."""
    if "bump" not in lower:
        return upper | lower
    if any(key in turned for turned in (upper, lower) for key in ("strength", "over", "normal_map")):
        normals = {key: lower[key] for key in ("normal_map",) if key in lower}
        return upper | normals | {"over": {key: value for key, value in lower.items() if key not in normals}}
    share = upper["scale"] / lower["scale"]
    total = calculate(lambda below, above: below + above * share, lower["bump"].as_float(), upper["bump"].as_float())
    return {"bump": total, "scale": lower["scale"]}
