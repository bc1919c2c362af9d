"""What Cycles makes of every node that texture graphs of scene files have: nodes.py OUT.json [THIN.json]

Each case is a graph that reads points (`{ node = "coordinates", of = "attribute" }`), the points, and its values there.
The second file is for the renderer's tests: nodes.json from Blender 5 and nodes-4.json from Blender 4, in
shared/scene/src/assemble/texture/graph/.
"""

import json
import pathlib
import sys
import tempfile

import bpy
import numpy as np
from graphs import BLENDS, MATH, VECTOR_MATH, build

# Points per case, and which of them the thin file keeps.
COUNT, THIN = 64, [0, 9, 17, 26, 42, 63]
# Cases per picture, and pixels along a square's side.
ROWS, SIDE = 64, 3

POINT = {"node": "coordinates", "of": "attribute"}


def _points():
    """Points in [-3, 3], on no edge of any cell of a node at an ordinary scale."""
    random = np.random.default_rng(7)
    return (random.integers(-1536, 1536, (COUNT, 3)) * 2 + 1) / 1024.0


def _colors():
    """From below 0 to above 1; the last are grey, black, white and pure."""
    points = np.random.default_rng(8).integers(-200, 1400, (COUNT, 3)) / 1024.0
    points[4:] = np.abs(points[4:])
    points[24:] = np.minimum(points[24:], 1.0)
    special = [[0, 0, 0], [1, 1, 1], [0.5, 0.5, 0.5], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.25, 0.25, 0.75]]
    points[-len(special) :] = special
    return points


def _numbers():
    """For functions of up to three numbers; some are equal or integers."""
    points = _points()
    points[40:50] = np.round(points[40:50] * 2.0) / 2.0
    special = [[0, 0, 0], [1, 1, 1], [-1, 2, 0.5], [2, 0, 1], [0.5, 0.5, 0.5], [-2, -2, -2], [0, 1, 2], [4, 0.5, 0.25]]
    points[-len(special) :] = special
    return points


POINTS, COLORS, NUMBERS = _points(), _colors(), _numbers()


def part(axis):
    """One coordinate of the point."""
    return {"node": "separate", "mode": "xyz", "value": POINT, "output": axis}


X, Y, Z = (part(axis) for axis in "xyz")


class Cases:
    def __init__(self):
        self.all = []

    def add(self, name, node, outputs=(None,), points=POINTS, thin=True, **fields):
        """Adds a case for each output; `thin` puts it into the thin file as well, or only the output given."""
        for output in outputs:
            texture = {"node": node} | fields
            full = name if output is None else f"{name}, {output}"
            is_thin = thin if isinstance(thin, bool) else thin == output
            self.all.append({"name": full, "texture": texture, "output": output, "points": points, "thin": is_thin})


def _noise(cases):
    for size in ("1d", "2d", "3d", "4d"):
        place = {"vector": POINT} if size != "1d" else {}
        w = {"w": X} if size == "1d" else {"w": 0.7} if size == "4d" else {}
        for kind in ("fbm", "multifractal", "hybrid_multifractal", "ridged_multifractal", "hetero_terrain"):
            more = {} if kind == "fbm" else {"offset": 0.3, "gain": 1.4}
            for detail in (0.0, 2.0, 3.7):
                for distortion in (0.0, 1.3):
                    for normalize in (True, False) if kind == "fbm" else (True,):
                        cases.add(
                            f"noise {size} {kind}, detail {detail:g}, distortion {distortion:g}"
                            + ("" if normalize else ", as it is"),
                            "noise", ("value", "color") if distortion or detail == 2.0 else ("value",),
                            thin=(detail, distortion) in ((2.0, 0.0), (3.7, 1.3)) or (kind, detail) == ("fbm", 0.0),
                            dimensions=size, type=kind, normalize=normalize, **place, **w, **more, scale=1.7,
                            detail=detail, roughness=0.6, lacunarity=2.2, distortion=distortion)
    cases.add("noise of defaults", "noise", ("value", "color"), vector=POINT)
    cases.add("noise 4d of all numbers", "noise", ("value",), vector=POINT, dimensions="4d", w=Y, detail=1.5, scale=0.8)
    cases.add("noise by roughness and scale", "noise", ("value",), vector=POINT, scale=X, roughness=Y, detail=5.0)
    cases.add("noise far away", "noise", ("value",), vector=POINT, scale=900.0)
    cases.add("noise of many octaves", "noise", ("value",), vector=POINT, detail=15.0, roughness=0.9)


