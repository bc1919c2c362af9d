"""Cameras, surroundings, fog, visibility, links and instances, against Cycles."""

import math
import pathlib
import unittest

import bpy
import compare
import numpy as np
import scenes
from mathutils import Vector

CLOUD = pathlib.Path(__file__).resolve().parents[2] / "scenes" / "volumes" / "cloud.vdb"


def floor(world=0.0):
    scenes.empty()
    compare.use_cycles()
    scenes.camera((0.0, -4.0, 3.0), (0.0, 0.0, 0.2))
    scenes.plane("Floor", 6.0, material=scenes.diffuse("Floor"))
    scenes.background().inputs["Color"].default_value = (world, world, world, 1.0)


class Compared(unittest.TestCase):
    def check(self, name, **how):
        return compare.check(self, name, **how)


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Cameras(Compared):
    def setUp(self):
        self.room()

    def room(self):
        floor()
        scenes.ball("Ball", 0.5, (0.0, 0.0, 0.5), scenes.diffuse("Red", (0.8, 0.3, 0.2)))
        scenes.cube("Green", 0.6, (1.2, 0.3, 0.3), scenes.diffuse("Green", (0.2, 0.7, 0.3)))
        scenes.cube("Blue", 0.6, (-1.5, 0.8, 0.3), scenes.diffuse("Blue", (0.2, 0.3, 0.8)))
        scenes.light("SUN", (2.0, -2.0, 3.0), 3.0, angle=0.0)
        self.camera = bpy.context.scene.camera.data

    def test_shift_and_fit(self):
        for fit, size in (("AUTO", (64, 48)), ("AUTO", (48, 64)), ("HORIZONTAL", (48, 64)), ("VERTICAL", (64, 48))):
            with self.subTest(fit, size=size):
                self.room()
                render = bpy.context.scene.render
                render.resolution_x, render.resolution_y = size
                self.camera.sensor_fit, self.camera.lens = fit, 30.0
                self.camera.shift_x, self.camera.shift_y = 0.2, -0.1
                self.check(f"shift, sensor fit {fit.lower()}, {size[0]} x {size[1]}")

    def test_depth_of_field(self):
        bpy.context.scene.camera.scale = (2.0, 2.0, 2.0)
        dof = self.camera.dof
        dof.use_dof, dof.aperture_fstop, dof.focus_object = True, 0.1, bpy.data.objects["Green"]
        self.check("depth of field", passes=64)

    @unittest.skipUnless(compare.knows("CameraRecord", "view_width"), "this beamfarm knows no orthographic cameras")
    def test_orthographic(self):
        for fit, size in (("AUTO", (64, 48)), ("AUTO", (48, 64)), ("VERTICAL", (64, 48))):
            with self.subTest(fit, size=size):
                self.room()
                render = bpy.context.scene.render
                render.resolution_x, render.resolution_y = size
                self.camera.type, self.camera.ortho_scale, self.camera.sensor_fit = "ORTHO", 4.0, fit
                self.camera.shift_x, self.camera.shift_y = 0.1, -0.05
                self.check(f"orthographic, {fit.lower()}, {size[0]} x {size[1]}")

    @unittest.skipUnless(compare.knows("CameraRecord", "image_circle"), "this beamfarm knows no panoramas")
    def test_panoramas(self):
        # Another light, behind the camera.
        scenes.light("POINT", (0.0, -5.0, 4.0), 300.0)
        whole = {"longitude_min": -math.pi, "longitude_max": math.pi, "latitude_min": -1.5, "latitude_max": 1.5}
        part = {"longitude_min": -1.0, "longitude_max": 2.0, "latitude_min": -1.2, "latitude_max": 0.4}
        for kind, size, values in (
            ("EQUIRECTANGULAR", (64, 32), whole),
            ("EQUIRECTANGULAR", (48, 32), part),
            ("FISHEYE_EQUIDISTANT", (48, 48), {"fisheye_fov": 4.0}),
            ("FISHEYE_EQUIDISTANT", (64, 40), {"fisheye_fov": 3.0}),
            ("FISHEYE_EQUISOLID", (64, 40), {"fisheye_fov": 3.0, "fisheye_lens": 12.0}),
        ):
            with self.subTest(kind=kind, size=size):
                self.camera.type = "PANO"
                own = self.camera if hasattr(self.camera, "panorama_type") else self.camera.cycles
                own.panorama_type = kind
                for name, value in values.items():
                    setattr(own, name, value)
                render = bpy.context.scene.render
                render.resolution_x, render.resolution_y = size
                self.check(f"{kind.lower()}, {size}", blocks=1.5)

    def test_panoramas_are_refused_by_name(self):
        self.camera.type = "PANO"
        own = self.camera if hasattr(self.camera, "panorama_type") else self.camera.cycles
        own.panorama_type = "MIRRORBALL"
        with self.assertRaisesRegex(ValueError, "'Camera' is a panoramic one"):
            compare.export_scene()


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Surroundings(Compared):
    def sky(self, rotation=(0.0, 0.0, 0.0), kind="POINT"):
        """A sky with a bright spot, and a ball that mirrors it."""
        floor()
        picture = bpy.data.images.new("sky", 256, 128, float_buffer=True)
        y, x = np.mgrid[0:128, 0:256]
        values = np.ones((128, 256, 4), dtype=np.float32)
        spot = 5.0 * np.exp(-((x - 200) ** 2 + (y - 96) ** 2) / 320.0)
        for channel, value in enumerate((0.7 + 0.3 * np.sin(x * np.pi / 128), 0.2 + y / 128, 0.5)):
            values[..., channel] = value + spot
        picture.pixels.foreach_set(values.ravel())
        picture.update()
        tree = bpy.context.scene.world.node_tree
        node, mapped = tree.nodes.new("ShaderNodeTexEnvironment"), tree.nodes.new("ShaderNodeMapping")
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        node.image, mapped.vector_type = picture, kind
        mapped.inputs["Rotation"].default_value = rotation
        tree.links.new(coordinates.outputs["Generated"], mapped.inputs["Vector"])
        tree.links.new(mapped.outputs["Vector"], node.inputs["Vector"])
        tree.links.new(node.outputs["Color"], scenes.background().inputs["Color"])
        scenes.background().inputs["Strength"].default_value = 1.5
        mirror = scenes.material("Mirror", "ShaderNodeBsdfGlossy", Roughness=0.0, Color=(0.9, 0.9, 0.9))
        scenes.ball("Ball", 0.6, (0.0, 0.0, 0.6), mirror)
        camera = bpy.context.scene.camera
        camera.data.lens, camera.location = 18.0, (0.0, -4.0, 1.0)
        camera.rotation_euler = (Vector((0.0, 0.0, 0.8)) - camera.location).to_track_quat("-Z", "Y").to_euler()

    def test_mapping(self):
        cases = [((0.0, 0.0, 0.0), "POINT"), ((0.0, 0.0, 0.7), "POINT"), ((0.4, 0.3, 0.7), "POINT")]
        for rotation, kind in [*cases, ((0.4, 0.3, 0.7), "TEXTURE")]:
            with self.subTest(kind, rotation=rotation):
                self.sky(rotation, kind)
                self.assertEqual(self.check(f"sky by image, {kind.lower()} {rotation}").left_out, [])


