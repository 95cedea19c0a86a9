"""Quality report of one interaction without ground truth, and its comparison before and after."""

from dataclasses import asdict, dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.distance import MovingSurface
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import (
    TOUCH,
    in_contact,
    motion_consistency,
    penetration_depth,
    tips_in_contact,
)
from geneoh.metrics.frames import mean_over_frames, valid_differences
from geneoh.metrics.smoothness import acceleration, per_frame_squared


@dataclass(frozen=True)
class InteractionReport:
    """One hand and one object over all valid frames; NaN where there is nothing to measure."""

    frames: int
    """Valid frames."""
    penetration_mean_mm: float
    """Depth of the deepest vertex, mean over the frames."""
    penetration_max_mm: float
    contact_fraction: float
    """Share of the frames in which the hand is at most 5 mm from the object."""
    fingers_in_contact: float
    """Mean number of fingertips at most 5 mm from the object, over the frames with contact."""
    acceleration_mm: float
    """Mean acceleration of the keypoints in millimetres per frame squared."""
    consistency_mm2: float
    """Hand-object motion consistency over the frames in which the object moves, square mm."""

    def as_dict(self) -> dict[str, float | int]:
        """The fields by name, for a JSON file."""
        return asdict(self)


def measure(
    verts: Float[Tensor, "T V 3"],
    joints: Float[Tensor, "T 21 3"],
    surface: MovingSurface,
    fps: float,
    valid: Bool[Tensor, " T"] | None = None,
) -> InteractionReport:
    """The report of one hand and one object.

    Args:
        verts: hand, world frame.
        joints: keypoints in OpenPose order, world frame.
        surface: the object.
        fps: frames a second.
        valid: frames that count; all by default.
    """
    if valid is None:
        valid = torch.ones(len(verts), dtype=torch.bool, device=verts.device)
    query = surface.query(verts)
    distance = query.distance[valid]
    touching = in_contact(distance)
    tips = joints[:, list(TIP_KEYPOINTS)]
    fingers = tips_in_contact(distance, verts[valid], tips[valid]).sum(-1).to(distance)
    depth = penetration_depth(distance)
    moved = motion_consistency(verts, query, surface)
    accelerated = per_frame_squared(acceleration(joints, fps), fps)
    return InteractionReport(
        frames=int(valid.sum()),
        penetration_mean_mm=1000 * float(mean_over_frames(depth)),
        penetration_max_mm=1000 * float(depth.max()) if len(depth) else float("nan"),
        contact_fraction=float(mean_over_frames(touching.to(distance))),
        fingers_in_contact=float(mean_over_frames(fingers, touching)),
        acceleration_mm=float(mean_over_frames(accelerated, valid_differences(valid, 2))),
        consistency_mm2=1e6 * float(mean_over_frames(moved, valid_differences(valid, 1))),
    )


LINES = (
    ("penetration_mean_mm", "penetration depth, mean", "mm"),
    ("penetration_max_mm", "penetration depth, deepest", "mm"),
    ("contact_fraction", f"frames in contact ({1000 * TOUCH:.0f} mm)", "%"),
    ("fingers_in_contact", "fingertips in contact", ""),
    ("acceleration_mm", "acceleration of keypoints", "mm/frame²"),
    ("consistency_mm2", "hand-object motion inconsistency", "mm²"),
)
"""Field, readable name, unit."""


def before_and_after(before: InteractionReport, after: InteractionReport) -> list[str]:
    """One line of text per metric: name, value before, value after, unit."""
    lines = []
    for field, name, unit in LINES:
        scale = 100 if unit == "%" else 1
        old, new = (format_number(scale * getattr(report, field)) for report in (before, after))
        lines.append(f"{name:<34}{old:>8} -> {new:>8} {unit}".rstrip())
    return lines


def format_number(value: float) -> str:
    """A number as text: two decimals below 10, one above; n/a for NaN."""
    if value != value:
        return "n/a"
    return f"{value:.2f}" if abs(value) < 10 else f"{value:.1f}"