def _voronoi(cases):
    for size in ("1d", "2d", "3d", "4d"):
        place = {"vector": POINT} if size != "1d" else {}
        w = {"w": X} if size == "1d" else {"w": 0.7} if size == "4d" else {}
        where = [name for name, wanted in (("position", size != "1d"), ("w", size in ("1d", "4d"))) if wanted]
        common = {"dimensions": size} | place | w | {"scale": 1.7}
        for feature in ("f1", "f2", "smooth_f1"):
            for metric in ("euclidean", "manhattan", "chebychev", "minkowski") if size != "1d" else ("euclidean",):
                fields = common | {"feature": feature, "metric": metric}
                if metric == "minkowski":
                    fields["exponent"] = 1.3
                if feature == "smooth_f1":
                    fields["smoothness"] = 0.7
                name = f"voronoi {size} {feature} {metric}"
                cases.add(name, "voronoi", ("distance", "color", *where), thin="distance", **fields, randomness=0.6)
                cases.add(f"{name}, detailed", "voronoi", ("distance", "color", *where), **fields, detail=2.3,
                          roughness=0.6, lacunarity=2.2)
                cases.add(f"{name}, normalized", "voronoi", ("distance",), thin=size == "3d", **fields, detail=1.0,
                          normalize=True)
        for detail in (0.0, 2.3):
            cases.add(f"voronoi {size} distance to edge, detail {detail:g}", "voronoi", ("distance",), **common,
                      feature="distance_to_edge", detail=detail, randomness=0.6)
            cases.add(f"voronoi {size} distance to edge, detail {detail:g}, normalized", "voronoi", ("distance",),
                      **common, feature="distance_to_edge", detail=detail, normalize=True)
        for randomness in (0.6, 1.0):
            cases.add(f"voronoi {size} n-sphere radius, randomness {randomness:g}", "voronoi", ("radius",), **common,
                      feature="n_sphere_radius", randomness=randomness)
    cases.add("voronoi of defaults", "voronoi", ("distance", "color", "position"), vector=POINT)
    cases.add("voronoi without smoothness", "voronoi", ("distance",), vector=POINT, feature="smooth_f1", smoothness=0.0)


def _gradient(cases):
    for kind in ("linear", "quadratic", "easing", "diagonal", "spherical", "quadratic_sphere", "radial"):
        near = POINT if "spher" not in kind else {"node": "mapping", "vector": POINT, "scale": [0.3, 0.3, 0.3]}
        cases.add(f"gradient {kind}", "gradient", ("value",), vector=near, type=kind)