def volume(node, **inputs):
    made = bpy.data.materials.new("Volume")
    made.use_nodes = True
    _volume(made.node_tree, "ShaderNodeOutputMaterial", node, inputs)
    return made


def _volume(tree, output, node, inputs):
    if output.endswith("Material"):
        tree.nodes.clear()
        tree.nodes.new(output)
    shader = tree.nodes.new(node)
    scenes.set_inputs(shader, inputs)
    end = next(node for node in tree.nodes if node.bl_idname == output)
    tree.links.new(shader.outputs[0], end.inputs["Volume"])


def world_volume(node, **inputs):
    _volume(bpy.context.scene.world.node_tree, "ShaderNodeOutputWorld", node, inputs)


WARM = {"Color": (0.8, 0.6, 0.4)}


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Fog(Compared):
    def setUp(self):
        floor()

    def fog(self, node="ShaderNodeVolumePrincipled", **inputs):
        scenes.cube("Fog", 3.0, (0.0, 0.0, 1.6), volume(node, **WARM, **inputs))

    def spot(self):
        scenes.light("SPOT", (1.0, 0.5, 2.5), 200.0, spot_size=math.radians(60.0), spot_blend=0.5)

    def test_shaders(self):
        cases = {
            "Scatter": {"Density": 0.3, "Anisotropy": 0.3},
            "Absorption": {"Density": 0.6},
            "Principled": {"Density": 0.3, "Anisotropy": 0.3, "Absorption_Color": (0.2, 0.3, 0.04)},
        }
        for name, inputs in cases.items():
            with self.subTest(name):
                floor()
                self.fog(f"ShaderNodeVolume{name}", **inputs)
                scenes.light("POINT", (1.0, 0.5, 2.5), 200.0)
                self.check(f"fog, {name.lower()}, point")

    def test_spot(self):
        self.fog(Density=0.3)
        self.spot()
        self.check("fog, spot")

    def test_sky(self):
        self.fog(Density=0.3)
        scenes.background().inputs["Color"].default_value = (0.5, 0.5, 0.7, 1.0)
        self.check("fog under a sky")

    def test_area_in_fog(self):
        self.fog(Density=0.3)
        scenes.light("AREA", (0.0, 0.0, 2.8), 100.0, size=1.0)
        self.check("fog with an area light in it")

    def test_world(self):
        world_volume("ShaderNodeVolumePrincipled", **WARM, Density=0.1)
        scenes.light("POINT", (1.0, 0.5, 2.5), 200.0)
        self.check("fog in all of the world", passes=32)

    def test_nested(self):
        dense = {"Color": (0.2, 0.9, 0.3), "Density": 2.0}
        for world in (False, True):
            with self.subTest(world=world):
                floor()
                if world:
                    world_volume("ShaderNodeVolumePrincipled", **WARM, Density=0.1)
                else:
                    self.fog(Density=0.2)
                scenes.ball("Dense", 0.5, (0.0, 0.0, 1.0), volume("ShaderNodeVolumeScatter", **dense))
                self.spot()
                self.check(f"a ball of fog in fog{' of the world' if world else ''}", passes=32)

    def test_glass_without_a_volume_is_filled_by_the_fog(self):
        self.fog(Density=0.3)
        scenes.light("AREA", (1.0, 0.5, 2.5), 200.0, size=1.0)
        glass = scenes.material("Glass", "ShaderNodeBsdfGlass", Roughness=0.0, Color=(1.0, 1.0, 1.0), IOR=1.0001)
        scenes.ball("Glass", 0.5, (0.0, 0.0, 1.0), glass)
        self.check("glass in fog", passes=32)

    def test_volume_object(self):
        data = bpy.data.volumes.new("Cloud")
        data.filepath = str(CLOUD)
        data.grids.load()
        corners = np.array(scenes.link("Cloud", data).bound_box)
        cloud = bpy.data.objects["Cloud"]
        data.materials.append(volume("ShaderNodeVolumePrincipled", **WARM, Density=3.0))
        size = (corners.max(0) - corners.min(0)).max() if np.ptp(corners) > 0.0 else 1.0
        cloud.scale = [2.0 / size] * 3
        cloud.rotation_euler = (0.5, 0.2, 0.1)
        cloud.location = (0.0, 0.0, 1.5)
        scenes.light("POINT", (1.0, -0.5, 3.5), 200.0)
        result = self.check("cloud by OpenVDB", passes=32)
        self.assertEqual(result.left_out, [])


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Rules(Compared):
    def setUp(self):
        floor(world=0.1)
        scenes.light("AREA", (1.0, -0.5, 3.0), 200.0, size=1.0)
        self.ball = scenes.ball("Ball", 0.5, (0.0, 0.0, 0.6), scenes.diffuse("Red", (0.9, 0.2, 0.2)))
        mirror = scenes.material("Mirror", "ShaderNodeBsdfGlossy", Roughness=0.0, Color=(1.0, 1.0, 1.0))
        scenes.plane("Mirror", 3.0, (0.0, 1.2, 1.0), scenes.degrees(90, 0, 0), mirror)

    def test_ray_visibility(self):
        for name in ("visible_camera", "visible_glossy", "visible_shadow"):
            with self.subTest(name):
                self.setUp()
                setattr(self.ball, name, False)
                # An object that casts no shadow on surfaces still blocks photons: those that bounce below the ball.
                self.check(f"not {name}", blocks=1.5 if name == "visible_shadow" else 1.0)

    def linked(self, names, state):
        collection = bpy.data.collections.new("Linked")
        for name in names:
            collection.objects.link(bpy.data.objects[name])
        for settings in collection.collection_objects:
            settings.light_linking.link_state = state
        scenes.background().inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
        lamp = scenes.light("AREA", (-1.0, -1.0, 2.0), 100.0, name="Linked", color=(0.2, 1.0, 0.4), size=0.8)
        return lamp.light_linking, collection

    def test_receivers(self):
        for state in ("INCLUDE", "EXCLUDE"):
            with self.subTest(state):
                self.setUp()
                linking, linking_to = self.linked(["Ball"], state)
                linking.receiver_collection = linking_to
                self.check(f"light linking, {state.lower()}", blocks=1.5)

    def test_blockers(self):
        for state, names in (("INCLUDE", ["Mirror"]), ("EXCLUDE", ["Ball"])):
            with self.subTest(state):
                self.setUp()
                linking, linking_to = self.linked(names, state)
                linking.blocker_collection = linking_to
                self.check(f"shadow linking, {state.lower()}", blocks=1.5)


