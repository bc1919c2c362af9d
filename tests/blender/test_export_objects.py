"""Which objects are in scene files, and what is reported about those that are not visible. No renderer is needed."""

import pathlib
import tempfile
import tomllib
import unittest

import bpy
import bmesh  # comes with bpy
import compare
import numpy as np
import scenes
from export import Exporter, ExportSettings, View
from mathutils import Matrix


def scene_of_nothing():
    scenes.empty()
    compare.use_cycles()
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))


def triangles(path):
    """Corners of the triangles of a PLY file, (n, 3, 3), in object space."""
    header, _, body = path.read_bytes().partition(b"end_header\n")
    lines = header.decode().splitlines()
    counts = {line.split()[1]: int(line.split()[2]) for line in lines if line.startswith("element")}
    width = sum(line.startswith("property float") for line in lines)
    points = np.frombuffer(body, "<f4", counts["vertex"] * width).reshape(-1, width)[:, :3]
    faces = np.frombuffer(body[points.shape[0] * width * 4 :], [("count", "u1"), ("corners", "<i4", 3)])
    return points[faces["corners"]].astype(np.float64)


def area(path):
    corners = triangles(path)
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()


class Exported:
    """An export of bpy's scene: tables, what is left out, and the area of each shape's mesh in object space."""

    def __init__(self, **how):
        with tempfile.TemporaryDirectory() as folder:
            result = compare.export_scene(pathlib.Path(folder), **how)
            self.scene = tomllib.loads(result.text)
            self.left_out, self.notes = result.left_out, result.notes
            self.shapes = {shape["name"]: shape for shape in self.scene.get("shapes", [])}
            meshes = {name: shape.get("shape", shape) for name, shape in self.shapes.items()}
            self.areas = {name: area(pathlib.Path(folder) / mesh["file"]) for name, mesh in meshes.items()}


def edit(object):
    bpy.context.view_layer.objects.active = object
    bpy.ops.object.mode_set(mode="EDIT")


def without_its_top(mesh):
    """Removes the face with the highest centre from the mesh in edit mode."""
    edited = bmesh.from_edit_mesh(mesh)
    top = max(edited.faces, key=lambda face: face.calc_center_median().z)
    bmesh.ops.delete(edited, geom=[top], context="FACES_ONLY")
    bmesh.update_edit_mesh(mesh)


