"""How near synthetic interactions are to a real recording: a report.

Both are described by the same measures of the same right hand at 30 frames a second: speed and
acceleration of wrist and fingertips, angles between the bones, contact and depth of the skin, and
by how well a classifier tells them apart. A recording of one grasp is always a narrow sample of
what hands do, so the classifier's accuracy has a control beside it: how well single synthetic clips
are told from all the others in the same way.
"""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import InputError
from geneoh.evaluation.distributions import (
    ANGLES,
    Spread,
    correlations,
    joint_angles,
    ks_distance,
    point_acceleration,
    speed,
    spread_of,
)
from geneoh.evaluation.two_sample_classifier import (
    BLOCK,
    SNIPPET,
    VIEWS,
    block_snippets,
    tell_apart,
)
from geneoh.fitting.fit import fit_keypoints
from geneoh.geometry.mesh import Mesh
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import TOUCH, in_contact, penetration_depth, tips_in_contact
from geneoh.metrics.frames import valid_differences
from geneoh.pipeline.subject import subject_of
from geneoh.representation.parameters import HandParameters
from geneoh.sequence.resample import at_rate
from geneoh.sequence.sequence import Sequence
from geneoh.synthesis.motion import Interactions
from geneoh.synthesis.replay import replay_shard
from geneoh.synthesis.shards import find_shards, seed_of
from geneoh.training.augmentation import augmented

FPS = 30.0
SHARDS, CLIPS = 8, 96
"""Training shards that are looked at, spread over all, and clips of each."""
SKIN_EVERY = 10
"""Of synthetic clips every tenth frame's skin is measured."""
NEAR = 0.025
"""Distance in metres of the nearest keypoint to the object within which a hand is at the object;
snippets are compared only where it is in all their frames, on either side."""
CONTROLS = 12
"""Synthetic clips that are told from the others, for comparison."""


@dataclass(frozen=True)
class Skin:
    """What is measured on the mesh of a hand in N frames."""

    area: Float[Tensor, " N"]
    """Skin at most 5 mm from the object, square metres."""
    fingers: Float[Tensor, " N"]
    """Fingertips at most 5 mm from it."""
    depth: Float[Tensor, " N"]
    """Of the deepest vertex, metres."""
    touching: Bool[Tensor, " N"]


@dataclass(frozen=True)
class Side:
    """Clips of right hands, of one source."""

    world: Float[Tensor, "B T 21 3"]
    """Keypoints in the world."""
    object: Float[Tensor, "B T 21 3"]
    """Keypoints in the frame of the object (of its first part)."""
    valid: Bool[Tensor, "B T"]
    near: Bool[Tensor, "B T"]
    """Frames in which the hand is valid and at the object."""
    skin: Skin


@dataclass(frozen=True)
class Measure:
    """One measure of both sources."""

    name: str
    unit: str
    real: Spread
    synthetic: Spread
    distance: float
    """Kolmogorov-Smirnov distance of the two distributions, 0 to 1."""


@dataclass(frozen=True)
class Realism:
    """The report."""

    measures: tuple[Measure, ...]
    correlation: dict[str, float]
    """Of the joint angles' pairs: mean size in either source, mean difference, and how the
    correlations of one source correlate with the other's."""
    accuracy: dict[str, float]
    """Of the classifier that tells the recording from synthetic clips, per view."""
    control: dict[str, float]
    """The same for single synthetic clips against the others, mean over clips."""
    snippets: tuple[int, int]
    """Real and synthetic snippets that were told apart."""
    clips: int
    """Synthetic clips that were looked at."""

    def as_dict(self) -> dict[str, Any]:
        """For a JSON file."""
        return asdict(self)


def skin_of(
    verts: Float[Tensor, "N V 3"],
    tips: Float[Tensor, "N 5 3"],
    distance: Float[Tensor, "N V"],
    faces: Tensor,
) -> Skin:
    """Contact and depth of posed hands."""
    area = torch.stack([vertex_areas(Mesh(each, faces)) for each in verts])
    return Skin(
        (area * (distance <= TOUCH)).sum(-1),
        tips_in_contact(distance, verts, tips).sum(-1).float(),
        penetration_depth(distance),
        in_contact(distance),
    )


def vertex_areas(mesh: Mesh) -> Float[Tensor, " V"]:
    """Each vertex's share of the surface: a third of the faces around it, square metres."""
    third = mesh.face_vectors().norm(dim=-1) / 6
    areas = torch.zeros_like(mesh.verts[:, 0])
    for corner in range(3):
        areas.index_add_(0, mesh.faces[:, corner], third)
    return areas


