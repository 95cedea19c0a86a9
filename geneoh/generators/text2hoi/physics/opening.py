"""A hand that opens or closes an object of two parts: the joint's motion, and hands that follow it.

The network predicts when and how far a joint moves. It was trained on few joints, and its hands
stray from a moving part. So the joint is made to go from closed to open, or back, within its range
and in one direction, the first part rests on the table, and the hand that is nearer to the second
part follows it.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.generators.sampling import smoothed_clips
from geneoh.generators.text2hoi.physics.resting import touching_hands, with_hands_at
from geneoh.geometry.rigid import Rigid
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.motions.object_motion import minimum_jerk

END_SHARE = 6  # the end states of a joint are means over the first and the last sixth of a clip
LEAST_OPENING = 0.25
"""Share of its range that a sampled joint must move; else a default motion replaces its own."""
MADE_UP = (0.35, 0.65)  # start and end of the default motion, as shares of the clip
STILL_SHARE = 0.05  # share of the motion at either end that does not count as moving
STATE_FILTER = 2.0  # standard deviation of the Gaussian over the joint's states, frames
MOVING_SPEED = 1e-4  # radians or decimetres per frame above which a joint moves
BEGIN = 3  # the first third of the joint's motion decides which hand moves it


def guided(actions: Actions, closes: bool, most: float) -> Actions:
    """Sampled actions whose joint only opens, or only closes, and whose first part rests.

    The joint is closed at 0 and moves by `most` / 2 to `most`, radians or metres. Hands keep their
    pose relative to the part that they are at.
    """
    way, share = _drawn_way(actions, closes, most)
    open_share = 1 - share if closes else share
    joint = way.clamp(most / 2, most)[:, None] * open_share
    return with_joint(actions, joint, opener(replace(actions, joint=joint), actions))


def _drawn_way(
    actions: Actions, closes: bool, most: float
) -> tuple[Float[Tensor, " B"], Float[Tensor, "B T"]]:
    """How far sampled joints move, and the share of this that is done in each frame, 0 to 1."""
    frames = torch.arange(actions.joint.shape[1])
    last = actions.length[:, None] - 1
    ends = (frames <= last / END_SHARE, (frames >= last - last / END_SHARE) & (frames <= last))
    first, final = ((actions.joint * end).sum(1) / end.sum(1) for end in ends)
    way = (first - final) if closes else (final - first)
    share = (actions.joint - first[:, None]) / (final - first)[:, None]
    share = ((share.cummax(1).values - STILL_SHARE) / (1 - 2 * STILL_SHARE)).clamp(0, 1)
    made_up = minimum_jerk((frames / last - MADE_UP[0]) / (MADE_UP[1] - MADE_UP[0]))
    share = torch.where((way > LEAST_OPENING * most)[:, None], share, made_up)
    return way, smoothed_clips(share[..., None], STATE_FILTER, actions.length)[..., 0].clamp(0, 1)


def joint_frames(actions: Actions) -> Bool[Tensor, "B T"]:
    """Mask of frames just before or after which the joint moves."""
    moves = (actions.joint * actions.joint_units).diff(dim=1).abs() > MOVING_SPEED
    pad = torch.nn.functional.pad
    return pad(moves, (1, 0)) | pad(moves, (0, 1))


def outward(actions: Actions) -> tuple[Float[Tensor, "B 3"], Float[Tensor, "B 3"]]:
    """Unit directions away from the hinge, or along the slide, and the centroids of second parts.

    Both are in the frame of the closed object, metres. A hand moves a lid beyond its centroid.
    """
    there = (actions.part > 0).to(actions.points)[..., None]
    middle = (actions.points * there).sum(1) / there.sum(1)
    apart = middle - actions.pivot
    apart = apart - torch.linalg.vecdot(apart, actions.axis)[:, None] * actions.axis
    way = torch.where(actions.slides[:, None], actions.axis, apart)
    return torch.nn.functional.normalize(way, dim=-1), middle


def part_gaps(actions: Actions) -> Float[Tensor, "B 2 T"]:
    """Distance of the nearest keypoint of each hand to the outward half of the second part, metres.

    The distance is infinite for hands that do not take part.
    """
    way, middle = outward(actions)
    outer = ((actions.points - middle[:, None]) @ way[..., None])[..., 0] > 0
    joints, (rotation, translation) = actions.keypoints(), actions.part_poses()
    gaps = torch.full(actions.wrist.shape[:3], torch.inf)
    for clip in range(len(gaps)):
        points = actions.points[clip, (actions.part[clip] > 0) & outer[clip]]
        posed = points @ rotation[clip, :, 1].mT + translation[clip, :, 1, None]
        for hand in torch.nonzero(actions.hands[clip])[:, 0].tolist():
            gaps[clip, hand] = torch.cdist(joints[clip, hand], posed).amin((1, 2))
    return gaps


def starting_gap(moving: Actions, drawn: Actions) -> Float[Tensor, "B 2"]:
    """Mean distance of sampled hands from the second part as its joint begins to move, metres."""
    moves = joint_frames(moving)
    begun = moves & (moves.cumsum(1) * BEGIN <= moves.sum(1, keepdim=True) + BEGIN)
    gaps = torch.where(begun[:, None], part_gaps(drawn), 0.0).sum(2)
    return gaps / begun.sum(1).clamp(min=1)[:, None]


def under_table(actions: Actions) -> Float[Tensor, " B"]:
    """Mean depth over the frames of the hands' lowest keypoint below the table, metres."""
    lowest = (-actions.keypoints()[..., 2].amin(-1)).clamp(min=0) * actions.hands[:, :, None]
    return (lowest.amax(1) * actions.valid).sum(1) / actions.length


