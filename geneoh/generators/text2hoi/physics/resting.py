"""Physics that a network's samples lack: objects rest unless a hand touches them."""

from collections.abc import Callable
from dataclasses import replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.synthesis.actions.action import TOUCHED, Actions
from geneoh.synthesis.motions.object_motion import minimum_jerk

UPRIGHT_TURN = 0.5  # tilt from upright below which an object counts as standing, radians
EASE = 12  # frames at either end of a clip over which its time is slowed
FLAT_VERBS = ("slide", "rotate", "press")  # what is done to an object that stays on the table
ON_TABLE = 0.04  # height over the table below which an object counts as standing on it, metres


def touching_hands(actions: Actions) -> Bool[Tensor, "B 2 T"]:
    """Mask of frames in which a keypoint of each hand is within `TOUCHED` of an object point."""
    joints = actions.keypoints()
    rotation, translation = actions.part_poses()
    touching = torch.zeros(actions.wrist.shape[:3], dtype=torch.bool)
    for clip, frames in enumerate(actions.length.tolist()):
        part = actions.part[clip]
        posed = rotation[clip, :frames, part] @ actions.points[clip, :, :, None]
        posed = posed[..., 0] + translation[clip, :frames, part]
        for hand in torch.nonzero(actions.hands[clip])[:, 0].tolist():
            near = torch.cdist(joints[clip, hand, :frames], posed) < TOUCHED
            touching[clip, hand, :frames] = near.flatten(1).any(1)
    return touching


def finished(actions: Actions, settle: Callable[[Actions], Actions] | None = None) -> Actions:
    """Sampled actions from rest to rest, with objects that move only while a hand touches them.

    `settle` corrects the hands before the ends are eased: a later correction would move them again.
    """
    actions = moved_by_hands(actions)
    if settle is not None:
        actions = settle(actions)
    return moved_by_hands(eased(actions))


def kept_on_table(actions: Actions, verb: str) -> Actions:
    """The same actions, with objects that stay flat on the table where they slide or rotate, and at
    rest where they are pressed; hands keep their pose relative to the object."""
    if verb not in FLAT_VERBS:
        return actions
    frames = slice(1) if verb == "press" else slice(None)
    rotation = _upright(actions.rotation[:, frames]).expand_as(actions.rotation)
    ground = actions.translation[:, frames] * actions.translation.new_tensor([1.0, 1.0, 0.0])
    return with_object_motion(
        actions, rotation, ground.expand_as(actions.translation), actions.joint
    )


def eased(actions: Actions) -> Actions:
    """The same actions with time slowed at both ends, so that everything starts and ends at rest.

    Over `EASE` frames at either end time runs as 2 u^2 - u^3, whose rate goes from 0 to 1.
    """
    last = (actions.length - 1)[:, None].to(actions.joint)
    return _at_times(actions, eased_time(actions.joint.shape[1], last))


def eased_time(count: int, last: Float[Tensor, "B 1"]) -> Float[Tensor, "B {count}"]:
    """The times of `eased` at `count` frames, of clips whose last frames are `last`."""
    ends = (last / 3).clamp(min=1.0, max=EASE)
    time = torch.arange(count).to(last).minimum(last)

    def begun(since: Float[Tensor, "B T"]) -> Float[Tensor, "B T"]:
        share = (since / ends).clamp(max=1)
        return torch.where(since < ends, ends * (2 * share**2 - share**3), since)

    return torch.where(time < last / 2, begun(time), last - begun(last - time))


def retimed(actions: Actions, lengths: Int[Tensor, " B"]) -> Actions:
    """The same actions resampled from start to end to other numbers of frames, at least two."""
    pace = (actions.length - 1) / (lengths - 1)
    frames = torch.arange(int(lengths.max()), device=pace.device).minimum(lengths[:, None] - 1)
    return replace(_at_times(actions, frames * pace[:, None]), length=lengths)


def _at_times(actions: Actions, time: Float[Tensor, "B S"]) -> Actions:
    """The same actions at `time`, in frames from the start, interpolated between frames."""
    before = time.floor().long()
    after = torch.minimum(before + 1, actions.length[:, None] - 1)
    rows, share = torch.arange(len(time), device=time.device)[:, None], time - before

    def between(values: Float[Tensor, "B T ..."]) -> Float[Tensor, "B S ..."]:
        part = share.view(*share.shape, *[1] * (values.ndim - 2))
        return torch.lerp(values[rows, before], values[rows, after], part)

    def turned(rotation: Float[Tensor, "B T *N 3 3"]) -> Float[Tensor, "B S *N 3 3"]:
        start, end = rotation[rows, before], rotation[rows, after]
        part = share.view(*share.shape, *[1] * (rotation.ndim - 3))
        turn = matrix_to_axis_angle(start.mT @ end)
        return start @ axis_angle_to_matrix(part * turn)

    pose = axis_angle_to_matrix(actions.pose.transpose(1, 2))
    return replace(
        actions,
        pose=matrix_to_axis_angle(turned(pose)).transpose(1, 2),
        wrist=between(actions.wrist.transpose(1, 2)).transpose(1, 2),
        rotation=turned(actions.rotation),
        translation=between(actions.translation),
        joint=between(actions.joint),
    )


