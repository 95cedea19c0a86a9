"""The choice of the best of several actions that were sampled for the same sentence.

Some samples are faulty: the object moves without a hand near it, the motion is a mean of two ways
of doing something, a hand turns over within a frame, or it penetrates the object deeply. What even
the best one lacks is noted.
"""

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.choices import SIDES
from geneoh.generators.text2hoi.physics.held_hands import frames_of_motion
from geneoh.generators.text2hoi.physics.resting import moved_by_hands, touching_hands
from geneoh.generators.text2hoi.sentences.passing import handed_over
from geneoh.generators.text2hoi.sentences.prompt import JOINTED, Prompt
from geneoh.geometry.oriented_points import signed_to_points
from geneoh.hand.spheres import hand_spheres
from geneoh.synthesis.actions.action import Actions

COMPARED_AT = 0.1
"""Distance of the points at which objects are compared from their origin, on each axis, metres."""
MISSED_SHARE, MISSED = 0.25, 0.005
"""How far an object may be, on average, from its sampled motion when it moves only while a hand
touches it: a share of the sampled displacement, plus metres."""
HANDS = 2.0  # weight of a distance of hands relative to one of the object
JUMP = 0.08  # step of a keypoint in one frame from which on a hand jumps, metres
DEPTH_EVERY = 5  # step between the frames in which penetration depths are measured
DEEPEST = 0.1  # metres: no hand is deeper in an object that hands can hold
HARDLY_MOVED = 0.01  # how far an object moves at most that is told to rest, metres
IDLE = 0.5  # share of the object's moving frames in which each of two hands should touch it


def best_draws(
    actions: Actions, draws: int, fits: Bool[Tensor, " B"] | None = None
) -> Int[Tensor, " G"]:
    """The index of the best of each `draws` consecutive samples, on the CPU.

    Candidates are the samples that fit, or all if none does. Of these those stay whose hands carry
    the object, or the one that comes closest to it; then the half that is most like the others; and
    of this half the sample with the least penetration depth. Samples in which a hand jumps are kept
    only if one jumps in all that stay.
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
    calm = (largest_step(actions) < JUMP).unflatten(0, (-1, draws))
    rank = carried * (1 + typical + 2 * calm)
    best = rank == rank.amax(1, keepdim=True)
    depth = depth_in_object(actions).unflatten(0, (-1, draws)).masked_fill(~best, torch.inf)
    return torch.arange(len(depth)) * draws + depth.argmin(1)


def missed_motion(actions: Actions) -> Float[Tensor, " B"]:
    """Distance of objects from their sampled motion, when they move only while a hand touches them,
    beyond the allowed one (`MISSED_SHARE`, `MISSED`), metres; negative where hands carry them.
    """
    both = map(_object_places, (actions, moved_by_hands(actions)))
    drawn, moved = (places - places[:, :1] for places in both)
    missed = _over_frames((drawn - moved).norm(dim=-1).mean(-1), actions)
    return missed - MISSED_SHARE * _over_frames(drawn.norm(dim=-1).mean(-1), actions) - MISSED


def moved_by(actions: Actions) -> Float[Tensor, " B"]:
    """Largest distance of a part of each object from where it was at the start, metres."""
    places = _object_places(actions)
    return (places - places[:, :1]).norm(dim=-1).amax(-1).mul(actions.valid).amax(1)


def largest_step(actions: Actions) -> Float[Tensor, " B"]:
    """Longest step of a keypoint of the hands from one frame to the next, metres."""
    steps = actions.keypoints().diff(dim=2).norm(dim=-1).amax(-1)
    return (steps * (actions.hands[..., None] & actions.valid[:, None, 1:])).flatten(1).amax(1)


def distances(actions: Actions, draws: int) -> Float[Tensor, "G D D"]:
    """Mean distance over the frames between each two of `draws` consecutive samples, metres.

    It is the distance of the object's poses plus the difference of the keypoints' distances from
    the object's centroid, so that hands on different sides of it are alike.
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
    """Penetration depth of the deepest hand sphere, metres, mean over some of the frames."""
    frames = torch.arange(0, actions.joint.shape[1], DEPTH_EVERY)
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
    return (translation[..., None, :] + COMPARED_AT * rotation.mT).flatten(2, 3)


def _over_frames(values: Float[Tensor, "B T"], actions: Actions) -> Float[Tensor, " B"]:
    """Means over the frames of each clip."""
    return (values * actions.valid).sum(1) / actions.length


def missing_notes(actions: Actions, prompt: Prompt, draws: int) -> tuple[str, ...]:
    """Notes on what the sentence asks for and the finished first action lacks."""
    found = []
    opens = bool(actions.joint.diff(dim=1).any())  # perhaps by few millimetres, as its range says
    if prompt.verb != "press" and not opens and moved_by(actions)[0] < HARDLY_MOVED:
        found.append("the object hardly moves; another seed may make it move")
    touching, moves = touching_hands(actions)[0], frames_of_motion(actions)
    alone = not bool(moves.any()) or prompt.verb in ("pass", *JOINTED)  # one hand may do most of it
    held = (touching & moves).sum(1) >= IDLE * moves.sum()
    for number in torch.nonzero(actions.hands[0])[:, 0].tolist():
        if not bool(touching[number].any()):
            found.append(fault_note(draws, f"the {SIDES[number]} hand does not come to the object"))
        elif not alone and not bool(held[number]):
            found.append(fault_note(draws, f"the {SIDES[number]} hand hardly touches the object"))
    if prompt.giver is not None and not handed_over(touching, prompt.giver):
        found.append(fault_note(draws, f"the {prompt.giver} hand does not pass the object on"))
    return tuple(found)


def fault_note(draws: int, fault: str) -> str:
    """The note on a fault that even the best sample has."""
    drawn = f"the best of {draws} drawn motions" if draws > 1 else "the drawn motion"
    return f"in {drawn} {fault}; another seed or more draws may make a better one"
