"""Lights as `[[lights]]` and shapes that emit."""

import math


def add_light(instance, context):
    """Adds what the light object of a `Placed` is in the scene file."""
    light = instance.object.data
    name = context.names.get(("light", instance.key), instance.object.name)
    color = [float(number) * light.energy for number in light.color]
    position = [float(number) for number in instance.matrix.translation]
    if light.type == "POINT":
        intensity = [number / (4.0 * math.pi) for number in color]
        context.lights.append({"name": name, "type": "point", "position": position, "intensity": intensity})
    else:
        context.report.leave_out(f"light '{instance.object.name}' ({light.type.lower()})")