def opener(moving: Actions, drawn: Actions) -> Bool[Tensor, "B 2"]:
    """One-hot mask of the hand that moves the joint: the sampled one nearer to the second part."""
    nearest = starting_gap(moving, drawn).argmin(1)
    return torch.nn.functional.one_hot(nearest, 2).bool()


def with_joint(
    actions: Actions, joint: Float[Tensor, "B T"], on_second: Bool[Tensor, "B 2"]
) -> Actions:
    """The same actions with other states of the joint and the first part at rest on the table.

    Hands in `on_second` follow the second part, the others the first one.
    """
    still = torch.eye(3).expand_as(actions.rotation), torch.zeros_like(actions.translation)
    moved = replace(actions, rotation=still[0], translation=still[1], joint=joint)
    (turns, shifts), (ends, places) = actions.part_poses(), moved.part_poses()
    change = Rigid(ends, places).compose(Rigid(turns, shifts).inverse())  # (B, T, 2)
    part = on_second.long()[:, :, None].expand(-1, -1, joint.shape[1])
    rows, frames = torch.arange(len(part))[:, None, None], torch.arange(part.shape[2])
    turn, shift = change.rotation[rows, frames, part], change.translation[rows, frames, part]
    wrist = (turn @ actions.wrist[..., None])[..., 0] + shift
    return with_hands_at(moved, wrist, turn)


def rigid_part(actions: Actions, part: int) -> Actions:
    """The first action with one part alone, 0 or 1, as a rigid object in the closed one's frame."""
    rotation, translation = actions.part_poses()
    there = actions.part[0] == part
    return replace(
        actions,
        rotation=rotation[:, :, part],
        translation=translation[:, :, part],
        joint=torch.zeros_like(actions.joint),
        points=actions.points[:, there],
        normals=actions.normals[:, there],
        part=torch.zeros_like(actions.part[:, there]),
        axis=torch.zeros_like(actions.axis),
    )


def moved_by_hands_at_part(actions: Actions, closes: bool) -> Actions:
    """The first action with a joint that moves only while a hand is within `TOUCHED` of its part.

    It still starts closed, or ends closed if it `closes`.
    """
    touching = touching_hands(rigid_part(actions, 1))
    held = touching.any(1)
    steps = actions.joint.diff(dim=1) * (held[:, 1:] & held[:, :-1])
    joint = torch.nn.functional.pad(steps.cumsum(1), (1, 0))
    if closes:
        joint = joint - joint[:, -1:]
    return with_joint(actions, joint, opener(actions, actions))


def left_out(before: Actions, after: Actions) -> float:
    """The share of the joint's motion in `before` that `after` lacks, in the first action."""
    ways = [float(each.joint[0].amax() - each.joint[0].amin()) for each in (before, after)]
    return 1 - ways[1] / max(ways[0], 1e-9)
