"""Combines values at several times into one value with keys."""

import math

from mathutils import Matrix, Quaternion, Vector

# Values of fields that a table lacks.
DEFAULTS = {"opacity": 1.0, "scale": 1.0, "principal_point": [0.0, 0.0], "transform": []}
# Directions are interpolated along chords between keys. No two are further apart than this, so a rotation has nearly
# constant speed.
FINE = math.radians(5.0)


def keys(times, values, interpolation=None):
    """A value with keys, or without if it is the same at all times."""
    if all(value == values[0] for value in values):
        return values[0]
    table = {"keys": [[float(time), value] for time, value in zip(times, values)]}
    return table if interpolation is None else table | {"interpolation": interpolation}


def over_time(times, values, otherwise, field=""):
    """The combination of `values` at `times`. Where two of them cannot be interpolated, `otherwise` is called with the
    values and the name of the field."""
    if all(value == values[0] for value in values):
        return values[0]
    if field == "transform":
        return _transform(times, values, otherwise)
    if all(isinstance(value, dict) for value in values):
        names = set().union(*values)
        if all(name in value or name in DEFAULTS for value in values for name in names):
            order = [*values[0], *sorted(names - set(values[0]))]
            return {
                name: over_time(times, [value.get(name, DEFAULTS.get(name)) for value in values], otherwise, name)
                for name in order
            }
    elif _are_numbers(values):
        return keys(times, values)
    elif all(isinstance(value, list) for value in values) and len({len(value) for value in values}) == 1:
        items = values[0] and not any(isinstance(item, str) for value in values for item in value)
        if items:
            return [over_time(times, list(items), otherwise, field) for items in zip(*values)]
    return otherwise(values, field)


def _are_numbers(values):
    """Whether all are numbers, or all lists of the same length; a colour may be a single number."""
    widths = set()
    for value in values:
        items = value if isinstance(value, list) else [value]
        if any(isinstance(item, bool) or not isinstance(item, (int, float)) for item in items):
            return False
        widths.add(len(value) if isinstance(value, list) else 1)
    return len(widths) == 1 or widths == {1, 3} and not any(isinstance(value, list) and len(value) == 1
                                                          for value in values)


IDENTITY = [{"matrix": [[float(row == column) for column in range(4)] for row in range(4)]}]


def _transform(times, values, otherwise):
    """Combines lists of steps, each of which is a single matrix."""
    values = [value or IDENTITY for value in values]
    signs = {Matrix(value[0]["matrix"]).to_3x3().determinant() > 0.0 for value in values}
    return otherwise(values, "transform") if len(signs) > 1 else keys(times, values)


def stepped(times, values, opens):
    """A value that holds from the shutter's opening at one time to its opening at the next."""
    changes = []
    for time, value in zip(times, values):
        if not changes or value != changes[-1][1]:
            changes.append([time + opens, value])
    return _steps(changes, times[-1])


def turning(times, tables):
    """(times, tables) with additional times wherever a view from `origin` or `position` to `target`, or `direction`,
    turns by much between two times, as for a turn at constant speed. Everything else is interpolated linearly."""
    finer, filled = times[:1], tables[:1]
    for k in range(1, len(times)):
        before, after = tables[k - 1], tables[k]
        turn = _turn(before, after)
        pieces = 1 if turn is None else max(1, math.ceil(turn[0] / FINE))
        for piece in range(1, pieces):
            share = piece / pieces
            finer = [*finer, times[k - 1] + (times[k] - times[k - 1]) * share]
            filled = [*filled, _between(before, after, share) | turn[1](share)]
        finer, filled = [*finer, times[k]], [*filled, after]
    return finer, filled


def _between(before, after, share):
    def mixed(a, b):
        if isinstance(a, list):
            return [mixed(x, y) for x, y in zip(a, b)]
        return a if isinstance(a, (str, bool, dict)) else a + (b - a) * share

    return {name: mixed(value, after[name]) for name, value in before.items()}


def _turn(before, after):
    """(angle, function from a share of the way to the fields that turn), or None if nothing turns."""
    if before.keys() != after.keys() or not _are_alike(before, after):
        return None
    if "direction" in before:
        a, b = Vector(before["direction"]), Vector(after["direction"])
        return a.angle(b, 0.0), lambda share: {"direction": list(a.slerp(b, share, a))}
    if "target" not in before:
        return None
    at = "origin" if "origin" in before else "position"
    places = [Vector(table[at]) for table in (before, after)]
    looks = [Vector(table["target"]) - place for table, place in zip((before, after), places)]
    if "up" not in before:
        a, b = looks
        return a.angle(b, 0.0), lambda share: {"target": list(places[0].lerp(places[1], share) + a.slerp(b, share, a))}
    a, b = (_stand(look, Vector(table["up"])) for look, table in zip(looks, (before, after)))

    def stand(share):
        turn = a.slerp(b, share)
        place = places[0].lerp(places[1], share)
        return {"target": list(place + turn @ Vector((0.0, 0.0, -1.0))), "up": list(turn @ Vector((0.0, 1.0, 0.0)))}

    angle = a.rotation_difference(b).angle
    return min(angle, 2.0 * math.pi - angle), stand


def _are_alike(before, after):
    """Whether two tables can be interpolated number by number."""
    def alike(a, b):
        if isinstance(a, list) and isinstance(b, list):
            return len(a) == len(b) and all(map(alike, a, b))
        if isinstance(a, float) and isinstance(b, float):
            return True
        return a == b

    return all(alike(value, after[name]) for name, value in before.items())


def _stand(look, up):
    """Rotation of a camera, which looks along -z."""
    back, up = -look.normalized(), up.normalized()
    right = up.cross(back)
    return Matrix((right, up, back)).transposed().to_quaternion()


def on_its_way(times, paths):
    """`file` and `toward` for a mesh that has one file at each time.

    From odd times to the next it runs backwards, from `toward` to `file`: each of the two then changes only while its
    weight is zero.
    """
    last = len(times) - 1
    files = [[times[0], paths[0]]] + [[times[k], paths[k + 1]] for k in range(1, last, 2)]
    towards = [[times[k], paths[k + 1]] for k in range(0, last, 2)]
    weight = keys(times, [float(k % 2) for k in range(len(times))])
    return {"file": _steps(files, times[last]), "toward": {"file": _steps(towards, times[last]), "weight": weight}}


def _steps(changes, end):
    if all(path == changes[0][1] for _, path in changes):
        return changes[0][1]
    if changes[-1][0] < end:
        changes = [*changes, [end, changes[-1][1]]]
    return {"keys": changes, "interpolation": "step"}
