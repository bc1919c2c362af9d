"""Outputs of nodes that the scene file cannot express, as images that Blender bakes during the export."""

import json
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from .arithmetic import Node
from .graph import Place, follow
from .values import Lookup, Value

SIZE, SAMPLES = 1024, 16
# Seconds after which the baking process is given up.
PATIENCE = 300.0

# Nodes that depend on the view or on the rest of the scene: no image of a surface can hold them.
BY_VIEW = {"LAYER_WEIGHT", "FRESNEL", "CAMERA", "LIGHT_PATH", "AMBIENT_OCCLUSION", "SHADERTORGB", "PARTICLE_INFO"}
BY_VIEW_OUTPUTS = {"TEX_COORD": {"Window", "Reflection", "Camera"}, "NEW_GEOMETRY": {"Incoming", "Backfacing"}}
# Nodes that depend on where the object is, so that copies differ.
BY_PLACE = {"OBJECT_INFO", "VECT_TRANSFORM"}
BY_PLACE_OUTPUTS = {"NEW_GEOMETRY": {"Position", "Normal", "True Normal", "Tangent"}}


def key_of(place):
    """The key of a node's output, the same each time its tree is read."""
    return tuple(group.name for group in place.groups), place.node.name, place.socket.identifier


def upstream(place):
    """All outputs of nodes that contribute to an output, including itself."""
    waiting, seen = [place], set()
    while waiting:
        here = waiting.pop()
        if here in seen:
            continue
        seen.add(here)
        yield here
        for socket in here.node.inputs:
            if socket.enabled and socket.is_linked:
                found = follow(Place(socket, here.groups))
                if found is not None and found.socket.is_output:
                    waiting.append(found)


def _has(place, kinds, outputs):
    node = place.node
    return node.type in kinds or place.socket.name in outputs.get(node.type, ())


def can_be_baked(place):
    """Whether an image can hold an output: it must not depend on the view, and Blender must be able to bake it."""
    for here in upstream(place):
        node = here.node
        if _has(here, BY_VIEW, BY_VIEW_OUTPUTS) or here.socket.type == "SHADER":
            return False
        if node.type in ("TEX_IMAGE", "TEX_ENVIRONMENT") and _is_missing(node.image):
            return False
    return True


def _is_missing(image):
    return image is None or image.source == "VIEWER" or image.source != "TILED" and image.size[0] == 0


def is_of_place(place):
    """Whether an output depends on the object or its place."""
    for here in upstream(place):
        if _has(here, BY_PLACE, BY_PLACE_OUTPUTS):
            return True
        if here.node.type == "TEX_COORD" and here.node.object is not None and here.socket.name == "Object":
            return True
        if here.node.type == "ATTRIBUTE" and here.node.attribute_type != "GEOMETRY":
            return True
    return False


@dataclass(frozen=True)
class Corners:
    """UV of a mesh's corners that take the place of vertex colours."""

    key: tuple
    values: object = field(compare=False, repr=False)

    def __str__(self):
        return "baked UV"


@dataclass
class Body:
    """The requests for one object."""

    name: str
    original: object
    wanted: dict = field(default_factory=dict)
    """(name of a material, key of an output): the kind of its socket."""


