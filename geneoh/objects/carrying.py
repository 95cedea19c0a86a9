"""The object part that a hand holds: the stages use its frame, and it moves the hand through gaps
of the hand's track."""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import spread
from geneoh.geometry.distance import MovingSurface
from geneoh.geometry.rigid import Rigid
from geneoh.objects.evidence import NOT_TOUCHING, TOUCHING, distance_of_parts, share_between
from geneoh.sequence.gaps import Carrier, filled_keypoints, observed_around
from geneoh.sequence.sequence import HandTrack
from geneoh.sequence.windows import in_long_runs

HELD_DISTANCE, FREE_DISTANCE = 0.015, 0.03
"""Distance of the nearest keypoint to the surface beside a gap, metres: up to the first bound the
hand holds the part, from the second on it does not. Keypoints lie 10 mm inside the hand."""
FEWEST_TRUSTED, LONGEST_SPARSE = 7, 30.0
"""Keypoints of some confidence from which a frame is kept while the object carries the hand, and
the frames in a row without so many from which all of them are kept: three to six exact keypoints
for 12 to 25 frames left three times the error of a gap, and over 40 frames as much."""
COMPARED_FRAMES = 6  # frames beside a gap in which hand and part are compared
SAMPLED_FRAMES, SAMPLED_VERTS = 8, 512
"""Frames and vertices for the test whether two parts stay together."""
REST_DEVIATION = 0.006
"""Standard deviation of a part's motion at the hand below which it rests, metres."""


def with_held_part_first(joints: Float[Tensor, "T 21 3"], surface: MovingSurface) -> MovingSurface:
    """The object with its parts reordered: first the one that the hand touches for longest.

    The stages see a hand in the frame of the first part, which must not be one that only the other
    hand holds. The order is unchanged if the hand touches no part, or if the touched part stays at
    the first one, such as a lid or a drawer, as in training.
    """
    if len(surface.fields) == 1:
        return surface
    away = distance_of_parts(joints, surface)
    held = int(share_between(away, TOUCHING, NOT_TOUCHING).mean(0).argmax())
    if held == 0 or stays_at_the_first(surface, held):
        return surface
    return surface.of_parts(sorted(range(away.shape[1]), key=lambda part: part != held))


def stays_at_the_first(surface: MovingSurface, part: int) -> bool:
    """Whether a part is near the first part in all of `SAMPLED_FRAMES` evenly spaced frames."""
    some = surface.at(spread(len(surface.rotation), SAMPLED_FRAMES))
    verts = surface.fields[part].mesh.some_verts(SAMPLED_VERTS).to(some.rotation)
    places = verts @ some.rotation[:, part].mT + some.translation[:, part, None]
    apart = some.of_parts([0]).query(places).distance.amin(-1)
    return bool((apart < TOUCHING).all())


def carrier_of(
    hand: HandTrack, surface: MovingSurface, relied: Float[Tensor, "T Q"]
) -> Carrier | None:
    """The object part that is nearest to the hand beside its gaps, and the confidence there that
    the hand holds it: the product of closeness, of whether the hand moves with the part
    (`moves_with`), and of `relied`, the reliability of the part's poses.

    None if the hand is observed in all frames.
    """
    seen = hand.observed
    lost = torch.nn.functional.pad(~seen, (1, 1))
    beside = torch.nonzero(seen & (lost[:-2] | lost[2:]))[:, 0]
    if len(beside) == 0:
        return None
    joints = filled_keypoints(hand)
    away = distance_of_parts(joints[beside], surface.at(beside))
    part = int(away.mean(0).argmin())
    pose = Rigid(surface.rotation[:, part], surface.translation[:, part])
    share = torch.zeros_like(relied[:, part])
    held = share_between(away[:, part], HELD_DISTANCE, FREE_DISTANCE).to(share)
    middle = joints.mean(1)
    along = torch.stack([moves_with(pose, middle, seen, int(frame)) for frame in beside])
    share[beside] = held * along * relied[beside, part]
    return Carrier(pose, share)


def without_sparse_frames(
    hand: HandTrack, surface: MovingSurface, relied: Float[Tensor, "T Q"]
) -> HandTrack:
    """The track without frames of fewer than `FEWEST_TRUSTED` keypoints in which the object carries
    the hand, as `carrier_of` says of a gap in their place: the object's motion determines the whole
    hand, and so few keypoints neither its palm nor its other fingers.

    A track with a pose, or in which such frames are more than half, is kept.
    """
    count = (hand.trust > 0).sum(-1)
    lost = in_long_runs((count < FEWEST_TRUSTED).cpu().numpy(), LONGEST_SPARSE)
    sparse = (count > 0) & (count < FEWEST_TRUSTED) & ~torch.from_numpy(lost).to(count.device)
    few = 2 * int(sparse.sum()) <= int(hand.observed.sum())
    if hand.pose is not None or not few or not bool(sparse.any()):
        return hand
    without = replace(hand, valid=hand.valid & ~sparse)
    carrier = carrier_of(without, surface, relied)
    assert carrier is not None, "the track has a gap"
    held = observed_around(without.observed).points(carrier.share) > 0.5
    return replace(hand, valid=hand.valid & ~(sparse & held))


def moves_with(
    pose: Rigid, middle: Float[Tensor, "T 3"], seen: Bool[Tensor, " T"], frame: int
) -> Float[Tensor, ""]:
    """Whether the hand moves with a part in the observed frames around one, 0 to 1.

    1 if it moves rigidly with the part or the part rests; 0 if it moves over the part by as much as
    the part moves at the hand."""
    around = torch.arange(len(seen), device=seen.device)
    around = around[seen & ((around - frame).abs() <= COMPARED_FRAMES)]
    there = pose.at(around)
    own = there.inverse().apply(middle[around, None])[:, 0]
    over, moved = scatters(there, own)
    steady = around[2:] - around[:-2] == 2
    if bool(steady.any()):  # subtract the white noise of the hand
        noise = own.diff(n=2, dim=0)[steady].square().sum(-1).mean() / 6
        over = (over - noise).clamp(min=0)
    return torch.where(moved < REST_DEVIATION**2, 1.0, carried(over, moved))


def scatters(pose: Rigid, own: Float[Tensor, "N 3"]) -> tuple[Float[Tensor, ""], Float[Tensor, ""]]:
    """How far a point moves over a rigid body, as the variance of its place `own` in the body's
    frame, and how far the body moves there, as that of its mean place in the world; metres²."""
    return _scatter(own), _scatter(pose.apply(own.mean(0)[None])[:, 0])


def carried(over: Float[Tensor, ""], moved: Float[Tensor, ""]) -> Float[Tensor, ""]:
    """Whether a body carries a point, 1 to 0, by their `scatters`."""
    return (2 * (1 - (over / moved).sqrt())).clamp(0, 1)


def _scatter(path: Float[Tensor, "N 3"]) -> Float[Tensor, ""]:
    """Variance of a path about its mean, square metres."""
    return (path - path.mean(0)).square().sum(-1).mean()
