"""Shader nodes of surfaces as materials."""

from dataclasses import replace

import numpy as np

from . import subsurface, tangents
from .arithmetic import calculate, scaled
from .gloss import constant_of, dielectric, is_smooth, keeps_energy
from .graph import Place, follow, output_node
from .hair import hair
from .media import is_volume
from .mixes import Surface, added, mixed, opaque
from .nodes import fresnel_index
from .principled import film_over, principled
from .relief import ReliefReader, displaced
from .sheen import sheen
from .texture_nodes import GRAPHS
from .values import NotShown, constant, is_black, is_white


class SurfaceReader(ReliefReader):
    """Reads the shader nodes of one material."""

    graphs = GRAPHS
    sees_surface = True

    def surface(self, place):
        """Surface of a shader socket."""
        found = follow(place)
        if found is None or not found.socket.is_output or found.node.mute:
            return opaque(None)
        if found.socket.type != "SHADER":
            # A colour in place of a shader emits.
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
        reader.context.report.note(f"{reader.owner}: the reflection of glass below a film is white")
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
    reader.context.report.note(f"{reader.owner}: Fresnel's reflection is subtracted from '{place.node.name}'")
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


def _by_fresnel(reader, place):
    """Surface for two shaders mixed by Fresnel's law, if the scene file has a material for it."""
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
        note = f"{reader.owner}: refracts and reflects with the index {index:.3g} of its Fresnel node"
        reader.context.report.note(note)
    if not (rough.is_constant and shine.is_constant and abs(rough.number() - shine.number()) < 1e-3):
        reader.context.report.note(f"{reader.owner}: reflects with the roughness of its refraction")
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
        reader.context.report.note(f"{reader.owner}: the roughness of '{base.node.name}' is ignored below a coat")
    color, shine = reader.get(base, "Color"), reader.get(coat, "Color")
    bsdf = {"type": "plastic", "ior": index, "reflectance": color, "two_sided": True}
    if not is_white(shine):
        bsdf["specular_reflectance"] = shine
    if not is_smooth(rough):
        alpha = rough.number() ** 2
        bsdf |= {"type": "rough_plastic", "alpha": alpha}
        if getattr(coat.node, "distribution", "GGX") == "BECKMANN":
            bsdf["distribution"] = "beckmann"
    reader.context.report.note(f"{reader.owner}: diffuse and glossy mixed by Fresnel's law become plastic")
    turned = reader.turned(base) or reader.turned(coat)
    return opaque(bsdf, turned=turned)


# Above this roughness the scene file's plastic keeps too much of the light.
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
        reader.context.report.note(f"{reader.owner}: transparency for shadow rays alone is ignored: caustics "
                                   "are rendered here")
        return constant(0.0)
    return reader.value(socket).as_float()


def _add(reader, place):
    return added(reader, place, reader.shader(place, 0), reader.shader(place, 1))


def _principled(reader, place):
    bsdf, alpha, emission = principled(reader, place)
    turned = reader.turned(place)
    if alpha.is_constant and alpha.number() >= 1.0:
        return Surface(bsdf, constant(1.0), emission, turned)
    # Cycles multiplies emission by alpha as well.
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
    """Surface of a Blender material. `bake`, `bakes_attributes`: as in `Reader`."""
    if not material.use_nodes or material.node_tree is None:
        value = constant(*material.diffuse_color[:3])
        return opaque({"type": "diffuse", "reflectance": value, "two_sided": True})
    output = output_node(material.node_tree, "ShaderNodeOutputMaterial")
    if output is None:
        return opaque(None)
    socket = output.inputs["Surface"]
    if not socket.is_linked:
        return Surface(None, constant(0.0)) if is_volume(output) else opaque(None)
    reader = SurfaceReader(context, owner, scope)
    reader.bake, reader.bakes_attributes = bake, bakes_attributes
    surface = reader.surface(Place(socket))
    displacement = output.inputs.get("Displacement")
    if displacement is not None and displacement.is_linked:
        method = getattr(material, "displacement_method", "BUMP")
        surface = displaced(reader, surface, Place(displacement), method)
    return replace(surface, wants=tuple(reader.wants))