def real_side(sequence: Sequence, hand: HandModel) -> Side:
    """The recording's first hand as a right one at 30 frames a second; its mesh is our hand's.

    Raises:
        InputError: the recording has no object mesh.
    """
    if not sequence.object.meshes:
        raise InputError(f"{sequence.source}: expected an object mesh, got none; pass --obj MESH")
    sequence = at_rate(sequence, FPS)
    track, moving = sequence.hands[0], sequence.object
    if track.side == "left":
        track, moving = track.mirrored(), moving.mirrored()
    with torch.no_grad():
        subject = subject_of(track, hand)
        state = subject.start or fit_keypoints(
            subject.joints[None], subject.trust[None], subject.shaped
        )
        verts = subject.shaped.verts_from_rotations(state.rotations, state.wrist).verts[0]
    surface = moving.surface()
    gap = surface.query(subject.joints).distance.amin(-1)
    valid, joints = track.valid, subject.joints
    turn, shift = moving.rotation[:, 0], moving.translation[:, None, 0]
    tips = joints[:, list(TIP_KEYPOINTS)]
    distance = surface.query(verts).distance
    skin = skin_of(verts[valid], tips[valid], distance[valid], hand.faces)
    local = (joints - shift) @ turn
    near = valid & (gap < NEAR)
    return Side(joints[None], local[None], valid[None], near[None], skin)


def synthetic_side(folder: Path, hand: HandModel, *, lively: bool = False) -> Side:
    """Clips of training shards, spread over the folder's.

    Args:
        folder: of the shards.
        hand: whose skin is measured.
        lively: as networks learn from them, with the unrest that training adds.
    """
    paths = find_shards(folder, "train")
    at = torch.linspace(0, len(paths) - 1, min(SHARDS, len(paths))).round().long().tolist()
    sides = [shard_side(paths[i], hand, lively=lively) for i in at]

    def joined(name: str) -> Tensor:
        return torch.cat([getattr(side, name) for side in sides])

    skins = [side.skin for side in sides]
    names = ("area", "fingers", "depth", "touching")
    skin = Skin(*(torch.cat([getattr(each, name) for each in skins]) for name in names))
    return Side(joined("world"), joined("object"), joined("valid"), joined("near"), skin)


@torch.no_grad()
def shard_side(path: Path, hand: HandModel, *, lively: bool) -> Side:
    """The first clips of one shard."""
    shard = replay_shard(path, hand)
    shard = shard.chosen(torch.arange(min(CLIPS, len(shard.clips.wrist))))
    if lively:
        generator = torch.Generator().manual_seed(seed_of("lively", path.name))
        shard = replace(shard, clips=livelier(shard.clips, generator=generator))
    world = shard.joints
    local = shard.in_object(world)
    every = torch.arange(world.shape[1]).expand(len(world), -1)
    gap = shard.distance(local, every).amin(-1)
    frames = torch.arange(0, world.shape[1], SKIN_EVERY).expand(len(world), -1)
    posed = shard.skin(frames)
    distance = shard.distance(posed.verts, frames).flatten(0, 1)
    tips = posed.joints[:, :, list(TIP_KEYPOINTS)].flatten(0, 1)
    skin = skin_of(posed.verts.flatten(0, 1), tips, distance, hand.faces)
    return Side(world, local, torch.ones_like(gap, dtype=torch.bool), gap < NEAR, skin)


def livelier(clips: Interactions, *, generator: torch.Generator) -> Interactions:
    """The same clips with the unrest that training adds to their hands."""
    hand = HandParameters.of_pose(clips.wrist, clips.pose, clips.offsets)
    hand = augmented(hand, generator=generator)
    return replace(clips, wrist=hand.wrist, pose=hand.pose)


def compare_sides(real: Side, synthetic: Side) -> Realism:
    """The report of two sources.

    Raises:
        InputError: the recording is too short, or away from its object, for two folds.
    """
    blocks = block_snippets(real.object[0], real.near[0])
    others = one_snippet_each(synthetic)
    if len(blocks) < 2 or len(others) < 2 * len(blocks):
        raise InputError(
            f"expected {SNIPPET} frames on end of a hand at its object in two or more of the "
            f"recording's blocks of {BLOCK}, and in twice as many synthetic clips, got "
            f"{len(blocks)} blocks and {len(others)} clips; take a longer recording or more data"
        )
    told = {view: tell_apart(blocks, others, view, FPS) for view in VIEWS}
    return Realism(
        measures=tuple(measures(real, synthetic)),
        correlation=angle_correlations(real, synthetic),
        accuracy={view: told[view].accuracy for view in VIEWS},
        control=controls(synthetic, others),
        snippets=told[VIEWS[0]].snippets,
        clips=len(synthetic.world),
    )


