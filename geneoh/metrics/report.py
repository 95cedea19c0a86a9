"""Quality report of one interaction without ground truth, and its comparison before and after."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from math import nan

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.geometry.distance import MovingSurface, SurfaceQuery
from geneoh.geometry.openings import edges_of
from geneoh.geometry.thin_walls import goes_through
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import (
    TOUCH,
    in_contact,
    motion_consistency,
    penetration_depth,
    tips_in_contact,
)
from geneoh.metrics.smoothness import (
    acceleration,
    in_mm_per_frame_squared,
    mean_over_frames,
    valid_differences,
)
from geneoh.sequence.windows import blocks, widened

FARTHEST = 10.0  # metres beyond which the distance of a hand need not be exact


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
    through_fraction: float
    """Share of the frames in which the hand goes through a thin wall, which depth does not show."""

    def as_dict(self) -> dict[str, float | int]:
        """The fields by name, for a JSON file."""
        return asdict(self)


@dataclass(frozen=True)
class FrameMeasures(Bundle):
    """What is measured in each of T frames; NaN where there is no hand."""

    valid: Bool[Tensor, " T"]  # frames with a hand
    touching: Bool[Tensor, " T"]  # frames in which a hand is at most 5 mm from the object
    depth: Float[Tensor, " T"]  # depth of the deepest vertex in metres, zero when none is inside
    fingers: Float[Tensor, " T"]  # number of fingertips at most 5 mm from the object
    acceleration: Float[Tensor, " T"]
    """Mean over keypoints in millimetres per frame squared, from the frame before to the one after;
    NaN where one of the three has no hand."""

    def counted(self, frames: Bool[Tensor, " T"]) -> "FrameMeasures":
        """The measures in some of the frames alone: the others count as frames without a hand."""
        valid, inner = self.valid & frames, torch.zeros_like(frames)
        inner[1:-1] = valid_differences(valid, 2)
        return FrameMeasures(
            valid=valid,
            touching=self.touching & frames,
            depth=self.depth.where(frames, torch.nan),
            fingers=self.fingers.where(frames, torch.nan),
            acceleration=self.acceleration.where(inner, torch.nan),
        )

    def means(self) -> dict[str, float]:
        """The fields of an `InteractionReport` that follow from the frames."""
        return {name: mean(self) for name, mean in FRAME_MEANS.items()}


FRAME_MEANS: dict[str, Callable[[FrameMeasures], float]] = {
    "penetration_mean_mm": lambda m: 1000 * float(mean_over_frames(m.depth, m.valid)),
    "penetration_max_mm": lambda m: 1000 * float(m.depth[m.valid].max()) if m.valid.any() else nan,
    "fingers_in_contact": lambda m: float(mean_over_frames(m.fingers, m.touching)),
    "acceleration_mm": lambda m: float(mean_over_frames(m.acceleration, ~m.acceleration.isnan())),
}


def measure_frames(
    distance: Float[Tensor, "T V"],
    verts: Float[Tensor, "T V 3"],
    joints: Float[Tensor, "T 21 3"],
    fps: float,
    valid: Bool[Tensor, " T"],
) -> FrameMeasures:
    """Measure one hand in each frame, by its vertices' distances to the object, world frame."""
    tips = joints[:, list(TIP_KEYPOINTS)]
    fingers = tips_in_contact(distance, verts, tips).sum(-1).to(distance)
    accelerated = torch.full_like(fingers, torch.nan)
    accelerated[1:-1] = in_mm_per_frame_squared(acceleration(joints, fps), fps)
    depth, touching = penetration_depth(distance), in_contact(distance)
    return FrameMeasures(valid, touching, depth, fingers, accelerated).counted(valid)


