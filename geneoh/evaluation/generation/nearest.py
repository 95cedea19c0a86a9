"""What a generator must beat: the nearest training clips."""

from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.synthesis.actions import Actions

SHAPE_POINTS = 128  # points of an object by which shapes are compared


def nearest_training(real: Actions, training: Actions) -> Actions:
    """For each clip the motion of the training clip of its verb and hands whose object is nearest.

    The motion is that of hands, object and joint as it was; the object that moves is the clip's
    own. Objects of the same kind of joint are searched first. Where no training clip has the verb
    and the hands, all with the hands are searched, else all. Objects are compared in size and shape
    as they stand. A joint of another kind moves as far as networks are told it: a radian is a
    decimetre.
    """
    at = torch.tensor([_nearest(real, clip, training) for clip in range(len(real.verb))])
    found = training.take(at, "B")
    same = ("length", "pose", "wrist", "rotation", "translation", "hands")
    joint = found.joint * found.joint_units / real.joint_units
    return replace(real, joint=joint, **{name: getattr(found, name) for name in same})


def _nearest(real: Actions, clip: int, training: Actions) -> int:
    hands = (training.hands == real.hands[clip]).all(1)
    both = hands & (training.verb == real.verb[clip])
    alike = both & (joint_kinds(training) == joint_kinds(real)[clip])
    tried = next(each for each in (alike, both, hands, torch.ones_like(hands)) if bool(each.any()))
    which = torch.nonzero(tried)[:, 0]
    apart = chamfer(shape_points(training.take(which, "B")), shape_points(real)[clip])
    return int(which[apart.argmin()])


def joint_kinds(actions: Actions) -> Int[Tensor, " B"]:
    """0 for rigid objects, 1 for those with a hinge and 2 for those with a part that slides."""
    return (actions.part > 0).any(1) * (1 + actions.slides.long())


def shape_points(actions: Actions) -> Float[Tensor, "B S 3"]:
    """Some points of each object, spread over their order."""
    count = actions.points.shape[1]
    return actions.points[:, :: max(1, count // SHAPE_POINTS)]


def chamfer(many: Float[Tensor, "B S 3"], one: Float[Tensor, "R 3"]) -> Float[Tensor, " B"]:
    """Mean distance of each point to the nearest of the other cloud, both ways, metres."""
    apart = torch.cdist(many, one)
    return apart.amin(1).mean(1) + apart.amin(2).mean(1)