def _patterns(cases):
    for depth in (0, 1, 2, 3, 5, 10):
        cases.add(f"magic of depth {depth}", "magic", ("color", "value"), vector=POINT, depth=depth, scale=2.3,
                  distortion=1.4)
    cases.add("magic without distortion", "magic", ("color",), vector=POINT, distortion=0.0, depth=3)
    for kind, directions in (("bands", ("x", "y", "z", "diagonal")), ("rings", ("x", "y", "z", "spherical"))):
        for direction in directions:
            for profile in ("sine", "saw", "triangle"):
                for distortion in (0.0, 2.1):
                    cases.add(
                        f"wave {kind} {direction} {profile}, distortion {distortion:g}", "wave", ("value",),
                        vector=POINT, type=kind, direction=direction, profile=profile, scale=0.9,
                        distortion=distortion, detail=2.6, detail_scale=1.3, detail_roughness=0.7, phase_offset=0.4)
    cases.add("wave of defaults", "wave", ("color", "value"), vector=POINT)
    colors = {"color1": [0.9, 0.2, 0.1], "color2": [0.1, 0.3, 0.8], "mortar": [0.4, 0.5, 0.2]}
    for name, more in (
        ("of defaults", {}),
        ("offset and squashed", {"offset": 0.3, "offset_frequency": 3, "squash": 1.6, "squash_frequency": 3}),
        ("offset in every row", {"offset": 0.7, "offset_frequency": 1, "squash": 0.6, "squash_frequency": 1}),
        ("smooth", {"mortar_size": 0.06, "mortar_smooth": 1.0, "bias": 0.4}),
        ("sharp", {"mortar_size": 0.08, "mortar_smooth": 0.0, "bias": -0.6}),
        ("of odd sizes", {"brick_width": 0.83, "row_height": 0.41, "mortar_size": 0.1, "mortar_smooth": 0.5}),
    ):
        cases.add(f"brick {name}", "brick", ("color", "value"), vector=POINT, scale=1.3, **colors, **more)
    cases.add("brick of default colours", "brick", ("color",), vector=POINT)
    cases.add("brick by mortar", "brick", ("value",), vector=POINT, scale=1.3, mortar_size={
        "node": "math", "operation": "multiply", "a": 0.05, "b": {"node": "math", "operation": "absolute", "a": X}})
    cases.add("checker", "checker", ("color", "value"), vector=POINT, scale=1.3, color1=[0.9, 0.2, 0.1],
              color2=[0.1, 0.3, 0.8])
    cases.add("checker of defaults", "checker", ("color",), vector=POINT)
    cases.add("checker on edges", "checker", ("value",), points=NUMBERS, vector=POINT, scale=2.0)
    for size in ("1d", "2d", "3d", "4d"):
        place = {"vector": POINT} if size != "1d" else {}
        w = {"w": X} if size in ("1d", "4d") else {}
        cases.add(f"white noise {size}", "white_noise", ("value", "color"), dimensions=size, **place, **w)


STOPS = [[0.1, 0.9, 0.2, 0.1, 1.0], [0.35, 0.1, 0.6, 0.3, 0.2], [0.6, 0.2, 0.2, 0.9, 0.7], [0.95, 1.0, 0.9, 0.0, 0.4]]


def _colors_of_numbers(cases):
    for interpolation in ("linear", "constant", "ease"):
        cases.add(f"ramp {interpolation}", "ramp", ("color", "alpha"), points=COLORS, factor=X, stops=STOPS,
                  interpolation=interpolation)
    cases.add("ramp of a colour", "ramp", ("color",), points=COLORS,
              factor={"node": "combine", "x": X, "y": Y, "z": Z}, stops=[[0, 0, 0, 0], [1, 1, 1, 1]])
    bent = [[0.0, 0.1], [0.4, 0.8], [1.0, 0.9]]
    cases.add("RGB curves", "rgb_curves", points=COLORS, color=POINT, factor=0.8, combined=bent,
              red=[[0.0, 0.0], [0.5, 0.2], [1.0, 1.0]], blue=[[0.0, 1.0], [1.0, 0.0]])
    cases.add("vector curves", "vector_curves", points=COLORS, vector=POINT, factor=0.7,
              x=[[-1.0, 1.0], [1.0, -1.0]], z=[[-1.0, -0.5], [0.0, 0.4], [1.0, 0.6]])
    cases.add("float curve", "float_curve", points=COLORS, value=X, factor=0.9, curve=bent)
    for name, low in (("blackbody", 500.0), ("blackbody, hot", 4000.0)):
        cases.add(name, "blackbody", points=COLORS, temperature={
            "node": "map_range", "value": X, "to_min": low, "to_max": low * 4.0, "clamp": False})


