"""Actions from the user's recordings of H2O, GRAB and ARCTIC.

Source: Text2HOI, supplement, with the rules of its code: 30 frames a second, at most 150 of them; a
hand takes part where one of its keypoints comes within 2 cm of one of 1,024 surface points of the
object; where the label names hands, these take part and must come so near. Ours: hands take part
only if they are tracked in all frames, and the object frame is upright as the object rests in the
first frame of the recording.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.choices import SIDES, TAKING_PART, Axis
from geneoh.config import Limited
from geneoh.generators.text2hoi.physics.standing import POINTS
from geneoh.generators.text2hoi.sentences.annotation import SHORTEST_CLIP, Label
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle, turn_up
from geneoh.geometry.sampling import PartSamples
from geneoh.readers.sources.arctic import HINGE
from geneoh.seeds import seeded_generator
from geneoh.sequence.sequence import HandTrack, Sequence
from geneoh.synthesis.actions.action import FPS, LONGEST, TOUCHED, Actions
from geneoh.training.recordings import drawn_surface


@dataclass(frozen=True)
class RecordedConfig(Limited):
    """How recordings become actions; saved with them."""

    points: int = POINTS  # surface points of an object
    up: Axis = "z"  # axis of the recordings' world that points up (z in GRAB)
    held_out: str = ""
    """The subject whose clips are for validation only; empty for the last one by name."""


def surface_of(meshes: tuple[Mesh, ...], count: int) -> PartSamples:
    """Points of an object with its joint at zero, sampled by area, the same in all of its clips."""
    generator = seeded_generator("surface", *(mesh.sha256 for mesh in meshes))
    return drawn_surface(meshes, count, generator=generator)


@dataclass(frozen=True)
class ActionFrame:
    """Transforms from the world and mesh frames of a recording to those of actions.

    p_action = turn @ p_recording - origin in the world, p_upright = upright @ p_mesh - shift.
    """

    turn: Float[Tensor, "3 3"]
    origin: Float[Tensor, " 3"]
    upright: Float[Tensor, "3 3"]
    shift: Float[Tensor, " 3"]

    @classmethod
    def of(
        cls, recording: Sequence, start: int, first: int, surface: PartSamples, up: Axis
    ) -> "ActionFrame":
        """The transforms with the object upright as at time `first`, when its lowest point is on
        the table, and above the origin at time `start`."""
        turn, track = turn_up(up), recording.object
        upright = turn @ track.rotation[first, 0]
        points = surface.points @ upright.T
        shift = torch.cat([points.mean(0)[:2], points.amin(0)[2:]])
        at_rest, at_start = (
            turn @ (track.rotation[frame, 0] @ upright.T @ shift + track.translation[frame, 0])
            for frame in (first, start)
        )
        return cls(turn, torch.cat([at_start[:2], at_rest[2:]]), upright, shift)


def action_of(
    recording: Sequence, label: Label, surface: PartSamples, up: Axis, known: Bool[Tensor, " T"]
) -> Actions | str:
    """A stretch of a recording as one action, or the reason why it cannot be used, in words.

    `known` are the frames in which the object's pose was observed. Verb and name are 0.
    """
    step = round(recording.fps / FPS)
    chosen = torch.arange(recording.frames)[label.frames][::step][:LONGEST]
    if len(chosen) < SHORTEST_CLIP:
        return f"of fewer than {SHORTEST_CLIP} frames"
    if not bool(known[chosen].all()):
        return "in which the object is not seen"
    posed = (hand for hand in recording.hands if hand.pose is not None and hand.wrist is not None)
    seen = [hand for hand in posed if bool(hand.valid[chosen].all())]
    first = int(torch.nonzero(known)[0])
    place = ActionFrame.of(recording, int(chosen[0]), first, surface, up)
    action = _with_hands(object_action(recording, chosen, surface, place), seen, chosen, place)
    near = _touching(action, seen, chosen, place)
    if label.hands is not None:
        labelled = torch.tensor(TAKING_PART[label.hands])
        if bool((labelled & ~near).any()):
            return "in which a hand of the label is not seen to touch the object"
        near = labelled
    if not bool(near.any()):
        return "in which no hand touches the object"
    there = near[None, :, None, None].float()
    pose, wrist = action.pose * there[..., None], action.wrist * there
    return replace(action, hands=near[None], pose=pose, wrist=wrist).ended()


def object_action(
    recording: Sequence, chosen: Int[Tensor, " N"], surface: PartSamples, place: ActionFrame
) -> Actions:
    """The object's motion in the chosen frames, without hands."""
    track, zeros = recording.object, torch.zeros(1, dtype=torch.long)
    rotation = place.turn @ track.rotation[chosen, 0] @ place.upright.T
    translation = track.translation[chosen, 0] @ place.turn.T + rotation @ place.shift
    jointed = float(track.rotation.shape[1] > 1)
    return Actions(
        verb=zeros,
        name=zeros,
        hands=torch.zeros(1, 2, dtype=torch.bool),
        length=torch.tensor([len(chosen)]),
        pose=torch.zeros(1, 2, LONGEST, 16, 3),
        wrist=torch.zeros(1, 2, LONGEST, 3),
        rotation=padded(rotation)[None],
        translation=padded(translation - place.origin)[None],
        joint=padded(opening(track.rotation[chosen]))[None],
        points=(surface.points @ place.upright.T - place.shift)[None],
        normals=(surface.normals @ place.upright.T)[None],
        part=surface.part[None].long(),
        axis=(place.upright @ torch.from_numpy(HINGE).float() * jointed)[None],
        pivot=-place.shift[None] * jointed,
        slides=torch.zeros(1, dtype=torch.bool),
    )


