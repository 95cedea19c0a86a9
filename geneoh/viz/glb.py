"""A version as an animated GLB: the hand as morph targets, the object's parts as moving nodes.

One morph target per frame holds the exact vertices and normals, and the weights run through them.
This needs no skinning, so it is exact for any hand model, and Blender and three.js play it. Source:
glTF 2.0 specification, Khronos Group. Metres; a root node turns the world's up axis to glTF's y.
"""

import json
import struct
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int

from geneoh.geometry.rotations import matrix_to_quat_wxyz
from geneoh.viz.camera import axes_towards
from geneoh.viz.look import DEFAULT_LOOK, SKIN_COLOUR, Colour, Look
from geneoh.viz.scene import PosedTrack, Scene
from geneoh.viz.surface import vertex_normals

FLOAT, UINT = 5126, 5125
ARRAY_BUFFER, ELEMENT_BUFFER = 34962, 34963
ACCESSOR_TYPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
ROUGHNESS = 0.8


class _Document:
    """A glTF document that is being built: its JSON tables and its one binary buffer."""

    def __init__(self) -> None:
        self.tables: dict[str, list[Any]] = {
            name: [] for name in ("accessors", "bufferViews", "meshes", "nodes", "materials")
        }
        self.animation: dict[str, list[Any]] = {"channels": [], "samplers": []}
        self.binary = bytearray()

    def add(self, table: str, entry: dict[str, Any]) -> int:
        """Append an entry to a table; its index."""
        self.tables[table].append(entry)
        return len(self.tables[table]) - 1

    def accessor(
        self, values: Float[np.ndarray, "..."] | Int[np.ndarray, "..."], target: int | None = None
    ) -> int:
        """Append an array of scalars (N,) or vectors (N, D) with its bounds, as glTF requires."""
        whole = values.dtype.kind in "iu"
        packed = np.ascontiguousarray(values, dtype="<u4" if whole else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.binary), "byteLength": packed.nbytes}
        if target is not None:
            view["target"] = target
        self.binary += packed.tobytes()
        rows = packed.reshape(len(packed), -1)
        entry = {
            "bufferView": self.add("bufferViews", view),
            "componentType": UINT if whole else FLOAT,
            "count": len(packed),
            "type": ACCESSOR_TYPES[rows.shape[1]],
            "min": rows.min(0).tolist(),
            "max": rows.max(0).tolist(),
        }
        return self.add("accessors", entry)

    def animate(self, node: int, path: str, times: int, values: int, how: str = "LINEAR") -> None:
        """Make a property of a node follow keyframes."""
        channels, samplers = self.animation.values()
        channels.append({"sampler": len(samplers), "target": {"node": node, "path": path}})
        samplers.append({"input": times, "output": values, "interpolation": how})

    def to_bytes(self, scene_nodes: list[int], title: str) -> bytes:
        """The finished GLB container."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": "geneoh"},
            "scene": 0,
            "scenes": [{"name": title, "nodes": scene_nodes}],
            "buffers": [{"byteLength": len(self.binary)}],
            **self.tables,
        }
        if self.animation["channels"]:  # glTF allows none without
            document["animations"] = [{"name": title, **self.animation}]
        text, chunks = json.dumps(document, separators=(",", ":")).encode(), b""
        for name, data, filler in ((b"JSON", text, b" "), (b"BIN\0", bytes(self.binary), b"\0")):
            data += filler * (-len(data) % 4)
            chunks += struct.pack("<I4s", len(data), name) + data
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def glb_bytes(scene: Scene, look: Look = DEFAULT_LOOK) -> bytes:
    """The GLB of the last version; the look says which axis of the world becomes glTF's y."""
    document, version = _Document(), scene.versions[-1]
    seconds = (np.arange(scene.frames) / scene.fps).astype(np.float32)
    times = document.accessor(seconds)
    children = [_add_hand(document, hand, times) for hand in version.hands]
    children += [_add_part(document, scene, i, times) for i in range(len(scene.object.meshes))]
    turn = torch.from_numpy(upright(look.upward)).float()
    w, x, y, z = matrix_to_quat_wxyz(turn).tolist()
    root = document.add("nodes", {"name": "world", "rotation": [x, y, z, w], "children": children})
    return document.to_bytes([root], version.title)


