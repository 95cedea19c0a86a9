"""A version as an animated GLB: hands on a rig, the object's parts as moving nodes.

A hand is a mesh in its flat rest pose, skinned to the 16 joints of the hand, whose rotations are
the animation; the pose correctives of the hand model are morph targets. This reproduces the hand
model exactly, except at vertices with more than four joints, and gives Blender an editable rig.
Source: glTF 2.0 specification, Khronos Group. Metres; a root node turns the world's up axis to
glTF's y.
"""

import json
import struct
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_quat_wxyz
from geneoh.hand.model import HandModel, ShapedHand, pose_features
from geneoh.hand.skeleton import FINGERS, PARENTS
from geneoh.viz.camera import axes_towards
from geneoh.viz.look import DEFAULT_LOOK, SKIN_COLOUR, Colour, Look
from geneoh.viz.posed_track import PosedTrack
from geneoh.viz.scene import Scene
from geneoh.viz.surface import vertex_normals

COMPONENTS = {np.dtype("u1"): 5121, np.dtype("<u4"): 5125, np.dtype("<f4"): 5126}
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
ACCESSOR_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
JOINT_NAMES = ("wrist", *(f"{finger}{number}" for finger in FINGERS for number in (1, 2, 3)))
INFLUENCES = 4
"""Most joints that move a vertex: every program reads four, and in MANO and our hand the weights
beyond the fourth are negligible."""
ROUGHNESS = 0.8
NO_BULGE = 1e-5
"""Metres by which a pose corrective must move some vertex in a clip to be in its file."""


class _Document:
    """A glTF document that is being built: its JSON tables and its one binary buffer."""

    def __init__(self, seconds: Float[np.ndarray, " T"]) -> None:
        self.tables: dict[str, list[Any]] = {
            name: []
            for name in ("accessors", "bufferViews", "meshes", "nodes", "materials", "skins")
        }
        self.animation: dict[str, list[Any]] = {"channels": [], "samplers": []}
        self.binary = bytearray()
        self.times = self.accessor(seconds)

    def add(self, table: str, entry: dict[str, Any]) -> int:
        """Append an entry to a table; its index."""
        self.tables[table].append(entry)
        return len(self.tables[table]) - 1

    def accessor(
        self, values: Float[np.ndarray, "..."] | Int[np.ndarray, "..."], target: int | None = None
    ) -> int:
        """Append an array of scalars (N,) or vectors (N, D) with its bounds, as glTF requires."""
        kind = {"f": "<f4", "i": "<u4", "u": "u1"}[values.dtype.kind]
        packed = np.ascontiguousarray(values, dtype=kind)
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": packed.nbytes}
        if target is not None:
            view["target"] = target
        self.binary += packed.tobytes()
        rows = packed.reshape(len(packed), -1)
        entry = {
            "bufferView": self.add("bufferViews", view),
            "componentType": COMPONENTS[packed.dtype],
            "count": len(packed),
            "type": ACCESSOR_TYPES[rows.shape[1]],
            "min": rows.min(0).tolist(),
            "max": rows.max(0).tolist(),
        }
        return self.add("accessors", entry)

    def animate(
        self, node: int, path: str, values: Float[np.ndarray, "T ..."], how: str = "LINEAR"
    ) -> None:
        """Make a property of a node follow its values in all frames."""
        sampler = {"input": self.times, "output": self.accessor(values), "interpolation": how}
        channels, samplers = self.animation.values()
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append(sampler)

    def to_bytes(self, scene_nodes: list[int], title: str) -> bytes:
        """The finished GLB container."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "geneoh"},
            "scene": 0,
            "scenes": [{"name": title, "nodes": scene_nodes}],
            "buffers": [{"byteLength": len(self.binary)}],
        }
        document |= {name: table for name, table in self.tables.items() if table}
        if self.animation["channels"]:  # glTF allows no animation without channels
            document["animations"] = [{"name": title, **self.animation}]
        text, chunks = json.dumps(document, separators=(",", ":")).encode(), b""
        for name, data, filler in ((b"JSON", text, b" "), (b"BIN\0", bytes(self.binary), b"\0")):
            data += filler * (-len(data) % 4)
            chunks += struct.pack("<I4s", len(data), name) + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def glb_bytes(scene: Scene, look: Look = DEFAULT_LOOK) -> bytes:
    """The GLB of the last version; the look says which axis of the world becomes glTF's y."""
    document, version = _Document(np.arange(scene.frames) / scene.fps), scene.versions[-1]
    hands = [_add_hand(document, hand) for hand in version.hands]
    children = [wrist for _, wrist in hands]
    children += [_add_part(document, scene, i) for i in scene.parts]
    turn = torch.from_numpy(turn_to_y_up(look.upward)).float()
    w, x, y, z = matrix_to_quat_wxyz(turn).tolist()
    root = document.add("nodes", {"name": "world", "rotation": [x, y, z, w], "children": children})
    # glTF ignores the transform of a skinned mesh's own node: its joints place it
    return document.to_bytes([root, *(mesh for mesh, _ in hands)], version.title)