def _mixes(cases):
    other = [0.3, 0.75, 0.55]
    for blend in BLENDS:
        for factor in (1.0, 0.35):
            cases.add(f"mix {blend} by {factor:g}", "mix", points=COLORS, data="color", blend=blend, factor=factor,
                      a=POINT, b=other)
        cases.add(f"mix {blend}, turned", "mix", points=COLORS, data="color", blend=blend, factor=0.8, a=other,
                  b=POINT)
    cases.add("mix by factors beyond", "mix", points=COLORS, data="color", factor=X, a=[0.2, 0.4, 0.6],
              b=[0.9, 0.1, 0.5], clamp_factor=False)
    cases.add("mix by factors cut", "mix", points=COLORS, data="color", factor=X, a=[0.2, 0.4, 0.6],
              b=[0.9, 0.1, 0.5])
    cases.add("mix with the result cut", "mix", points=COLORS, data="color", factor=0.9, a=POINT, b=POINT, blend="add",
              clamp_result=True)
    for clamp in (True, False):
        cases.add(f"mix of numbers, clamp {clamp}", "mix", points=COLORS, data="float", factor=X, a=Y, b=Z,
                  clamp_factor=clamp)
        cases.add(f"mix of vectors by a vector, clamp {clamp}", "mix", points=COLORS, data="vector", factor=POINT,
                  a=[0.2, -0.4, 0.6], b=[0.9, 0.1, 1.5], clamp_factor=clamp)
    cases.add("mix of vectors", "mix", points=POINTS, data="vector", factor=0.3, a=POINT, b=[0.9, 0.1, 1.5])


def _maths(cases):
    for operation in MATH:
        cases.add(f"math {operation}", "math", points=NUMBERS, operation=operation, a=X, b=Y, c=Z)
    cases.add("math cut", "math", points=NUMBERS, a=X, b=Y, clamp=True)
    cases.add("math by numbers of vectors and colours", "math", points=NUMBERS, a=POINT,
              b={"node": "combine", "x": X, "y": Y, "z": Z})
    turned = {"node": "combine", "mode": "xyz", "x": Y, "y": Z, "z": X}
    third = {"node": "combine", "mode": "xyz", "x": Z, "y": 0.6, "z": Y}
    for operation in VECTOR_MATH:
        output = "value" if operation in ("dot_product", "distance", "length") else "vector"
        scale = 0.7 if operation == "refract" else X
        cases.add(f"vector math {operation}", "vector_math", (output,), points=NUMBERS, operation=operation, a=POINT,
                  b=turned, c=third, scale=scale)
    for interpolation in ("linear", "stepped", "smoothstep", "smootherstep"):
        for clamp in (True, False):
            fields = {"interpolation": interpolation, "clamp": clamp}
            name = f"map range {interpolation}, clamp {clamp}"
            cases.add(name, "map_range", points=NUMBERS, value=X, from_min=-1.0, from_max=1.5, to_min=0.2,
                      to_max=2.4, steps=3.0, **fields)
            cases.add(f"{name}, falling", "map_range", points=NUMBERS, value=X, from_min=1.5, from_max=-1.0,
                      to_min=1.0, to_max=-0.5, **fields)
            cases.add(f"{name}, of vectors", "map_range", points=NUMBERS, data="vector", value=POINT,
                      from_min=[-1.0, -0.5, 0.0], from_max=[1.5, 2.0, 0.0], to_min=[0.0, 1.0, 0.5],
                      to_max=[1.0, -1.0, 2.0], steps=[3.0, 4.0, 2.5], **fields)
    for kind in ("minmax", "range"):
        cases.add(f"clamp {kind}", "clamp", points=NUMBERS, value=X, min=Y, max=Z, type=kind)


