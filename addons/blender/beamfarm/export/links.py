"""Light linking as `[[rules]]`.

A light with a receiver collection lights only the objects of that collection, or all except those that it excludes; a
blocker collection likewise selects the objects that block the light.
"""


def add_rules(context):
    """Adds the rules of all objects that the depsgraph shows, ordered by name."""
    there = {table["name"] for table in (*context.shapes, *context.lights)}
    bare = [name for name in context.without_shadows if name in there]
    if bare:
        context.report.note("lights without shadows cast none in direct light; they do in media and in light that "
                            "other objects reflect or transmit")
        context.rules.append({"on": bare, "rays": ["shadow"], "exclude": ["all"]})
    seen = set()
    for object in sorted((object for object in context.depsgraph.objects), key=lambda object: object.name):
        linking = getattr(object, "light_linking", None)
        if linking is None or object.original.session_uid in seen:
            continue
        seen.add(object.original.session_uid)
        lights = context.shown.get(object.original.session_uid)
        if not lights:
            continue
        if linking.receiver_collection is not None:
            _receivers(context, lights, linking.receiver_collection)
        if linking.blocker_collection is not None:
            _blockers(context, lights, linking.blocker_collection)


def _receivers(context, lights, collection):
    rays = ["shadow", "photon"]
    included, excluded = members(context, collection)
    context.report.note(f"light linking of {' and '.join(repr(name) for name in lights)}: what it does not light gets "
                        "none of its light from other objects either")
    if included is not None:
        # The world's medium and everything not named get no light from it.
        context.rules.append({"on": ["all"], "except": included, "rays": rays, "exclude": lights} if included
                             else {"on": ["all"], "rays": rays, "exclude": lights})
    elif excluded:
        context.rules.append({"on": excluded, "rays": rays, "exclude": lights})


def _blockers(context, lights, collection):
    rays = ["shadow", "photon"]
    included, excluded = members(context, collection)
    if included is not None:
        others = [name for name in _objects(context) if name not in included and name not in lights]
        if others:
            context.rules.append({"on": lights, "rays": rays, "exclude": others})
    elif excluded:
        context.rules.append({"on": lights, "rays": rays, "exclude": excluded})


def _objects(context):
    return list(dict.fromkeys(shape["name"] for shape in context.shapes))


def members(context, collection):
    """(names included, or None if a collection includes none; names excluded) for objects that are shapes."""
    states = {"INCLUDE": [], "EXCLUDE": []}
    any_included = False
    for item, settings in zip(collection.objects, collection.collection_objects):
        any_included |= settings.light_linking.link_state == "INCLUDE"
        states[settings.light_linking.link_state].append(item)
    for child, settings in zip(collection.children, collection.collection_children):
        any_included |= settings.light_linking.link_state == "INCLUDE"
        states[settings.light_linking.link_state].extend(child.all_objects)
    shapes = set(_objects(context))

    def names(objects):
        found = {}
        for object in objects:
            for name in context.shown.get(object.original.session_uid, []):
                if name in shapes:
                    found[name] = None
        return list(found)

    excluded = names(states["EXCLUDE"])
    if not any_included:
        return None, excluded
    return [name for name in names(states["INCLUDE"]) if name not in excluded], excluded
