"""What is seen through surfaces that only tint light.

In Cycles a ray that passes a Transparent shader keeps its type: the camera does not see through a tinted surface what
it does not see directly. In the scene file that ray is a refracted one.
"""

REFRACTING = {"dielectric", "rough_dielectric", "thin_dielectric", "principled"}


def add_rules(context):
    """Makes tinted surfaces show what the camera sees."""
    shapes = {}
    for shape in context.shapes:
        material = (shape.get("shape") or shape).get("material")
        if material is not None:
            shapes.setdefault(shape["name"], set()).update(_parts(context.materials, material))
    tinted = [name for name, kinds in shapes.items() if "tint" in kinds]
    unseen, seen = [], []
    for thing in (*context.shapes, *context.lights):
        sees = [ray in thing.get("visible", ("camera", "refracted")) for ray in ("camera", "refracted")]
        if tinted and sees[0] != sees[1]:
            (seen if sees[0] else unseen).append(thing)
    if unseen:
        context.rules.append({"on": tinted, "rays": ["refracted"], "exclude": _names(unseen)})
    if seen:
        for thing in seen:
            thing["visible"] = [*thing["visible"], "refracted"]
        context.rules.append({"on": ["all"], "except": tinted, "rays": ["refracted"], "exclude": _names(seen)})
    for name in tinted if unseen or seen else ():
        if "glass" in shapes[name]:
            context.report.note(f"object '{name}': its glass shows what its tint does, which is what the camera sees")


def _names(things):
    return list(dict.fromkeys(thing["name"] for thing in things))


def _parts(materials, name):
    """Which of "tint" and "glass" a material transmits light by."""
    table = materials[name]
    if table["type"] == "blend":
        return {kind for part in table["materials"] for kind in _parts(materials, part)}
    if table["type"] not in REFRACTING or table["type"] == "principled" and "spec_trans" not in table:
        return set()
    return {"tint" if table["type"] == "thin_dielectric" and table["ior"] == 1.0 else "glass"}
