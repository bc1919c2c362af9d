"""Light groups of a view layer as groups of lights, which share a layer of the image."""


def add_light_groups(context):
    """Puts emitters into the light groups of their objects; call it when all lights and shapes are there."""
    groups = {group.name for group in context.depsgraph.view_layer_eval.lightgroups}
    of_name = {}
    for object in context.depsgraph.objects:
        if object.lightgroup in groups:
            of_name |= dict.fromkeys(context.shown.get(object.original.session_uid, ()), object.lightgroup)
    for light in context.lights:
        if light["name"] in of_name:
            light["group"] = of_name[light["name"]]
        elif light["type"] == "environment" and context.scene.world.lightgroup in groups:
            light["group"] = context.scene.world.lightgroup
    for shape in context.shapes:
        if "emission" in shape and shape["name"] in of_name:
            shape["emission"]["group"] = of_name[shape["name"]]