def turn_to_y_up(up: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """The rotation of the world by which `up` becomes y: (x, y, z) with z up to (x, z, -y)."""
    level = np.eye(3)[np.abs(up).argmin()]
    return axes_towards(np.cross(level, up), up)


def _add_mesh(
    document: _Document,
    name: str,
    verts: Float[np.ndarray, "V 3"],
    faces: Int[np.ndarray, "F 3"],
    colour: Colour,
) -> int:
    """A node with a mesh."""
    normals = vertex_normals(verts, faces)
    # glTF allows no normal of length zero, which a vertex without a face would have
    normals[np.linalg.norm(normals, axis=-1) < 0.5] = (0, 0, 1)
    # a matt surface; glTF expects linear colours, ours are sRGB
    linear = [*(np.array(colour) ** 2.2).tolist(), 1.0]
    surface = {"baseColorFactor": linear, "metallicFactor": 0.0, "roughnessFactor": ROUGHNESS}
    material = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}
    primitive: dict[str, Any] = {
        "attributes": {
            "POSITION": document.accessor(verts, ARRAY_BUFFER),
            "NORMAL": document.accessor(normals, ARRAY_BUFFER),
        },
        "indices": document.accessor(faces.reshape(-1), ELEMENT_BUFFER),
        "material": document.add("materials", material),
    }
    mesh = {"name": name, "primitives": [primitive]}
    return document.add("nodes", {"name": name, "mesh": document.add("meshes", mesh)})


def _add_hand(document: _Document, hand: PosedTrack) -> tuple[int, int]:
    """Nodes of a hand's mesh and of its rig's wrist; frames without the hand have scale zero."""
    shaped, rotations = hand.model.shaped(hand.betas), axis_angle_to_matrix(hand.pose)
    bulges, shares, rest = _bulges(hand.model, pose_features(rotations))
    verts, faces = (shaped.verts + rest).numpy(), hand.model.faces.numpy()
    node = _add_mesh(document, f"{hand.side} hand", verts, faces, SKIN_COLOUR)
    mesh = document.tables["meshes"][-1]
    (primitive,) = mesh["primitives"]
    joints = _add_joints(document, hand, shaped, rotations)
    document.tables["nodes"][node]["skin"] = _add_skin(document, joints, shaped)
    primitive["attributes"] |= _skin_weights(document, hand.model)
    if len(bulges):
        primitive["targets"] = [
            {"POSITION": document.accessor(bulge.numpy(), ARRAY_BUFFER)} for bulge in bulges
        ]
        mesh["weights"] = shares[0].tolist()
        document.animate(node, "weights", shares.flatten().numpy())
    return node, joints[0]


def _add_skin(document: _Document, joints: list[int], shaped: ShapedHand) -> int:
    """The skin of a hand: its joints, and their inverse bind matrices."""
    back = np.tile(np.eye(4), (len(joints), 1, 1))
    back[:, 3, :3] = -shaped.joints.numpy()  # glTF stores matrices column by column
    matrices = document.accessor(back.reshape(-1, 16))
    return document.add("skins", {"joints": joints, "inverseBindMatrices": matrices})


