"""Keypoints that agree with denoised temporal relations (paper eq. 9)."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import pad

from geneoh.fitting.solve import solve_chains
from geneoh.nn.adam import adam
from geneoh.representation.region import ContactRegion
from geneoh.representation.temporal import PairStatistics, encode_temporal

PAIR_DECAY = 100.0
"""Decay of a pair's weight with its target distance, 1/m; the paper states no weights."""
STEP_STD = 0.0015
"""Deviation of a step of usual weight from the clean one, metres a frame."""
PLACE_STD = 0.008
"""Deviation of a keypoint of usual weight from its clean place, metres."""
AT_ONCE = 2**17
"""Places that are solved for together: memory does not grow with the track."""


def align_to_steps(
    change: Float[Tensor, "*B T J 3"],
    steps: Float[Tensor, "*B T J"],
    places: Float[Tensor, "*B T J"],
) -> Float[Tensor, "*B T J 3"]:
    """Shift of each of J keypoints that changes its steps as asked and itself little, metres.

    The least squares are solved exactly, for each keypoint by itself. Units, frame and weights are
    those of `geneoh.denoisers.temporal.StepCorrection`; the last frame's step is not looked at.
    """
    size = max(1, AT_ONCE * steps.shape[-1] // steps.numel())
    some = (change.split(size, -2), steps.split(size, -1), places.split(size, -1))
    return torch.cat([_aligned_to_steps(*each) for each in zip(*some, strict=True)], dim=-2)


def _aligned_to_steps(
    change: Float[Tensor, "*B T J 3"],
    steps: Float[Tensor, "*B T J"],
    places: Float[Tensor, "*B T J"],
) -> Float[Tensor, "*B T J 3"]:
    # where steps are sure, and places are not, single precision would leave a tenth of the change
    hold = steps[..., :-1, :].double().exp().mT / STEP_STD**2
    stay = places.double().exp().mT / PLACE_STD**2
    pull = hold[..., None] * change[..., :-1, :, :].movedim(-2, -3)
    around = pad(hold, (1, 0)) + pad(hold, (0, 1))
    pulled = pad(pull, (0, 0, 1, 0)) - pad(pull, (0, 0, 0, 1))
    return solve_chains(stay + around, -hold, pulled).movedim(-2, -3).to(change)


@dataclass(frozen=True)
class AlignConfig:
    """Settings of Adam, and the deviations that weight the statistics; the paper states none."""

    steps: int = 100
    rate: float = 1.5e-3
    """Length of Adam's first step in metres; it decays to zero."""
    distance_std: float = 0.005
    """Deviation of decoded distances from true ones near contact, on made clips, metres."""
    speed_std: float = 0.1
    """The same of decoded velocities, m/s."""
    stay_std: float = 0.003
    """Deviation of keypoints from the previous stage's, metres."""


def align_to_relations(
    joints: Float[Tensor, "B T 21 3"],
    region: ContactRegion,
    target: PairStatistics,
    fps: float,
    *,
    config: AlignConfig,
) -> Float[Tensor, "B T 21 3"]:
    """World keypoints near `joints` whose relations are near `target` on d, v_ho and both e.

    Windows are independent: the optimum of each is the same in any batch.
    """
    weight = torch.exp(-PAIR_DECAY * target.distance)
    share = weight / weight.sum((1, 2, 3), keepdim=True).clamp(min=1e-6)

    # in the canonical frame, because Adam's steps depend on the axes
    start = region.to_canon(joints)

    def loss(parameters: list[Tensor]) -> Tensor:
        (moved,) = parameters
        now = encode_temporal(region.to_world(moved), region, fps)
        miss = ((now.distance - target.distance) / config.distance_std).square()
        miss = miss + ((now.velocity - target.velocity) / config.speed_std).square().sum(-1)
        miss = miss + ((now.tangential - target.tangential) / config.speed_std).square()
        miss = miss + ((now.normal - target.normal) / config.speed_std).square()
        stay = ((moved - start) / config.stay_std).square().sum(-1).mean((1, 2))
        return ((share * miss).sum((1, 2, 3)) + stay).sum()

    # Adam takes full steps on gradients of rounding size and would shake a hand that agrees: steps
    # shrink below the gradient of a keypoint that is half a `stay_std` from its place
    floor = 1 / (config.stay_std * joints.shape[1] * joints.shape[2])
    (moved,) = adam(
        loss,
        [start],
        steps=config.steps,
        rate=lambda done: [config.rate * (1 - done / config.steps)],
        epsilon=floor,
    )
    return region.to_world(moved)
