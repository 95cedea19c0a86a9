"""What there is to see in one interaction: posed hands, the object, what is measured on them."""

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import Side
from geneoh.errors import InputError, MissingAssetError
from geneoh.fitting.fit import fit_keypoints
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rigid import Rigid
from geneoh.hand.library import hand_of_betas, load_hand
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import TIP_KEYPOINTS
from geneoh.metrics.contact import penetration_depth, tips_in_contact
from geneoh.metrics.smoothness import acceleration, per_frame_squared
from geneoh.pipeline.subject import subject_of
from geneoh.sequence.sequence import MIRROR, HandTrack, ObjectTrack, Sequence
from geneoh.viz.surface import creased

FAR = 0.03
"""Vertices farther than this from the object's box need no exact distance, metres."""
SPREAD_REACH = 0.015
"""How far a keypoint's spread reaches over the skin, metres."""


@dataclass(frozen=True)
class SeenHand:
    """One hand as a mesh in the world over T frames, and what is measured on it."""

    side: Side
    model: HandModel
    track: HandTrack
    """As it came; parameters that were fitted for the mesh are in `pose`, `wrist`, `betas`."""
    pose: Float[Tensor, "T 16 3"]
    wrist: Float[Tensor, "T 3"]
    betas: Float[Tensor, " S"]
    verts: Float[Tensor, "T V 3"]
    joints: Float[Tensor, "T 21 3"]
    """The track's own keypoints where it has some, else those of the pose."""
    distance: Float[Tensor, "T V"]
    """To the object, metres, negative inside; beyond 3 cm only a lower bound."""
    depth: Float[Tensor, " T"]
    """Deepest penetration, metres."""
    fingers: Float[Tensor, " T"]
    """Fingertips at most 5 mm from the object."""
    acceleration: Float[Tensor, " T"]
    """Mean over keypoints, mm per frame squared; NaN in the first and last frame."""

    @property
    def valid(self) -> Bool[Tensor, " T"]:
        """Frames in which the hand is there."""
        return self.track.valid

    @cached_property
    def spread(self) -> Float[Tensor, "T V"] | None:
        """Expected error (`HandTrack.joint_spread`) carried to the vertices, metres."""
        if self.track.joint_spread is None:
            return None
        apart = torch.cdist(self.verts[:1], self.joints[:1])[0]
        weights = torch.softmax(-((apart / SPREAD_REACH) ** 2), dim=-1)
        return self.track.joint_spread @ weights.T


@dataclass(frozen=True)
class Take:
    """One version of the interaction: as it came, or as it was cleaned."""

    title: str
    hands: tuple[SeenHand, ...]


@dataclass(frozen=True)
class Scene:
    """Takes of one interaction around one object."""

    takes: tuple[Take, ...]
    """Before, then after; or one alone."""
    object: ObjectTrack
    fps: float
    samples: dict[Side, Float[Tensor, "S T 21 3"]]
    """Keypoints of every sample that was drawn, where the result keeps them."""

    @property
    def frames(self) -> int:
        """Number of frames T."""
        return len(self.object.rotation)

    @cached_property
    def creased_parts(self) -> tuple[Mesh, ...]:
        """The object's parts as they are drawn, with sharp edges."""
        return tuple(creased(mesh) for mesh in self.object.meshes)

    def part_pose(self, part: int, frame: int) -> Rigid:
        """From a part's own frame to the world."""
        return Rigid(self.object.rotation[frame, part], self.object.translation[frame, part])

    def object_verts(self, part: int, frame: int) -> Float[Tensor, "V 3"]:
        """Vertices of a part in the world."""
        return self.part_pose(part, frame).apply(self.object.meshes[part].verts)


def make_scene(
    sequences: dict[str, Sequence],
    *,
    samples: dict[Side, Float[Tensor, "S R 21 3"]] | None = None,
    mano_dir: Path | str | None = None,
) -> Scene:
    """Pose and measure every hand of one or two versions of an interaction.

    The object is that of the last sequence. A hand of keypoints alone is fitted. Betas of MANO get
    MANO's mesh where the user has it, and the embedded hand of the same bones elsewhere.

    Args:
        sequences: by title, in the order before, after.
        samples: per side, keypoints of the samples at any frame rate; brought to the frames.
        mano_dir: folder of the user's MANO files.

    Raises:
        InputError: the sequences have different numbers of frames, or there is no mesh.
    """
    last = next(reversed(sequences.values()))
    if not last.object.meshes:
        raise InputError(f"{last.source}: expected an object mesh, got none; pass --obj MESH")
    for sequence in sequences.values():
        if sequence.frames != last.frames:
            raise InputError(
                f"{sequence.source}: both must have the same frames, got {sequence.frames} "
                f"against {last.frames}; cut them to the same frames"
            )
    surface = replace(last.object.surface(), within=FAR)
    takes = tuple(
        Take(
            title,
            tuple(see_hand(hand, surface, sequence.fps, mano_dir) for hand in sequence.hands),
        )
        for title, sequence in sequences.items()
    )
    paced: dict[Side, Float[Tensor, "S T 21 3"]] = {
        side: _at_frames(drawn, last.frames) for side, drawn in (samples or {}).items()
    }
    return Scene(takes, last.object, last.fps, paced)


def _at_frames(drawn: Float[Tensor, "S R 21 3"], frames: int) -> Float[Tensor, "S T 21 3"]:
    """The same span of time in another number of frames: the nearest in time."""
    return drawn[:, torch.linspace(0, drawn.shape[1] - 1, frames).round().long()]


def right_model(track: HandTrack, mano_dir: Path | str | None) -> HandModel:
    """The right-hand model of a track's betas; the embedded hand where the user has no MANO."""
    try:
        model = hand_of_betas(track.side, track.hand_model, mano_dir=mano_dir)
    except MissingAssetError:
        return load_hand("right")
    return model.mirrored() if track.side == "left" else model


def see_hand(
    track: HandTrack,
    surface: MovingSurface,
    fps: float,
    mano_dir: Path | str | None = None,
) -> SeenHand:
    """One track as a mesh, measured against the object."""
    right = track.mirrored() if track.side == "left" else track
    model = right_model(track, mano_dir)
    with torch.no_grad():
        subject = subject_of(right, model)
        state = subject.start or fit_keypoints(
            subject.joints[None], subject.trust[None], subject.shaped
        )
        posed = subject.shaped.verts_from_rotations(state.rotations, state.wrist)
        verts, joints, pose, wrist = posed.verts[0], subject.joints, state.pose[0], state.wrist[0]
        if track.side == "left":
            flip = verts.new_tensor(MIRROR)
            verts, joints, wrist, pose = verts * flip, joints * flip, wrist * flip, pose * -flip
            model = model.mirrored()
        distance = surface.query(verts).distance
        tips = joints[:, list(TIP_KEYPOINTS)]
        return SeenHand(
            side=track.side,
            model=model,
            track=track,
            pose=pose,
            wrist=wrist,
            betas=subject.betas,
            verts=verts,
            joints=joints,
            distance=distance,
            depth=penetration_depth(distance),
            fingers=tips_in_contact(distance, verts, tips).sum(-1).float(),
            acceleration=_centred_acceleration(joints, fps),
        )


def _centred_acceleration(joints: Float[Tensor, "T 21 3"], fps: float) -> Float[Tensor, " T"]:
    """Acceleration at the middle one of the three frames that it is made of."""
    found = per_frame_squared(acceleration(joints, fps), fps)
    padded = joints.new_full((len(joints),), torch.nan)
    padded[1 : 1 + len(found)] = found
    return padded
