"""Ray visibility of objects and lights as lists of the scene file's rays."""


def rays(object, context):
    """List for `visible`; None where all rays see it."""
    flags = {
        "camera": object.visible_camera,
        "reflected": object.visible_glossy,
        "refracted": object.visible_transmission,
        "shadow": object.visible_shadow,
        "photon": object.visible_diffuse or object.visible_volume_scatter,
    }
    if object.visible_diffuse != object.visible_volume_scatter:
        context.report.note(
            f"object '{object.name}': rays of diffuse surfaces and of volumes see it alike, both or neither"
        )
    if not flags["photon"]:
        context.report.note(f"object '{object.name}': what is not seen by diffuse rays gets no light by way of others")
    if not flags["shadow"] and flags["photon"]:
        context.report.note(f"object '{object.name}': it casts no shadow, but is in the way of light that bounces")
    return None if all(flags.values()) else [name for name, sees in flags.items() if sees]


def light_rays(light, context):
    """The same for lights: `shadow` and `photon` are how it lights at all, which here goes by diffuse visibility."""
    flags = {
        "camera": light.visible_camera,
        "reflected": light.visible_glossy,
        "refracted": light.visible_transmission,
        "shadow": light.visible_diffuse,
        "photon": light.visible_diffuse or light.visible_volume_scatter,
    }
    if light.visible_diffuse != light.visible_volume_scatter:
        context.report.note(f"light '{light.name}': it lights surfaces and volumes by photons alike")
    return None if all(flags.values()) else [name for name, sees in flags.items() if sees]