def _changes(cases):
    for mode in ("rgb", "hsv", "hsl", "xyz"):
        cases.add(f"separate {mode}", "separate", ("x", "y", "z"), points=COLORS, value=POINT, mode=mode)
        cases.add(f"combine {mode}", "combine", points=COLORS, x=X, y=Y, z=Z, mode=mode)
    cases.add("hue, saturation, value", "hue_saturation", points=COLORS, color=POINT, hue=0.8, saturation=1.4,
              value=0.9, factor=0.7)
    cases.add("hue by a number", "hue_saturation", points=COLORS, color=[0.7, 0.3, 0.2], hue=X, saturation=Y, value=Z)
    cases.add("bright and contrast", "bright_contrast", points=COLORS, color=POINT, bright=0.1, contrast=0.3)
    cases.add("bright and contrast, down", "bright_contrast", points=COLORS, color=POINT, bright=-0.2, contrast=-0.4)
    cases.add("gamma", "gamma", points=COLORS, color=POINT, gamma=2.2)
    cases.add("gamma by a number", "gamma", points=COLORS, color=[0.7, 0.3, 0.0], gamma=X)
    cases.add("invert", "invert", points=COLORS, color=POINT, factor=0.7)
    cases.add("luminance", "luminance", points=COLORS, color=POINT)
    for kind in ("axis_angle", "x", "y", "z", "euler_xyz"):
        for invert in (False, True):
            fields = {"rotation": [20.0, 70.0, -35.0]} if kind == "euler_xyz" else {"angle": 40.0}
            if kind == "axis_angle":
                fields["axis"] = [0.3, -0.5, 0.9]
            cases.add(f"vector rotate {kind}, invert {invert}", "vector_rotate", vector=POINT,
                      center=[0.2, -0.3, 0.5], type=kind, invert=invert, **fields)
    cases.add("vector rotate without an axis", "vector_rotate", vector=POINT, axis=[0.0, 0.0, 0.0], angle=40.0)
    cases.add("vector rotate by a number", "vector_rotate", vector=POINT, angle={
        "node": "math", "operation": "multiply", "a": X, "b": 50.0})
    for kind in ("point", "texture", "vector", "normal"):
        cases.add(f"mapping {kind}", "mapping", vector=POINT, type=kind, location=[0.4, -0.7, 1.1],
                  rotation=[20.0, 70.0, -35.0], scale=[1.5, 0.6, -2.0])
    cases.add("mapping of a texture without a size", "mapping", vector=POINT, type="texture", scale=[0.0, 2.0, 1.0])


MAKERS = (_noise, _voronoi, _gradient, _patterns, _colors_of_numbers, _mixes, _maths, _changes)


def cases_of(makers=MAKERS):
    cases = Cases()
    for make in makers:
        make(cases)
    assert len({case["name"] for case in cases.all}) == len(cases.all)
    return cases.all


def values_of(cases):
    """Sets the values of all cases."""
    for first in range(0, len(cases), ROWS):
        some = cases[first : first + ROWS]
        lay_out(some)
        for case, values in zip(some, _render(len(some))):
            case["values"] = values