@unittest.skipUnless(compare.program(), "no beamfarm: set BEAMFARM, or build it")
class Objects(Compared):
    def setUp(self):
        floor()
        scenes.light("AREA", (1.0, -1.0, 4.0), 200.0, size=1.0)

    def test_particles(self):
        ball = scenes.ball("Ball", 0.3, (-5.0, 5.0, 0.3), scenes.diffuse("Red", (0.8, 0.3, 0.2)), segments=16)
        emitter = bpy.data.objects["Floor"]
        emitter.modifiers.new("Particles", "PARTICLE_SYSTEM")
        settings = emitter.particle_systems[0].settings
        settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 40, 0, 0, 100
        settings.physics_type, settings.render_type, settings.emit_from = "NO", "OBJECT", "FACE"
        settings.instance_object, settings.particle_size = ball, 0.5
        bpy.context.scene.frame_set(2)
        result = self.check("particles")
        text = result.text
        self.assertEqual(text.count('type = "instances"'), 1)

    def test_what_becomes_a_mesh(self):
        bpy.ops.object.text_add(location=(-1.0, 0.0, 0.05))
        text = bpy.context.object
        text.data.body, text.data.extrude = "Text", 0.2
        text.data.materials.append(scenes.diffuse("Blue", (0.2, 0.3, 0.8)))
        bpy.ops.curve.primitive_bezier_circle_add(location=(0.0, -1.0, 0.3))
        curve = bpy.context.object
        curve.data.bevel_depth = 0.1
        curve.data.materials.append(scenes.diffuse("Red", (0.8, 0.3, 0.2)))
        bpy.ops.object.metaball_add(location=(1.0, 1.0, 0.3), radius=1.0)
        bpy.context.object.data.materials.append(scenes.diffuse("Green", (0.3, 0.8, 0.2)))
        cube = scenes.cube("Cube", 1.0, (-1.5, 1.0, 0.5), scenes.diffuse("Yellow", (0.7, 0.7, 0.1)))
        modifier = cube.modifiers.new("Subdivision", "SUBSURF")
        modifier.levels = modifier.render_levels = 2
        self.check("curves, text, metaball, modifier")

    def test_slots(self):
        cube = scenes.cube("Cube", 1.0, (0.0, 0.0, 0.6), scenes.diffuse("Red", (0.8, 0.2, 0.2)))
        cube.data.materials.append(scenes.diffuse("Green", (0.2, 0.8, 0.2)))
        for polygon in list(cube.data.polygons)[::2]:
            polygon.material_index = 1
        self.check("two materials")


if __name__ == "__main__":
    unittest.main()