class EditMode(unittest.TestCase):
    def setUp(self):
        scene_of_nothing()
        self.cube = scenes.cube("Cube", 1.0, (0.0, 0.0, 0.5), scenes.diffuse("Red", (0.8, 0.2, 0.2)))

    def check(self, **areas):
        found = Exported()
        self.assertEqual(found.left_out, [])
        self.assertEqual(set(found.areas), set(areas))
        for name, wanted in areas.items():
            self.assertAlmostEqual(found.areas[name], wanted, 5, name)
        return found

    def test_what_is_edited_is_there_as_it_is_now(self):
        edit(self.cube)
        found = self.check(Cube=6.0)
        self.assertEqual(found.shapes["Cube"]["material"], "Red")
        without_its_top(self.cube.data)
        self.check(Cube=5.0)
        bpy.ops.object.mode_set(mode="OBJECT")
        self.check(Cube=5.0)

    def test_a_file_that_was_saved_in_edit_mode(self):
        edit(self.cube)
        without_its_top(self.cube.data)
        with tempfile.TemporaryDirectory() as folder:
            path = str(pathlib.Path(folder) / "edited.blend")
            bpy.ops.wm.save_as_mainfile(filepath=path)
            bpy.ops.wm.read_homefile(use_empty=True)
            bpy.ops.wm.open_mainfile(filepath=path)
        self.assertEqual(bpy.data.objects["Cube"].mode, "EDIT")
        self.check(Cube=5.0)

    def test_modifiers_count(self):
        self.cube.modifiers.new("Array", "ARRAY").relative_offset_displace[0] = 2.0
        edit(self.cube)
        self.check(Cube=12.0)

    def test_shape_keys_count(self):
        self.cube.shape_key_add(name="Basis")
        key = self.cube.shape_key_add(name="Flat")
        for point in key.data:
            point.co.z *= 0.5
        key.value = 1.0
        self.check(Cube=4.0)
        self.cube.use_shape_key_edit_mode = True
        self.cube.active_shape_key_index = 1
        edit(self.cube)
        self.check(Cube=4.0)

    def test_maps_and_colours_of_what_is_edited(self):
        texture = self.cube.data.materials[0].node_tree
        node = texture.nodes.new("ShaderNodeTexImage")
        node.image = bpy.data.images.new("four", 2, 2)
        shader = next(node for node in texture.nodes if node.type == "BSDF_DIFFUSE")
        texture.links.new(node.outputs["Color"], shader.inputs["Color"])
        files = []
        for mode in ("OBJECT", "EDIT"):
            bpy.ops.object.mode_set(mode=mode)
            with tempfile.TemporaryDirectory() as folder:
                compare.export_scene(pathlib.Path(folder))
                files.append({path.name: path.read_bytes() for path in pathlib.Path(folder).rglob("*.ply")})
        self.assertEqual(files[0], files[1])
        self.assertIn(b"property float u", next(iter(files[0].values())))

    def test_all_that_share_the_mesh_are_there(self):
        scenes.link("Other", self.cube.data)
        smooth = scenes.link("Halves", self.cube.data)
        smooth.modifiers.new("Array", "ARRAY").relative_offset_displace[0] = 2.0
        collection = bpy.data.collections.new("Cubes")
        collection.objects.link(self.cube)
        copies = scenes.link("Copies", None)
        copies.instance_type, copies.instance_collection = "COLLECTION", collection
        edit(self.cube)
        without_its_top(self.cube.data)
        found = Exported()
        self.assertEqual(found.left_out, [])
        self.assertEqual(sorted(round(each, 4) for each in found.areas.values()), [5.0, 5.0, 5.0, 10.0])

    def test_several_at_once(self):
        other = scenes.cube("Other", 2.0)
        for object in (self.cube, other):
            object.select_set(True)
        edit(self.cube)
        self.assertEqual(other.mode, "EDIT")
        self.check(Cube=6.0, Other=24.0)

    def test_curves_and_texts(self):
        bpy.data.objects.remove(self.cube)
        bpy.ops.curve.primitive_bezier_circle_add(radius=1.0)
        bpy.context.object.name = "Ring"
        bpy.context.object.data.bevel_depth = 0.1
        for mode in ("OBJECT", "EDIT"):
            bpy.ops.object.mode_set(mode=mode)
            found = Exported()
            self.assertEqual((list(found.areas), found.left_out), (["Ring"], []))
            self.assertGreater(found.areas["Ring"], 3.0)

    def test_blur_of_what_is_edited(self):
        self.cube.keyframe_insert("location", frame=1)
        self.cube.location.x = 1.0
        self.cube.keyframe_insert("location", frame=2)
        bpy.context.scene.frame_set(1)
        bpy.context.scene.render.use_motion_blur = True
        edit(self.cube)
        found = self.check(Cube=6.0)
        self.assertIn("keys", found.shapes["Cube"]["transform"])

    def test_edits_reach_a_viewport(self):
        view = View(Matrix.Translation((0.0, -4.0, 1.0)), 40.0, 4.0, False)
        settings = ExportSettings(64, 48, view=view)
        edit(self.cube)
        with tempfile.TemporaryDirectory() as folder:
            exporter = Exporter(folder)

            def now(write):
                result = write(bpy.context.evaluated_depsgraph_get(), settings)
                shape = tomllib.loads(result.scene.read_text(encoding="utf-8"))["shapes"][0]
                return area(pathlib.Path(folder) / shape["file"])

            changed = []

            def see(_scene, _depsgraph):
                changed.append(now(exporter.update))

            self.assertAlmostEqual(now(exporter.write), 6.0, 5)
            bpy.app.handlers.depsgraph_update_post.append(see)
            try:
                without_its_top(self.cube.data)
                bpy.context.view_layer.update()
            finally:
                bpy.app.handlers.depsgraph_update_post.remove(see)
            self.assertAlmostEqual(changed[-1], 5.0, 5)