def lay_out(cases):
    """A scene with a row of squares for each case, whose material has the case's name."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    for row, case in enumerate(cases):
        _add_row(bpy.context.scene, row, case)


def _render(count):
    """An array (case, point, 3) from a picture of this many rows."""
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("Camera")
    camera.type = "ORTHO"
    camera.ortho_scale = float(max(COUNT, count))
    view = bpy.data.objects.new("Camera", camera)
    view.location = (COUNT / 2.0, count / 2.0, 5.0)
    scene.collection.objects.link(view)
    scene.camera = view
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = COUNT * SIDE, count * SIDE, 100
    cycles.device, cycles.samples, cycles.pixel_filter_type = "CPU", 1, "BOX"
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    scene.view_settings.view_transform = "Raw"
    settings = render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGB", "32"
    with tempfile.TemporaryDirectory() as folder:
        render.filepath = str(pathlib.Path(folder) / "nodes.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(render.filepath)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        pixels = pixels.reshape(count * SIDE, COUNT * SIDE, -1)
    middle = pixels[SIDE // 2 :: SIDE, SIDE // 2 :: SIDE]
    return middle[..., :3]


def _add_row(scene, row, case):
    """Squares from (0, row) on, one for each point; the case's graph may refer to its `textures`."""
    mesh = bpy.data.meshes.new(case["name"])
    corners = [(x + dx, row + dy, 0.0) for x in range(COUNT) for dx, dy in ((0, 0), (1, 0), (1, 1), (0, 1))]
    mesh.from_pydata(corners, [], [tuple(range(4 * x, 4 * x + 4)) for x in range(COUNT)])
    place = mesh.attributes.new("p", "FLOAT_VECTOR", "FACE")
    place.data.foreach_set("vector", np.asarray(case["points"], dtype=np.float32).ravel())
    material = bpy.data.materials.new(case["name"])
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    output, shader = tree.nodes.new("ShaderNodeOutputMaterial"), tree.nodes.new("ShaderNodeEmission")
    texture = case["texture"] | ({} if case["output"] is None else {"output": case["output"]})
    tree.links.new(build(tree, texture, case.get("textures")), shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    mesh.materials.append(material)
    scene.collection.objects.link(bpy.data.objects.new(case["name"], mesh))


def written(cases):
    """The cases as JSON, one per line."""
    lines = [_line(case, {"points": _rows(case["points"], 12)}, _rows(case["values"])) for case in cases]
    return "[\n" + ",\n".join(lines) + "\n]\n"


def thinned(cases):
    """The data for the renderer's tests: sets of points, and cases with few values; "p" stands for the point.

    From Blender before 5.0 only Voronoi, whose cells have moved since then.
    """
    is_old = bpy.app.version < (5, 0, 0)
    sets, lines = [], []
    for case in cases:
        is_voronoi = case["texture"].get("node") == "voronoi"
        if is_old and (not is_voronoi or any(word in case["name"] for word in ("detail", "normalized"))):
            continue
        points = _rows(case["points"][THIN], 12)
        if points not in sets:
            sets.append(points)
        values = _rows(case["values"][THIN], 6)[: 4 if is_voronoi else None]
        if all(row[0] == row[1] == row[2] for row in values):
            values = [row[0] for row in values]
        texture = _short(case["texture"]) | ({} if case["output"] is None else {"output": case["output"]})
        if is_old:
            texture["hash"] = "lookup3"
        table = {"name": case["name"], "texture": texture, "values": values}
        number = sets.index(points)
        lines.append(json.dumps(table | ({"set": number} if number else {}), separators=(",", ":")))
    points = json.dumps(sets, separators=(",", ":"))
    return f'{{"sets":{points},"cases":[\n' + ",\n".join(lines) + "]}\n"


def _short(table):
    if table == POINT:
        return "p"
    if isinstance(table, dict):
        return {name: _short(value) for name, value in table.items()}
    return [_short(value) for value in table] if isinstance(table, list) else table


def _line(case, points, values):
    table = {name: case[name] for name in ("name", "texture", "output") if case[name] is not None}
    return json.dumps(table | points | {"values": values}, separators=(",", ":"))


def _rows(rows, digits=9):
    """Lists of numbers with this many digits; nine digits keep 32-bit numbers exact."""
    return [[_rounded(float(f"{number:.{digits}g}")) for number in row] for row in rows.tolist()]


def _rounded(number):
    return int(number) if number == int(number) and abs(number) < 1e6 else number


def main(out, thin=None):
    cases = cases_of()
    values_of(cases)
    pathlib.Path(out).write_text(written(cases), encoding="utf-8")
    if thin is not None:
        pathlib.Path(thin).write_text(thinned(cases), encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
