"""A scene as one HTML file that needs nothing else: data and viewer in its own text.

The viewer draws on the CPU: a browser without a GPU has no WebGL, or one of a few frames a second.

Positions are 16-bit steps of one box around the scene; each array is stored as differences from
frame to frame, low bytes before high ones, and all of them together deflated: 300 frames of a hand
before and after take about one and a half megabytes.
"""

import base64
import html
import json
import re
import zlib
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from geneoh.choices import Colouring
from geneoh.files.atomic import write_whole
from geneoh.geometry.rotations import matrix_to_quat_wxyz
from geneoh.hand.skeleton import KEYPOINT_PARENTS
from geneoh.viz.camera import Camera, cameras
from geneoh.viz.colours import DEEPEST, OBJECT, SCALES, SKIN, on_ramp
from geneoh.viz.scene import Scene, SeenHand, Take
from geneoh.viz.surface import coarser, creased

STEPS = 65535
"""16-bit steps over the longest side of the scene."""
MOST_FACES = 20_000
"""Faces of an object part beyond which a coarser mesh is drawn."""
MOST_SAMPLES = 16
"""Samples that a page keeps of those that were drawn."""
PAGE_COLOURINGS: tuple[Colouring, ...] = ("penetration", "contact", "spread")


@dataclass
class _Packed:
    """Arrays one after another in one block of bytes, and where each of them lies."""

    blocks: list[bytes] = field(default_factory=list)
    size: int = 0

    def add(
        self, values: Integer[np.ndarray, "..."], *, over_frames: bool = False
    ) -> dict[str, Any]:
        """Store an array; returns what the viewer needs to find it."""
        flat = np.ascontiguousarray(values)
        if over_frames:
            # wraps around on purpose: the viewer adds up in the same width
            flat = np.concatenate([flat[:1], flat[1:] - flat[:-1]])
        raw = flat.reshape(-1).view(np.uint8).reshape(-1, flat.dtype.itemsize)
        block = raw.T.tobytes()
        told = {
            "at": self.size,
            "type": flat.dtype.name,
            "shape": list(values.shape),
            "delta": over_frames,
        }
        self.blocks.append(block)
        self.size += len(block)
        return told


@dataclass(frozen=True)
class _Box:
    """The box whose 16-bit steps positions are stored in."""

    low: Float[Tensor, " 3"]
    step: float

    def steps(self, points: Float[Tensor, "*B 3"]) -> Integer[np.ndarray, "*B 3"]:
        """Points as steps from the low corner; points that are not finite stand there."""
        at = ((points - self.low) / self.step).round().nan_to_num(0, 0, 0).clamp(0, STEPS)
        return at.numpy().astype(np.uint16)


def page_html(scene: Scene, title: str, *, up: Float[np.ndarray, " 3"]) -> str:
    """The page as text.

    Args:
        scene: what to show.
        title: of the page.
        up: the direction in the world that is up on the screen.
    """
    packed = _Packed()
    told = describe(scene, cameras(scene, up), up, packed)
    data = base64.b64encode(zlib.compress(b"".join(packed.blocks), 9)).decode()
    filled = {
        "TITLE": html.escape(title),
        "STYLE": _asset("page.css"),
        "RASTER": _asset("raster.js"),
        "ORBIT": _asset("orbit.js"),
        "VIEWER": _asset("viewer.js"),
        # "<" must not stand in a script: file names may hold anything
        "SCENE": json.dumps(told, allow_nan=False).replace("<", "\\u003c"),
        "DATA": data,
    }
    # one pass, so that nothing which was filled in is taken for a gap
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda gap: filled[gap[1]], _asset("page.html"))


def write_page(scene: Scene, path: Path, title: str, *, up: Float[np.ndarray, " 3"]) -> None:
    """Write the page in one step."""
    write_whole(path, page_html(scene, title, up=up))


def _asset(name: str) -> str:
    return (files("geneoh.viz") / "assets" / name).read_text(encoding="utf-8")