class Nothing(unittest.TestCase):
    """If nothing is seen of an object, the list says why."""

    def setUp(self):
        scene_of_nothing()

    def check(self, *lines):
        found = Exported()
        self.assertEqual(found.left_out, [f"left out: {line}" for line in lines])
        return found

    def test_meshes_without_faces(self):
        scenes.mesh("Line", [(0, 0, 0), (1, 0, 0)], [])
        scenes.mesh("Flat", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [(0, 1, 2)])
        scenes.mesh("Empty", [], [])
        self.check("object 'Line': no faces", "object 'Flat': no face has an area", "object 'Empty': no faces")

    def test_objects_that_are_scaled_to_nothing(self):
        scenes.plane("Point").scale = (0.0, 0.0, 0.0)
        self.check("object 'Point': its scale makes it a line or a point")

    def test_modifiers_that_leave_nothing(self):
        mask = scenes.cube("Masked").modifiers.new("Mask", "MASK")
        bpy.data.objects["Masked"].vertex_groups.new(name="none")
        mask.vertex_group = "none"
        self.check("object 'Masked': no faces")

    def test_curves_and_texts_without_a_surface(self):
        bpy.ops.curve.primitive_bezier_curve_add()
        bpy.context.object.name = "Path"
        bpy.ops.object.text_add()
        bpy.context.object.name, bpy.context.object.data.body = "Said", ""
        self.check(
            "object 'Path': no faces: a curve without bevel or extrusion",
            "object 'Said': no faces: a text without letters or fill",
        )

    def test_metaballs_are_one_surface(self):
        for x in (0.0, 1.0):
            bpy.ops.object.metaball_add(location=(x, 0.0, 0.0))
        self.assertEqual(len(self.check().shapes), 1)

    def test_point_clouds_without_points(self):
        scenes.link("Dust", bpy.data.pointclouds.new("Dust"))
        self.check("object 'Dust': no points with a radius")

    def test_instancers_are_something(self):
        parent = scenes.mesh("Places", [(0, 0, 0), (2, 0, 0)], [])
        child = scenes.cube("Cube")
        child.parent, parent.instance_type = parent, "VERTS"
        self.check()

    def test_what_nobody_wants_to_see_is_not_missed(self):
        scenes.link("Empty", None)
        scenes.mesh("Hidden", [], []).hide_render = True
        self.check()

    def test_it_comes_after_what_is_missed(self):
        scenes.mesh("Line", [(0, 0, 0), (1, 0, 0)], [])
        scenes.plane("Floor").is_shadow_catcher = True
        left_out = Exported().left_out
        self.assertIn("shadow catcher", left_out[0])
        self.assertEqual(left_out[1:], ["left out: object 'Line': no faces"])

    def test_each_is_told_once_where_it_moves(self):
        line = scenes.mesh("Line", [(0, 0, 0), (1, 0, 0)], [])
        line.keyframe_insert("location", frame=1)
        line.location.x = 1.0
        line.keyframe_insert("location", frame=2)
        bpy.context.scene.render.use_motion_blur = True
        self.check("object 'Line': no faces")


class Polygons(unittest.TestCase):
    def test_a_concave_polygon_has_its_own_area(self):
        """A U of 3 x 3 with a gap of 1 x 2, starting at every corner and in both directions."""
        u = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (2, 3, 0), (2, 1, 0), (1, 1, 0), (1, 3, 0), (0, 3, 0)]
        for first in range(len(u)):
            for corners in (u[first:] + u[:first], (u[first:] + u[:first])[::-1]):
                scene_of_nothing()
                scenes.mesh("U", corners, [tuple(range(len(u)))])
                self.assertAlmostEqual(Exported().areas["U"], 7.0, 5)

    def test_no_triangle_lies_in_the_gap(self):
        scene_of_nothing()
        u = [(0, 0, 0), (3, 0, 0), (3, 3, 0), (2, 3, 0), (2, 1, 0), (1, 1, 0), (1, 3, 0), (0, 3, 0)]
        scenes.mesh("U", u, [tuple(range(len(u)))])
        with tempfile.TemporaryDirectory() as folder:
            compare.export_scene(pathlib.Path(folder))
            (path,) = pathlib.Path(folder).rglob("*.ply")
            middles = triangles(path).mean(axis=1)
        in_gap = (middles[:, 0] > 1.0) & (middles[:, 0] < 2.0) & (middles[:, 1] > 1.0)
        self.assertFalse(in_gap.any(), middles)


if __name__ == "__main__":
    unittest.main()
