"""What carries a hand through the frames in which it is not seen: the part that it holds."""

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.distance import MovingSurface
from geneoh.objects.evidence import distance_of_nearest, share_between
from geneoh.sequence.gaps import Carrier, filled_keypoints
from geneoh.sequence.sequence import HandTrack

HELD, FREE = 0.015, 0.03
"""Distance in metres between surface and nearest keypoint beside a gap: up to the first the hand
holds what is there, from the second on it does not. Keypoints lie 10 mm inside the hand."""


def carrier_of(
    hand: HandTrack, surface: MovingSurface, relied: Float[Tensor, "T Q"]
) -> Carrier | None:
    """The part of the object that the hand is nearest to beside its gaps, and how surely it holds
    it there: by the distance of the nearest keypoint, and how far the part's poses are relied on.

    None where the hand is seen in all frames.
    """
    seen = hand.observed
    lost = torch.nn.functional.pad(~seen, (1, 1))
    beside = torch.nonzero(seen & (lost[:-2] | lost[2:]))[:, 0]
    if len(beside) == 0:
        return None
    points, there = filled_keypoints(hand)[beside], surface.at(beside)
    away = torch.stack(
        [distance_of_nearest(points, there.of_parts([p])) for p in range(len(surface.fields))], 1
    )
    part = int(away.mean(0).argmin())
    share = torch.zeros_like(relied[:, part])
    held = share_between(away[:, part], HELD, FREE).to(share)
    share[beside] = held * relied[beside, part]
    _, pose = list(surface.parts)[part]
    return Carrier(pose, share)