def upright(up: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "3 3"]:
    """The rotation of the world by which `up` becomes y: (x, y, z) with z up to (x, z, -y)."""
    level = np.eye(3)[np.abs(up).argmin()]
    return axes_towards(np.cross(level, up), up)


def _add_mesh(
    document: _Document,
    name: str,
    verts: Float[np.ndarray, "T V 3"],
    faces: Int[np.ndarray, "F 3"],
    colour: Colour,
) -> int:
    """A node with a mesh: the first frame, and a morph target for each of the others."""
    normals = np.stack([vertex_normals(points, faces) for points in verts])
    # glTF allows no normal of length zero, which a vertex without a face would have
    normals[np.linalg.norm(normals, axis=-1) < 0.5] = (0, 0, 1)

    def attributes(points: Float[np.ndarray, "V 3"], normal: Float[np.ndarray, "V 3"]) -> dict:
        position = document.accessor(points, ARRAY_BUFFER)
        return {"POSITION": position, "NORMAL": document.accessor(normal, ARRAY_BUFFER)}

    # a matt surface; glTF expects linear colours, ours are sRGB
    linear = [*(np.array(colour) ** 2.2).tolist(), 1.0]
    surface = {"baseColorFactor": linear, "metallicFactor": 0.0, "roughnessFactor": ROUGHNESS}
    material = {"name": name, "pbrMetallicRoughness": surface, "doubleSided": True}
    primitive: dict[str, Any] = {
        "attributes": attributes(verts[0], normals[0]),
        "indices": document.accessor(faces.reshape(-1), ELEMENT_BUFFER),
        "material": document.add("materials", material),
    }
    mesh = {"name": name, "primitives": [primitive]}
    if len(verts) > 1:
        primitive["targets"] = [
            attributes(moved - verts[0], turned - normals[0])
            for moved, turned in zip(verts[1:], normals[1:], strict=True)
        ]
        mesh["weights"] = [0.0] * (len(verts) - 1)
    return document.add("nodes", {"name": name, "mesh": document.add("meshes", mesh)})


def _add_hand(document: _Document, hand: PosedTrack, times: int) -> int:
    """A hand whose morph targets follow one another; it has size zero in frames without it."""
    verts, valid = hand.verts.numpy().astype(np.float32), hand.valid.numpy()
    node = _add_mesh(document, f"{hand.side} hand", verts, hand.model.faces.numpy(), SKIN_COLOUR)
    if len(verts) > 1:
        weights = np.eye(len(verts), dtype=np.float32)[:, 1:].reshape(-1)
        document.animate(node, "weights", times, document.accessor(weights))
    if not valid.all():
        size = np.repeat(valid.astype(np.float32)[:, None], 3, 1)
        document.animate(node, "scale", times, document.accessor(size), "STEP")
    return node


def _add_part(document: _Document, scene: Scene, part: int, times: int) -> int:
    """A part of the object that moves as it does in the world."""
    mesh = scene.object.meshes[part]
    verts, faces = mesh.verts.numpy().astype(np.float32), mesh.faces.numpy()
    node = _add_mesh(document, scene.part_name(part), verts[None], faces, scene.part_colour(part))
    quat, translation = scene.part_motion(part)
    # the same rotations, with the signs of quaternions chosen to be continuous over time
    agrees = (quat[1:] * quat[:-1]).sum(-1) >= 0
    quat = quat * np.cumprod(np.where(np.concatenate([[True], agrees]), 1.0, -1.0))[:, None]
    quat = (quat / np.linalg.norm(quat, axis=-1, keepdims=True)).astype(np.float32)
    quat_xyzw = quat[:, [1, 2, 3, 0]]
    document.tables["nodes"][node] |= {
        "rotation": quat_xyzw[0].tolist(),
        "translation": translation[0].tolist(),
    }
    document.animate(node, "rotation", times, document.accessor(quat_xyzw))
    document.animate(node, "translation", times, document.accessor(translation))
    return node