def describe(
    scene: Scene, seen: list[Camera], up: Float[np.ndarray, " 3"], packed: _Packed
) -> dict[str, Any]:
    """Everything the viewer must know, large arrays by their place in the block of bytes."""
    points = [hand.verts for take in scene.takes for hand in take.hands]
    points += [drawn.flatten(0, 1) for drawn in scene.samples.values()]
    flat = torch.cat([point.reshape(-1, 3) for point in points])
    flat = flat[flat.isfinite().all(-1)]
    low = flat.amin(0)
    box = _Box(low, max(float((flat.amax(0) - low).max()), 1e-3) / STEPS)
    return {
        "frames": scene.frames,
        "fps": scene.fps,
        "low": box.low.tolist(),
        "step": box.step,
        "radius": seen[0].radius,
        "up": up.tolist(),
        "back": seen[0].axes[2].tolist(),
        "targets": _rounded(np.stack([camera.target for camera in seen])),
        "skin": SKIN,
        "objectColour": OBJECT,
        "bones": KEYPOINT_PARENTS,
        "deepest": 1000 * DEEPEST,
        "scales": {name: _scale(name) for name in PAGE_COLOURINGS},
        "parts": [_part(scene, part, packed) for part in range(len(scene.object.meshes))],
        "takes": [_take(take, box, packed) for take in scene.takes],
        "samples": {
            side: packed.add(box.steps(drawn[:MOST_SAMPLES].transpose(0, 1)), over_frames=True)
            for side, drawn in scene.samples.items()
        },
    }


def _scale(name: Colouring) -> dict[str, Any]:
    scale = SCALES[name]
    return {"title": scale.title, "ramp": scale.ramp, "ends": scale.ends}


def _part(scene: Scene, part: int, packed: _Packed) -> dict[str, Any]:
    """Mesh of a part in steps of its own box, and its motion as quaternions with translations."""
    mesh = creased(coarser(scene.object.meshes[part], MOST_FACES))
    low = mesh.verts.amin(0)
    box = _Box(low, max(float(mesh.extent().max()), 1e-6) / STEPS)
    quat_wxyz = matrix_to_quat_wxyz(scene.object.rotation[:, part])
    return {
        "low": low.tolist(),
        "step": box.step,
        "verts": packed.add(box.steps(mesh.verts)),
        "faces": packed.add(mesh.faces.numpy().astype(np.uint32)),
        "quat": _rounded(quat_wxyz.numpy(), 6),
        "translation": _rounded(scene.object.translation[:, part].numpy(), 6),
    }


def _take(take: Take, box: _Box, packed: _Packed) -> dict[str, Any]:
    return {"title": take.title, "hands": [_hand(hand, box, packed) for hand in take.hands]}


def _hand(hand: SeenHand, box: _Box, packed: _Packed) -> dict[str, Any]:
    ramps = {
        name: packed.add(_bytes(on_ramp(name, hand.distance, hand.spread)), over_frames=True)
        for name in PAGE_COLOURINGS
        if name != "spread" or hand.spread is not None
    }
    return {
        "side": hand.side,
        "faces": packed.add(hand.model.faces.numpy().astype(np.uint16)),
        "verts": packed.add(box.steps(hand.verts), over_frames=True),
        "ramps": ramps,
        "valid": hand.valid.int().tolist(),
        "curves": {
            "penetration": _rounded(1000 * hand.depth.numpy(), 2),
            "contact": _rounded(hand.fingers.numpy(), 0),
            "acceleration": _rounded(hand.acceleration.numpy(), 2),
        },
    }


def _bytes(share: Float[Tensor, "*B"]) -> Integer[np.ndarray, "*B"]:
    return (share.nan_to_num(0) * 255).round().numpy().astype(np.uint8)


def _rounded(values: Float[np.ndarray, "..."], digits: int = 4) -> list[Any]:
    """Numbers for JSON, which knows no NaN."""
    rounded = np.round(values.astype(np.float64), digits)
    kept = rounded.astype(object)
    kept[~np.isfinite(rounded)] = None
    return kept.tolist()
