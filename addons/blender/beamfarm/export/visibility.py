"""Ray visibility of objects and lights as lists of the scene file's rays."""


def rays(object, instancer, context):
    """List for `visible`; None if all rays see it. Rays that do not see the instancer do not see its instances."""

    def sees(name):
        return getattr(object, name) and (instancer is None or getattr(instancer, name))

    flags = {
        "camera": sees("visible_camera"),
        "reflected": sees("visible_glossy"),
        "refracted": sees("visible_transmission"),
        "shadow": sees("visible_shadow"),
        "photon": sees("visible_diffuse") or sees("visible_volume_scatter"),
    }
    if sees("visible_diffuse") != sees("visible_volume_scatter"):
        context.report.note(
            f"object '{object.name}': diffuse and volume rays either both see it or neither does"
        )
    if not flags["photon"]:
        context.report.note(f"object '{object.name}': diffuse rays do not see it, so it gets no indirect light")
    if not flags["shadow"] and flags["photon"]:
        context.report.note(f"object '{object.name}': it casts no shadow, but blocks indirect light")
    return None if all(flags.values()) else [name for name, is_seen in flags.items() if is_seen]


def light_rays(light, context):
    """The same for lights: `shadow` and `photon` control whether it lights at all, and follow diffuse visibility
    here."""
    flags = {
        "camera": light.visible_camera,
        "reflected": light.visible_glossy,
        "refracted": light.visible_transmission,
        "shadow": light.visible_diffuse,
        "photon": light.visible_diffuse or light.visible_volume_scatter,
    }
    if light.visible_diffuse != light.visible_volume_scatter:
        context.report.note(f"light '{light.name}': its photons light both surfaces and volumes")
    return None if all(flags.values()) else [name for name, is_seen in flags.items() if is_seen]
