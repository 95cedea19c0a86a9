"""A scene as one self-contained HTML file: it holds the data and the viewer.

The viewer draws on the CPU: without a GPU, WebGL is missing or runs at a few frames a second.

Positions are quantised to 16 bits in one box around the scene. Each array is stored as differences
between frames, low bytes before high bytes, and all arrays are deflated together: 300 frames of a
hand before and after take about 1.5 megabytes.
"""

import base64
import html
import json
import re
import zlib
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Integer
from torch import Tensor

from geneoh.errors import numbered
from geneoh.hand.skeleton import KEYPOINT_PARENTS
from geneoh.viz.camera import FIELD_OF_VIEW, cameras
from geneoh.viz.look import (
    BODY_COLOUR,
    DEFAULT_LOOK,
    OBJECT_COLOUR,
    SCALES,
    SKIN_COLOUR,
    Look,
    ramp_position,
)
from geneoh.viz.posed_track import PosedTrack
from geneoh.viz.scene import Scene, Version
from geneoh.viz.surface import coarser, with_sharp_edges

QUANTISATION = 65535  # 16-bit steps over the longest side of the scene
MOST_FACES = 20_000  # faces of an object part beyond which a coarser mesh is drawn
MOST_SAMPLES = 16  # most diffusion samples that a page holds


class _Packed:
    """Arrays one after another in one block of bytes."""

    def __init__(self):
        self.data = bytearray()

    def add(
        self, values: Integer[np.ndarray, "..."], *, over_frames: bool = False
    ) -> dict[str, Any]:
        """Store an array; returns where it lies and how it is stored."""
        flat, at = np.ascontiguousarray(values), len(self.data)
        if over_frames:
            # differences may wrap around: sums of the same integer width undo that in the viewer
            flat = np.concatenate([flat[:1], flat[1:] - flat[:-1]])
        raw = flat.reshape(-1).view(np.uint8).reshape(-1, flat.dtype.itemsize)
        self.data += raw.T.tobytes()
        shape = list(values.shape)
        return {"at": at, "type": flat.dtype.name, "shape": shape, "delta": over_frames}


@dataclass(frozen=True)
class _Box:
    """The cube in which positions are quantised to 16-bit steps, metres."""

    low: Float[Tensor, " 3"]
    step: float

    @staticmethod
    def around(points: Float[Tensor, "P 3"], smallest: float) -> "_Box":
        """The box of finite points, with sides of at least `smallest` metres."""
        points = points[points.isfinite().all(-1)]
        low = points.amin(0)
        return _Box(low, max(float((points.amax(0) - low).max()), smallest) / QUANTISATION)

    def origin(self) -> dict[str, Any]:
        """Lower corner and step size, by which the viewer turns steps back into metres."""
        return {"low": self.low.tolist(), "step": self.step}

    def steps(self, points: Float[Tensor, "*B 3"]) -> Integer[np.ndarray, "*B 3"]:
        """Points as steps from the low corner; points that are not finite are put there."""
        at = ((points - self.low) / self.step).round().nan_to_num(0, 0, 0).clamp(0, QUANTISATION)
        return at.numpy().astype(np.uint16)


def page_html(scene: Scene, look: Look = DEFAULT_LOOK) -> str:
    """The page as HTML; of the look only the up axis is used, controls in the page set the rest."""
    packed = _Packed()
    described = describe(scene, look.upward, packed)
    filled = {
        "TITLE": html.escape(scene.title),
        "NOTES": _notes(scene.notes),
        "STYLE": _asset("page.css"),
        "RASTER": _asset("raster.js"),
        "ORBIT": _asset("orbit.js"),
        "VIEWER": _asset("viewer.js"),
        # a file name may contain "<", which could end the script
        "SCENE": json.dumps(described, allow_nan=False).replace("<", "\\u003c"),
        "DATA": base64.b64encode(zlib.compress(packed.data, 6)).decode(),
    }
    # one pass, so that no inserted text is taken for a placeholder
    return re.sub(r"\{\{([A-Z]+)\}\}", lambda gap: filled[gap[1]], _asset("page.html"))


def _notes(notes: tuple[str, ...]) -> str:
    """The notes as a list that is closed at first; nothing without notes."""
    if not notes:
        return ""
    lines = "".join(f"<li>{html.escape(note)}</li>" for note in notes)
    summary = f"<summary>{numbered(len(notes), 'note')}</summary>"
    return f'<details id="notes">{summary}<ul>{lines}</ul></details>'