class Bakes:
    """Collects what to bake while a scene is read, has Blender bake it, and holds the results."""

    def __init__(self):
        self._worlds = {}
        self._bodies = {}
        self._done = {}
        self._uv = {}
        self.failed = {}

    @property
    def is_wanted(self):
        """Whether a request is still open."""
        return bool(self._worlds or self._bodies)

    def ask_world(self, world, places):
        """Requests outputs of a world's nodes."""
        for place in places:
            at = ("world", world.name, key_of(place))
            if at not in self._done:
                self._worlds[at] = world.original

    def ask(self, placed, material, places):
        """Requests outputs of a material's nodes on an object."""
        original = placed.object.original
        for place in places:
            at = (placed.uid, material.name, key_of(place))
            if at in self._done or placed.instancer is not None and is_of_place(place):
                continue
            body = self._bodies.setdefault(placed.uid, Body(original.name, original))
            body.wanted[at] = material.original

    def of_world(self, world, place):
        """The result for an output of a world, by direction; None if there is none."""
        values = self._done.get(("world", world.name, key_of(place)))
        if values is None:
            return None
        turn = tuple(tuple(float(i == k) for k in range(3)) for i in range(3))
        return Value(lambda: values, 3, Lookup(turn), name=f"{world.name}-{place.node.name}")

    def of_surface(self, placed, material, place):
        """The result for an output on an object; None if there is none."""
        values = self._done.get((placed.uid, material.name, key_of(place)))
        if values is None:
            return None
        corners = self._uv[placed.uid]
        where = Value(None, 3, special={"attribute": "color"}, name=corners, is_vector=True)
        image = Value(lambda: values, 3, Lookup(wrap="clamp"), name=f"{material.name}-{place.node.name}")
        node = Node("image", {"image": image, "vector": where})
        is_number = place.socket.type in ("VALUE", "INT", "BOOLEAN")
        return node.output(None, 1 if is_number else 3, place.socket.type == "VECTOR")

    def has_surface(self, placed, material):
        """Whether anything of a material was baked on this object."""
        return any(at[0] == placed.uid and at[1] == material.name and values is not None
                   for at, values in self._done.items())

    def is_alike(self, placed, vertex_of):
        """Whether the present mesh is the one that was baked, judged by the vertices of its corners."""
        return np.array_equal(self._uv[placed.uid].values[:, 2].astype(np.int64), vertex_of)

    def run(self, depsgraph):
        """Has Blender bake all open requests."""
        with tempfile.TemporaryDirectory(prefix="beamfarm-bake-") as temporary:
            folder = Path(temporary)
            job, asked = self._job(depsgraph)
            names = {original for _, original in asked.items()}
            try:
                bpy.data.libraries.write(str(folder / "data.blend"), names, path_remap="ABSOLUTE", fake_user=True)
                (folder / "job.json").write_text(json.dumps(job), encoding="utf-8")
                done = subprocess.run(_command(folder), capture_output=True, timeout=PATIENCE, check=False)
                if not (folder / "failed.json").is_file():
                    raise OSError(f"Blender ended with {done.returncode}")
            except (OSError, RuntimeError, subprocess.TimeoutExpired) as error:
                self.failed["all"] = " ".join(str(error).split())
            self._take(job, folder)
        self._worlds, self._bodies = {}, {}

    def _job(self, depsgraph):
        scene = depsgraph.scene
        asked = {}
        self._files = {}

        def file_of(at):
            self._files[f"baked{len(self._files)}"] = at
            return f"baked{len(self._files) - 1}"

        worlds, objects = [], []
        for at, original in self._worlds.items():
            asked["world", original.name] = original
            worlds.append(_told(at) | {"world": original.name, "file": file_of(at), "size": SIZE})
        for uid, body in self._bodies.items():
            asked["object", body.name] = body.original
            bakes = []
            for at, material in body.wanted.items():
                asked["material", material.name] = material
                bakes.append(_told(at) | {"material": material.name, "file": file_of(at), "size": SIZE})
            objects.append({"object": body.name, "uv": f"uv{uid}", "bakes": bakes})
        job = {"worlds": worlds, "objects": objects, "frame": scene.frame_current, "subframe": scene.frame_subframe,
               "is_render": depsgraph.mode == "RENDER", "samples": SAMPLES}
        return job, asked

    def _take(self, job, folder):
        for what in job["objects"]:
            path = folder / f"{what['uv']}.npy"
            uid = int(what["uv"][2:])
            if path.is_file():
                values = np.load(path)
                # Later bakes of an object must use the same UV; otherwise they do not fit the earlier ones.
                if uid in self._uv and not np.array_equal(self._uv[uid].values, values):
                    self._files = {file: at for file, at in self._files.items() if at[0] != uid}
                self._uv.setdefault(uid, Corners(("baked", uid), values))
        for file, at in self._files.items():
            path = folder / f"{file}.npy"
            # None is a result as well: it is not requested again.
            self._done[at] = np.load(path) if path.is_file() else None
        failed = folder / "failed.json"
        if failed.is_file():
            self.failed |= json.loads(failed.read_text(encoding="utf-8"))


def _told(at):
    groups, node, socket = at[2]
    return {"groups": list(groups), "node": node, "socket": socket}


def _command(folder):
    script = str(Path(__file__).with_name("baker.py"))
    if bpy.app.binary_path:
        return [bpy.app.binary_path, "--background", "--factory-startup", "--python", script, "--", str(folder)]
    # Blender as a Python module.
    return [sys.executable, script, str(folder)]