def padded(values: Float[Tensor, "N ..."]) -> Float[Tensor, "T ..."]:
    """Values padded to `LONGEST` frames by repeating the last one."""
    return values[torch.arange(LONGEST).clamp(max=len(values) - 1)]


def opening(rotation: Float[Tensor, "N Q 3 3"]) -> Float[Tensor, " N"]:
    """Angle of the second part about ARCTIC's hinge, radians; zero for objects of one part."""
    if rotation.shape[1] < 2:
        return rotation.new_zeros(len(rotation))
    relative = (rotation[:, 0].mT @ rotation[:, 1]).double().numpy()
    about_z = np.arctan2(relative[:, 1, 0], relative[:, 0, 0])
    return torch.from_numpy(np.unwrap(about_z * HINGE[2])).float()


def _with_hands(
    action: Actions, seen: list[HandTrack], chosen: Int[Tensor, " N"], place: ActionFrame
) -> Actions:
    """The action with the hands of all tracks in `seen`."""
    pose, wrist = action.pose.clone(), action.wrist.clone()
    for track in seen:
        assert track.pose is not None, "hands that are seen are posed"
        assert track.wrist is not None, "hands that are seen are posed"
        turned, number = track.pose[chosen].clone(), SIDES.index(track.side)
        turned[:, 0] = matrix_to_axis_angle(place.turn @ axis_angle_to_matrix(turned[:, 0]))
        pose[0, number] = padded(turned)
        wrist[0, number] = padded(track.wrist[chosen] @ place.turn.T - place.origin)
    return replace(action, pose=pose, wrist=wrist)


def _touching(
    action: Actions, seen: list[HandTrack], chosen: Int[Tensor, " N"], place: ActionFrame
) -> Bool[Tensor, " 2"]:
    """Whether the left and the right hand come within `TOUCHED` of the object's points.

    Keypoints are the recorded ones where there are any, else those of a hand of the mean shape.
    """
    count, found = len(chosen), torch.zeros(2, dtype=torch.bool)
    turn = action.rotation[0, :count].mT
    points, mean_hand = action.posed_points()[0, :count], action.keypoints()[0, :, :count]
    for track in seen:
        number, joints = SIDES.index(track.side), mean_hand[SIDES.index(track.side)]
        if track.joints is not None:
            joints = track.joints[chosen] @ place.turn.T - place.origin
        local = (joints - action.translation[0, :count, None]) @ turn.mT
        found[number] = bool((torch.cdist(local, points) < TOUCHED).any())
    return found