def one_snippet_each(side: Side) -> Float[Tensor, "N S 21 3"]:
    """A snippet of each clip that has one, from a place that depends on the clip's number."""
    found = [side.object.new_zeros(0, SNIPPET, 21, 3)]
    for index, (joints, near) in enumerate(zip(side.object, side.near, strict=True)):
        starts = torch.nonzero(near.unfold(0, SNIPPET, 1).all(-1))[:, 0]
        if len(starts):
            start = int(starts[seed_of("snippet", index) % len(starts)])
            found.append(joints[None, start : start + SNIPPET])
    return torch.cat(found)


def controls(side: Side, others: Float[Tensor, "N S 21 3"]) -> dict[str, float]:
    """Accuracy on single clips of a source against the rest of it, mean over clips.

    `others` are its snippets, the clip's own among them: one in hundreds, told wrong at most.
    """
    accuracy: dict[str, list[float]] = {view: [] for view in VIEWS}
    for joints, near in zip(side.object, side.near, strict=True):
        blocks = block_snippets(joints, near)
        if len(blocks) < 2 or len(accuracy["place"]) == CONTROLS:
            continue
        for view in VIEWS:
            accuracy[view].append(tell_apart(blocks, others, view, FPS).accuracy)
    return {view: float(torch.tensor(found).mean()) for view, found in accuracy.items()}


def measures(real: Side, synthetic: Side) -> list[Measure]:
    """Every measure of both sources."""
    found = []

    def add(name: str, unit: str, ours: Tensor, theirs: Tensor, *, scale: float = 1.0) -> None:
        values = scale * ours.flatten(), scale * theirs.flatten()
        spreads = spread_of(values[0]), spread_of(values[1])
        found.append(Measure(name, unit, *spreads, ks_distance(*values)))

    for points, which in (("wrist", [0]), ("fingertips", list(TIP_KEYPOINTS))):
        for frame in ("world", "object"):
            for name, unit, of, order in (
                ("speed", "m/s", speed, 1),
                ("acceleration", "m/s²", point_acceleration, 2),
            ):
                values = [
                    of(getattr(side, frame)[:, :, which], FPS)[differences(side.valid, order)]
                    for side in (real, synthetic)
                ]
                add(f"{points}, {name}, {frame}", unit, *values)
    angles = [joint_angles(side.world[side.valid]) for side in (real, synthetic)]
    for index, name in enumerate(ANGLES):
        add(name, "°", *(each[:, index] for each in angles), scale=180 / torch.pi)
    skins = real.skin, synthetic.skin
    add("skin in contact", "cm²", *(skin.area[skin.touching] for skin in skins), scale=1e4)
    add("fingertips in contact", "", *(skin.fingers[skin.touching] for skin in skins))
    add("penetration depth", "mm", *(skin.depth[skin.touching] for skin in skins), scale=1e3)
    add("frames in contact", "%", *(skin.touching.float() for skin in skins), scale=100.0)
    return found


def differences(valid: Bool[Tensor, "B T"], order: int) -> Bool[Tensor, "B L"]:
    """Where a difference of this order is made of valid frames alone."""
    return torch.stack([valid_differences(each, order) for each in valid])


def angle_correlations(real: Side, synthetic: Side) -> dict[str, float]:
    """How alike the joint angles hang together."""
    ours, theirs = (correlations(joint_angles(s.world[s.valid])) for s in (real, synthetic))
    return {
        "real_mean_size": float(ours.abs().mean()),
        "synthetic_mean_size": float(theirs.abs().mean()),
        "mean_difference": float((ours - theirs).abs().mean()),
        "agreement": float(torch.corrcoef(torch.stack([ours, theirs]))[0, 1]),
    }


def table(report: Realism) -> list[str]:
    """The report as lines of text."""
    lines = [
        f"{'':<38}{'real 5%':>8}{'50%':>8}{'95%':>8}{'made 5%':>10}{'50%':>8}{'95%':>8}{'KS':>6}"
    ]
    for row in report.measures:
        cells = "".join(f"{v:>8.3g}" for v in asdict(row.real).values())
        cells += "  " + "".join(f"{v:>8.3g}" for v in asdict(row.synthetic).values())
        title = f"{row.name} {row.unit}".rstrip()
        lines.append(f"{title:<38}{cells}{row.distance:>6.2f}")
    pairs = report.correlation
    lines.append(
        f"joint angles' correlations: mean size {pairs['real_mean_size']:.2f} real, "
        f"{pairs['synthetic_mean_size']:.2f} made, mean difference {pairs['mean_difference']:.2f}, "
        f"agreement {pairs['agreement']:.2f}"
    )
    lines.append(
        f"told apart on one second ({report.snippets[0]} real, {report.snippets[1]} made; "
        "0.5 is chance), and single made clips from the rest:"
    )
    for view in report.accuracy:
        lines.append(f"  {view:<36}{report.accuracy[view]:>8.2f}{report.control[view]:>8.2f}")
    return lines