def _skin_weights(document: _Document, model: HandModel) -> dict[str, int]:
    """The joints that move each vertex and their weights, as attributes of a mesh."""
    weights, joints = model.skin_weights.topk(INFLUENCES, dim=1)
    weights = weights / weights.sum(1, keepdim=True)
    joints = joints.where(weights > 0, 0).byte()  # glTF wants joint 0 where the weight is zero
    return {
        "JOINTS_0": document.accessor(joints.numpy(), ARRAY_BUFFER),
        "WEIGHTS_0": document.accessor(weights.numpy(), ARRAY_BUFFER),
    }


def _bulges(
    model: HandModel, features: Float[Tensor, "T 135"]
) -> tuple[Float[Tensor, "K V 3"], Float[Tensor, "T K"], Float[Tensor, "V 3"]]:
    """Pose correctives that change in a clip, their weights in each frame, and the sum of the
    constant ones, metres.

    Weights are scaled to 0 to 1 over the clip, because Blender's sliders end there.
    """
    least, most = features.amin(0), features.amax(0)
    bulges = (most - least)[:, None, None] * model.pose_dirs.movedim(-1, 0)
    changing = bulges.abs().amax((1, 2)) > NO_BULGE
    constant = torch.where(changing, least, features.mean(0))
    shares = ((features - least) / (most - least).clamp(min=1e-9))[:, changing]
    return bulges[changing], shares, model.pose_dirs @ constant


def _add_joints(
    document: _Document, hand: PosedTrack, shaped: ShapedHand, rotations: Float[Tensor, "T 16 3 3"]
) -> list[int]:
    """The nodes of a hand's joints, in MANO order, each of which turns in its parent's frame."""
    nodes: list[int] = []
    for joint, (name, parent) in enumerate(zip(JOINT_NAMES, PARENTS, strict=True)):
        place = hand.wrist[0] if parent < 0 else shaped.offsets[joint - 1]
        turns = _xyzw(matrix_to_quat_wxyz(rotations[:, joint]).numpy())
        entry = {"translation": place.tolist(), "rotation": turns[0].tolist()}
        nodes.append(document.add("nodes", {"name": f"{hand.side}_{name}", **entry}))
        if parent >= 0:
            document.tables["nodes"][nodes[parent]].setdefault("children", []).append(nodes[-1])
        if len(turns) > 1:
            document.animate(nodes[-1], "rotation", turns)
    if len(hand.wrist) > 1:
        document.animate(nodes[0], "translation", hand.wrist.numpy())
    valid = hand.valid.numpy()
    if not valid.all():
        document.animate(nodes[0], "scale", np.repeat(valid[:, None] * 1.0, 3, 1), "STEP")
    return nodes


def _xyzw(quat_wxyz: Float[np.ndarray, "T 4"]) -> Float[np.ndarray, "T 4"]:
    """The same rotations in glTF's order, with signs that are continuous over time."""
    agrees = (quat_wxyz[1:] * quat_wxyz[:-1]).sum(-1) >= 0
    signs = np.cumprod(np.where(np.concatenate([[True], agrees]), 1.0, -1.0))
    quat = quat_wxyz * signs[:, None]
    quat = (quat / np.linalg.norm(quat, axis=-1, keepdims=True)).astype(np.float32)
    return quat[:, [1, 2, 3, 0]]


def _add_part(document: _Document, scene: Scene, part: int) -> int:
    """A part of the object that moves as it does in the world."""
    mesh = scene.object.meshes[part]
    verts, faces = mesh.verts.numpy().astype(np.float32), mesh.faces.numpy()
    node = _add_mesh(document, scene.part_name(part), verts, faces, scene.part_colour(part))
    quat, translation = scene.part_motion(part)
    quat_xyzw = _xyzw(quat)
    document.tables["nodes"][node] |= {
        "rotation": quat_xyzw[0].tolist(),
        "translation": translation[0].tolist(),
    }
    document.animate(node, "rotation", quat_xyzw)
    document.animate(node, "translation", translation)
    return node
