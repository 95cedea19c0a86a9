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
"""Standard deviation of a displacement between frames at log weight 0, metres."""
PLACE_STD = 0.008
"""Standard deviation of a keypoint position at log weight 0, metres."""
MOST_POSITIONS = 2**17
"""Positions that are solved for in one batch, which bounds the memory."""


def align_to_steps(
    change: Float[Tensor, "*B T J 3"],
    steps: Float[Tensor, "*B T J"],
    places: Float[Tensor, "*B T J"],
) -> Float[Tensor, "*B T J 3"]:
    """Correction of J keypoints: nearly the predicted `change` of each displacement between frames,
    with a small correction itself, metres.

    The least squares are solved exactly, independently for each keypoint. `change` and the log
    weights `steps` and `places` are those of `geneoh.denoisers.temporal.StepCorrection`; entries
    of the last frame in `change` and `steps` are ignored.
    """
    size = max(1, MOST_POSITIONS * steps.shape[-1] // steps.numel())
    some = (change.split(size, -2), steps.split(size, -1), places.split(size, -1))
    return torch.cat([_aligned_to_steps(*each) for each in zip(*some, strict=True)], dim=-2)


def _aligned_to_steps(
    change: Float[Tensor, "*B T J 3"],
    steps: Float[Tensor, "*B T J"],
    places: Float[Tensor, "*B T J"],
) -> Float[Tensor, "*B T J 3"]:
    # float32 is too imprecise where step weights are large and place weights small
    hold = steps[..., :-1, :].double().exp().mT / STEP_STD**2
    stay = places.double().exp().mT / PLACE_STD**2
    pull = hold[..., None] * change[..., :-1, :, :].movedim(-2, -3)
    around = pad(hold, (1, 0)) + pad(hold, (0, 1))
    pulled = pad(pull, (0, 0, 1, 0)) - pad(pull, (0, 0, 0, 1))
    return solve_chains(stay + around, -hold, pulled).movedim(-2, -3).to(change)


@dataclass(frozen=True)
class AlignConfig:
    """Adam settings and standard deviations of the relations; the paper states none."""

    steps: int = 100
    rate: float = 1.5e-3
    """Length of Adam's first step in metres; it decays to zero."""
    distance_std: float = 0.005
    """Standard deviation of decoded distances near contact, on synthetic clips, metres."""
    speed_std: float = 0.1
    """Standard deviation of decoded velocities near contact, on synthetic clips, m/s."""
    stay_std: float = 0.003
    """Standard deviation of keypoints from those of the previous stage, metres."""


def align_to_relations(
    joints: Float[Tensor, "B T 21 3"],
    region: ContactRegion,
    target: PairStatistics,
    fps: float,
    *,
    config: AlignConfig,
) -> Float[Tensor, "B T 21 3"]:
    """World keypoints near `joints` whose relations d, v_ho and both e are near `target`.

    Windows are independent: the result for each is the same in any batch.
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

    # Adam takes full steps even on gradients of rounding size, which would add jitter at the
    # optimum: epsilon is the gradient of a keypoint half a `stay_std` from its start
    floor = 1 / (config.stay_std * joints.shape[1] * joints.shape[2])
    (moved,) = adam(
        loss,
        [start],
        steps=config.steps,
        rate=lambda done: [config.rate * (1 - done / config.steps)],
        epsilon=floor,
    )
    return region.to_world(moved)