def moved_by_hands(actions: Actions) -> Actions:
    """The same actions with objects that move only while a hand touches them.

    Steps of the object between two frames of contact are kept, all others are dropped; hands keep
    their pose relative to the object. An object that nearly stands on the table at the start or the
    end, or that no hand touches there, is put on it; the correction at the end is spread over the
    second half of its motion. No object point is ever under the table.
    """
    touched = touching_hands(actions).any(1)
    moves = (touched[:, 1:] & touched[:, :-1]).to(actions.translation)
    start = _standing(actions.rotation[:, 0], actions.translation[:, 0], touched[:, 0])
    rotation, translation = [start[0]], [start[1]]
    step_turn = actions.rotation[:, :-1].mT @ actions.rotation[:, 1:]
    step_turn = matrix_to_axis_angle(step_turn) * moves[..., None]
    step = (actions.translation[:, 1:] - actions.translation[:, :-1]) * moves[..., None]
    for frame in range(moves.shape[1]):
        rotation.append(rotation[-1] @ axis_angle_to_matrix(step_turn[:, frame]))
        translation.append(translation[-1] + step[:, frame])
    turned, shifted = torch.stack(rotation, 1), torch.stack(translation, 1)
    way = step.norm(dim=-1) + 0.1 * step_turn.norm(dim=-1)
    progress = torch.nn.functional.pad(way.cumsum(1), (1, 0)) / way.sum(1).clamp(min=1e-9)[:, None]
    held = touched[torch.arange(len(touched)), actions.length - 1]
    end = _standing(turned[:, -1], shifted[:, -1], held)
    share = minimum_jerk((2 * progress - 1).clamp(min=0))[..., None]
    left_turn = matrix_to_axis_angle(end[0] @ turned[:, -1].mT)[:, None] * share
    turned = axis_angle_to_matrix(left_turn) @ turned
    shifted = shifted + (end[1] - shifted[:, -1])[:, None] * share
    lowest = (actions.posed_points() @ turned[..., 2, :, None])[..., 0].amin(-1) + shifted[..., 2]
    shifted = shifted - lowest.clamp(max=0)[..., None] * torch.eye(3)[2].to(shifted)
    joint = actions.joint[:, :1] + torch.nn.functional.pad(
        (actions.joint.diff(dim=1) * moves).cumsum(1), (1, 0)
    )
    return with_object_motion(actions, turned, shifted, joint)


def _standing(
    rotation: Float[Tensor, "B 3 3"], translation: Float[Tensor, "B 3"], held: Bool[Tensor, " B"]
) -> tuple[Float[Tensor, "B 3 3"], Float[Tensor, "B 3"]]:
    """The closest pose on the table for a pose that is nearly there or not held; else unchanged."""
    upright = _upright(rotation)
    tilt = matrix_to_axis_angle(rotation @ upright.mT).norm(dim=-1)
    stands = ~held | ((tilt < UPRIGHT_TURN) & (translation[:, 2] < ON_TABLE))
    ground = translation * translation.new_tensor([1.0, 1.0, 0.0])
    return (
        torch.where(stands[:, None, None], upright, rotation),
        torch.where(stands[:, None], ground, translation),
    )


def _upright(rotation: Float[Tensor, "*B 3 3"]) -> Float[Tensor, "*B 3 3"]:
    """The closest rotations about the vertical."""
    turned = rotation[..., 1, 0] - rotation[..., 0, 1], rotation[..., 0, 0] + rotation[..., 1, 1]
    return axis_angle_to_matrix(torch.atan2(*turned)[..., None] * torch.eye(3)[2].to(rotation))


def with_object_motion(
    actions: Actions,
    rotation: Float[Tensor, "B T 3 3"],
    translation: Float[Tensor, "B T 3"],
    joint: Float[Tensor, "B T"],
) -> Actions:
    """The same actions with another motion of the object, which the hands follow."""
    change = rotation @ actions.rotation.mT
    apart = actions.wrist - actions.translation[:, None]
    wrist = (change[:, None] @ apart[..., None])[..., 0] + translation[:, None]
    moved = replace(actions, rotation=rotation, translation=translation, joint=joint)
    return with_hands_at(moved, wrist, change[:, None])


def with_hands_at(
    actions: Actions, wrist: Float[Tensor, "B 2 T 3"], turn: Float[Tensor, "B _ T 3 3"]
) -> Actions:
    """The same actions with other wrist positions, and hands turned by a rotation in the world."""
    orient = matrix_to_axis_angle(turn @ axis_angle_to_matrix(actions.pose[..., 0, :]))
    pose = torch.cat([orient[..., None, :], actions.pose[..., 1:, :]], -2)
    there = actions.hands[:, :, None, None]
    return replace(actions, wrist=wrist * there, pose=pose * there[..., None]).ended()
