"""Poses of an object in gaps of its track: one that a hand moves is moved by the palm there, too.

Trackers lose an object most often while a hand covers and moves it. On the straight line from the
last pose before a gap to the first one after it, the object is centimetres off, and in its frame
the hand seems to leave it and to come back, in all windows of the stages that see the gap.
"""

from collections.abc import Iterable
from dataclasses import replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import interpolate_rotations
from geneoh.objects.carrying import COMPARED_FRAMES, REST_DEVIATION, carried, scatters
from geneoh.objects.evidence import share_between
from geneoh.objects.examination import EXACT_ROTATION, EXACT_TRANSLATION
from geneoh.objects.palms import RigidMotion
from geneoh.objects.smoothing import smooth_points, smooth_rotations
from geneoh.sequence.gaps import observed_around
from geneoh.sequence.sequence import ObjectTrack
from geneoh.sequence.windows import runs

KEPT, CHANGED = 0.035, 0.05
"""Distance between the usual places of the object in the palm before and after a gap, metres: up to
the first bound the hand kept it, from the second on it was taken or put down in the gap. Of made
and scanned clips with noise, held objects have at most 0.032 and others 0.065 or more."""
NOISE_LEFT = 0.25
"""Deviation of a smoothed palm from the true one, in standard deviations of its noise."""


def held_in_gaps(motion: ObjectTrack, palms: Iterable[RigidMotion]) -> ObjectTrack:
    """The track with other poses in those gaps beside which a palm moves the object.

    `motion` has finite poses in all frames. They stay as they are in frames that are observed, and
    in gaps beside which no palm moves with the object.
    """
    gaps = [part for part in motion.seen_parts if not bool(motion.observed[:, part].all())]
    long = [palm for palm in palms if palm.is_long] if gaps else []
    if not long:
        return motion
    rotation, translation = motion.rotation.clone(), motion.translation.clone()
    for part in gaps:
        known = motion.observed[:, part]
        center = motion.meshes[part].center().to(rotation)
        turns = rotation[:, part]
        path = Rigid(turns.double(), (turns @ center + translation[:, part]).double())
        path = carried_path(path, known, long)
        turns = path.rotation.to(rotation)
        rotation[~known, part] = turns[~known]
        places = path.translation.to(rotation) - turns @ center
        translation[~known, part] = places[~known]
    return replace(motion, rotation=rotation, translation=translation)


def carried_path(path: Rigid, known: Bool[Tensor, " T"], palms: list[RigidMotion]) -> Rigid:
    """A path with gaps in which the object is carried by the palm that moves with it most."""
    every = [carried_by(palm, path, known) for palm in palms]
    share, best = torch.stack([share for _, share in every]).max(0)
    frames = torch.arange(len(share), device=share.device)
    turns, places = (
        torch.stack([getattr(held, name) for held, _ in every])[best, frames]
        for name in ("rotation", "translation")
    )
    turned = interpolate_rotations(path.rotation, turns, share)
    return Rigid(turned, path.translation.lerp(places, share[:, None]))


def carried_by(
    palm: RigidMotion, path: Rigid, known: Bool[Tensor, " T"]
) -> tuple[Rigid, Float[Tensor, " T"]]:
    """The path with gaps in which the object keeps its pose in a palm, or changes it evenly; and
    the extent to which the palm carries it in each frame, 0 to 1, by their motion beside a gap."""
    frame, between = smooth(palm, path.rotation.device), observed_around(known)
    own = frame.inverse().compose(path)
    turns, places = between.rotations(own.rotation[:, None])[:, 0], between.points(own.translation)
    held = frame.compose(Rigid(turns, places))
    share = torch.zeros_like(path.translation[:, 0])
    numbers = torch.arange(len(known), device=known.device)
    for gap in runs((~known).cpu().numpy()):
        ends = [end for end in (gap.start - 1, gap.stop) if 0 <= end < len(known)]
        beside = [known & ((numbers - end).abs() <= COMPARED_FRAMES) for end in ends]
        both = moves(frame, own, torch.stack(beside).any(0))
        first, last = (moves(frame, own, beside[end]).maximum(both) for end in (0, -1))
        usual = [own.translation[some].median(0).values for some in beside]
        kept = share_between((usual[-1] - usual[0]).norm(), KEPT, CHANGED)
        apart = (held.translation - path.translation)[gap].square().sum(-1).mean()
        seen = apart / (apart + (NOISE_LEFT * palm.place_noise()) ** 2).clip(1e-12)
        share[gap] = kept * seen * first.lerp(last, between.fraction[gap].to(first))
    return held, share


def moves(frame: Rigid, own: Rigid, chosen: Bool[Tensor, " T"]) -> Float[Tensor, ""]:
    """Whether a palm moves an object in the chosen frames, 0 to 1, by the palm's pose and that of
    the object in it; 0 if the palm rests."""
    over, moved = scatters(frame.at(chosen), own.translation[chosen])
    return torch.where(moved < REST_DEVIATION**2, 0.0, carried(over, moved))


def smooth(palm: RigidMotion, device: torch.device) -> Rigid:
    """The motion of a palm without white noise, on a device."""
    noise = (
        max(palm.turn_noise(), EXACT_ROTATION / 4),
        max(palm.place_noise(), EXACT_TRANSLATION / 4),
    )
    turns, _ = smooth_rotations(palm.turns, palm.seen, noise[0])
    places, _ = smooth_points(palm.places, palm.seen, noise[1])
    return Rigid(*(torch.from_numpy(x).to(device) for x in (turns.as_matrix(), places)))