def _asset(name: str) -> str:
    return (files("geneoh.viz") / "assets" / name).read_text(encoding="utf-8")


def describe(scene: Scene, up: Float[np.ndarray, " 3"], packed: _Packed) -> dict[str, Any]:
    """All that the viewer reads; large arrays are replaced by their place in the block of bytes."""
    points = [hand.verts for hand in scene.hands]
    points += [drawn.flatten(0, 1) for drawn in scene.samples.values()]
    box = _Box.around(torch.cat([point.reshape(-1, 3) for point in points]), 1e-3)
    seen = cameras(scene, up)
    return {
        **box.origin(),
        "frames": scene.frames,
        "fps": scene.fps,
        "camera": {
            "up": up.tolist(),
            "back": seen[0].axes[2].tolist(),
            "radius": seen[0].radius,
            "fieldOfView": FIELD_OF_VIEW,
            "targets": _rounded(np.stack([camera.target for camera in seen])),
        },
        "skinColour": SKIN_COLOUR,
        "partColours": [OBJECT_COLOUR, BODY_COLOUR],
        "scales": {
            name: vars(scale) | {"limits": [1000 * limit for limit in scale.limits]}
            for name, scale in SCALES.items()
        },
        "bones": KEYPOINT_PARENTS,
        "filled": [] if scene.filled is None else scene.filled.int().tolist(),
        "parts": [_part(scene, part, packed) for part in scene.parts],
        "versions": [_version(version, scene, box, packed) for version in scene.versions],
        "samples": {
            side: packed.add(box.steps(drawn[:MOST_SAMPLES].transpose(0, 1)), over_frames=True)
            for side, drawn in scene.samples.items()
        },
    }


def _part(scene: Scene, part: int, packed: _Packed) -> dict[str, Any]:
    """Mesh of a part in steps of its own box, and its motion as quaternions with translations."""
    mesh = with_sharp_edges(coarser(scene.object.meshes[part], MOST_FACES))
    box = _Box.around(mesh.verts, 1e-6)
    quat_wxyz, translation = scene.part_motion(part)
    return {
        **box.origin(),
        "limb": scene.is_limb(part),
        "verts": packed.add(box.steps(mesh.verts)),
        "faces": packed.add(mesh.faces.numpy().astype(np.uint32)),
        "quat": _rounded(quat_wxyz, 6),
        "translation": _rounded(translation, 6),
    }


def _version(version: Version, scene: Scene, box: _Box, packed: _Packed) -> dict[str, Any]:
    measures, trust = version.measures, scene.object_confidence
    means = scene.means(version)
    found = {
        "title": version.title,
        "hands": [_hand(hand, scene.has_object, box, packed) for hand in version.hands],
        "curves": {
            "penetration": _rounded(1000 * measures.depth.numpy(), 2),
            "contact": _rounded(measures.fingers.numpy(), 0),
            "acceleration": _rounded(measures.acceleration.numpy(), 2),
        },
        "means": {
            "penetration": _rounded(means["penetration_mean_mm"]),
            "contact": _rounded(means["fingers_in_contact"]),
            "acceleration": _rounded(means["acceleration_mm"]),
        },
    }
    if not scene.has_object:
        for known in found["curves"], found["means"]:
            del known["penetration"], known["contact"]
    if trust is not None:
        found["curves"]["confidence"] = _rounded(100 * trust.numpy(), 0)
        found["means"]["confidence"] = _rounded(100 * float(trust.mean()))
    return found


def _hand(hand: PosedTrack, at_object: bool, box: _Box, packed: _Packed) -> dict[str, Any]:
    ramps = {}
    for name in SCALES:
        if hand.spread is not None if name == "spread" else at_object:
            share = ramp_position(name, hand.distance, hand.spread).nan_to_num(0)
            steps = (share * 255).round().numpy().astype(np.uint8)
            ramps[name] = packed.add(steps, over_frames=True)
    return {
        "side": hand.side,
        "faces": packed.add(hand.model.faces.numpy().astype(np.uint16)),
        "verts": packed.add(box.steps(hand.verts), over_frames=True),
        "ramps": ramps,
        "valid": hand.valid.int().tolist(),
    }


def _rounded(values: Float[np.ndarray, "..."] | float, digits: int = 4) -> Any:
    """Numbers for JSON, with None for NaN, which JSON does not have."""
    rounded = np.round(np.asarray(values, dtype=np.float64), digits)
    kept = np.array(rounded, dtype=object)
    kept[~np.isfinite(rounded)] = None
    return kept.tolist()