def near_hand(
    surface: MovingSurface, verts: Float[Tensor, "T V 3"], within: float = TOUCH
) -> SurfaceQuery:
    """Signed distance, closest point and normal at a hand's vertices: exact inside the object,
    within `within` metres of it, and for the nearest vertex of each frame."""
    found = replace(surface, within=within).query(verts)
    while within < FARTHEST:
        away = torch.nonzero(~(found.distance.abs() <= within).any(-1))[:, 0]
        if not len(away):
            break
        within *= 2
        again = replace(surface.at(away), within=within).query(verts[away])
        pairs = zip(vars(found).values(), vars(again).values(), strict=True)
        found = SurfaceQuery(*(old.index_copy(0, away, new) for old, new in pairs))
    return found


def measure_posed(
    verts_of: Callable[[slice], Float[Tensor, "N V 3"]],
    joints: Float[Tensor, "T 21 3"],
    surface: MovingSurface,
    fps: float,
    valid: Bool[Tensor, " T"],
    *,
    faces: Int[Tensor, "F 3"],
    groups: Sequence[Int[Tensor, " _"]] = (),
    within: float = TOUCH,
) -> tuple[InteractionReport, Float[Tensor, "T G"]]:
    """The report of one hand and one object, and the distance of groups of vertices to the object.

    `verts_of` gives the hand's vertices in a slice of the frames, world frame; `faces` are its
    triangles. The report covers the `valid` frames. The signed distance of each of the `groups` is
    the least of its vertices, metres, negative inside, exact up to `within`.
    """
    edges, measured, moves, through, apart = edges_of(faces), [], [], [], []
    for block in blocks(len(joints)):
        wide, inner = widened(block, 1, len(joints))  # differences reach one frame to either side
        verts, moving = verts_of(wide), surface.at(wide)
        query = near_hand(moving, verts, within)
        found = measure_frames(query.distance, verts, joints[wide], fps, valid[wide])
        measured.append(found[inner])
        through.append(goes_through(verts, query.distance, query.normal, edges)[inner])
        moves.append(motion_consistency(verts, query, moving)[inner])
        nearest = [query.distance[inner, group].amin(-1, keepdim=True) for group in groups]
        apart.append(torch.cat([query.distance[inner, :0], *nearest], dim=-1))
    frames, moved = concatenated(measured), torch.cat(moves)
    gone = torch.cat(through).to(joints)
    report = InteractionReport(
        frames=int(valid.sum()),
        contact_fraction=float(mean_over_frames(frames.touching.to(joints), valid)),
        consistency_mm2=1e6 * float(mean_over_frames(moved, valid_differences(valid, 1))),
        through_fraction=float(mean_over_frames(gone, valid)),
        **frames.means(),
    )
    return report, torch.cat(apart)


def over_shots(reports: Sequence[InteractionReport]) -> InteractionReport:
    """The report of all shots of a video: the largest depth, and means weighted by the number of
    frames of each shot (`fingers_in_contact`: of frames with contact)."""
    frames = [report.frames for report in reports]
    touching = [report.frames * report.contact_fraction for report in reports]
    found = {}
    for name in reports[0].as_dict():
        values = [getattr(report, name) for report in reports]
        weights = touching if name == "fingers_in_contact" else frames
        known = [(v, w) for v, w in zip(values, weights, strict=True) if v == v and w > 0]
        whole = sum(weight for _, weight in known)
        found[name] = sum(value * weight for value, weight in known) / whole if known else nan
    depths = [report.penetration_max_mm for report in reports]
    deepest = max((depth for depth in depths if depth == depth), default=nan)
    return InteractionReport(**found | {"frames": sum(frames), "penetration_max_mm": deepest})


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


def through_walls(before: InteractionReport, after: InteractionReport) -> Iterator[str]:
    """A note for the user where a hand still goes through a thin wall after cleaning."""
    if after.through_fraction > 0:
        old, new = (format_number(100 * each.through_fraction) for each in (before, after))
        yield (
            f"the hand goes through a thin wall of the object in {new}% of the frames, in the "
            f"input in {old}%: depth, which is at most half a wall, does not show it"
        )
