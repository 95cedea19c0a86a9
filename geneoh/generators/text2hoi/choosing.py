"""Of several actions that were drawn for the same sentence, the one that is kept.

A draw now and then lets hands stay away from the object that moves, falls between two ways of doing
something, where no real action is, or has hands deep in the object.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.generators.text2hoi.physics.resting import moved_by_hands
from geneoh.geometry.oriented_points import signed_to_points
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.grasping.contact_pads import hand_spheres

ARM = 0.1
"""Metres from its middle, along each of its axes, at which an object is compared."""
MISSED_SHARE, MISSED = 0.25, 0.005
"""How far an object may be, on average, from where it was drawn when it moves only while a hand
touches it: as a share of how far it was to move, and metres beside that."""
HANDS = 2.0
"""What a distance of hands counts against one of the object."""
EVERY = 5  # frames from one in which depths are measured to the next
DEEPEST = 0.1  # metres: no hand is deeper in an object that hands can hold


def best_draws(
    actions: Actions, draws: int, fits: Bool[Tensor, " B"] | None = None
) -> Int[Tensor, " G"]:
    """The number of one of each `draws` neighbours, on the CPU.

    Of those that fit, or of all where none does, it is one whose hands carry the object, or nearly
    so where none does; of these it is among the half that are most like the others, and there the
    least deep one.
    """
    actions = actions.to(torch.device("cpu"))
    fitting = torch.ones(len(actions.verb), dtype=torch.bool) if fits is None else fits.cpu()
    fitting = fitting.unflatten(0, (-1, draws))
    fitting = fitting | ~fitting.any(1, keepdim=True)
    missed = missed_motion(actions).unflatten(0, (-1, draws)).masked_fill(~fitting, torch.inf)
    carried = missed <= missed.amin(1, keepdim=True).clamp(min=0)
    unlike = (distances(actions, draws) * carried[:, None]).sum(2).masked_fill(~carried, torch.inf)
    half = (carried.sum(1, keepdim=True) + 1) // 2
    typical = unlike.argsort(1).argsort(1) < half
    depth = depth_in_object(actions).unflatten(0, (-1, draws)).masked_fill(~typical, torch.inf)
    return torch.arange(len(depth)) * draws + depth.argmin(1)


def missed_motion(actions: Actions) -> Float[Tensor, " B"]:
    """How much farther objects are from where they were drawn than they may be when they move only
    while a hand touches them, metres; less than zero where hands carry them.
    """
    both = map(_object_places, (actions, moved_by_hands(actions)))
    drawn, moved = (places - places[:, :1] for places in both)
    missed = _over_frames((drawn - moved).norm(dim=-1).mean(-1), actions)
    return missed - MISSED_SHARE * _over_frames(drawn.norm(dim=-1).mean(-1), actions) - MISSED


def distances(actions: Actions, draws: int) -> Float[Tensor, "G D D"]:
    """Mean distance over the frames between each two of `draws` neighbours, metres.

    It is that of the object, and that of how far keypoints of the hands are from its middle: hands
    that come from other sides are alike.
    """
    middle = (actions.rotation @ actions.points.mean(1)[:, None, :, None])[..., 0]
    middle = (middle + actions.translation)[:, None, :, None]
    reach = (actions.keypoints() - middle).norm(dim=-1) * actions.hands[:, :, None, None]
    reach = (reach / actions.hands.sum(1)[:, None, None, None]).transpose(1, 2).flatten(2)
    places, reach = (v.unflatten(0, (-1, draws)) for v in (_object_places(actions), reach))
    objects = (places[:, :, None] - places[:, None]).norm(dim=-1).mean(-1)
    hands = (reach[:, :, None] - reach[:, None]).abs().sum(-1) / 21
    first = actions.take(slice(None, None, draws), "B")  # neighbours are of the same length
    apart = (objects + HANDS * hands) * first.valid[:, None, None]
    return apart.sum(-1) / first.length[:, None, None]


def depth_in_object(actions: Actions) -> Float[Tensor, " B"]:
    """Depth of the deepest sphere of the hands in the object, mean over some frames, metres."""
    frames = torch.arange(0, actions.joint.shape[1], EVERY)
    some = actions.at_frames(frames.expand(len(actions.verb), -1))
    joints = some.keypoints()
    centers, radii = hand_spheres(joints.flatten(0, 2), torch.ones(joints[..., 0, 0].numel(), 1))
    centers = centers.unflatten(0, joints.shape[:3]).transpose(1, 2).flatten(2, 3)
    centers = (centers - some.translation[:, :, None]) @ some.rotation
    distance, _ = signed_to_points(
        centers.flatten(0, 1),
        some.posed_points().flatten(0, 1),
        some.posed_normals().flatten(0, 1),
        within=DEEPEST,
    )
    depth = (radii[0] - distance.view(*centers.shape[:2], 2, -1)).clamp(min=0).amax(-1)
    depth = (depth * some.hands[:, None]).amax(-1)
    there = frames < actions.length[:, None]
    return (depth * there).sum(1) / there.sum(1)


def _object_places(actions: Actions) -> Float[Tensor, "B T 6 3"]:
    """Three points of each part of the objects in the world."""
    rotation, translation = actions.part_poses()
    return (translation[..., None, :] + ARM * rotation.mT).flatten(2, 3)


def _over_frames(values: Float[Tensor, "B T"], actions: Actions) -> Float[Tensor, " B"]:
    """Means over the frames of each clip."""
    return (values * actions.valid).sum(1) / actions.length
