"""From a moving body and a sentence to two hands: BOTH2Hands as a whole (paper, figure 3)."""

import torch

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import BODY_JOINTS, Skeleton
from geneoh.choices import STEPS
from geneoh.generators.both2hands.features import with_other_fingers
from geneoh.generators.both2hands.library import Networks, load_networks
from geneoh.generators.both2hands.limits import within_limits
from geneoh.generators.both2hands.sampling import SamplingConfig, sample
from geneoh.progress import OnStep


def generate_hands(
    motion: BodyMotion,
    skeleton: Skeleton,
    sentence: str,
    *,
    steps: int = STEPS,
    generator: torch.Generator,
    networks: Networks | None = None,
    on_step: OnStep | None = None,
) -> BodyMotion:
    """A body with fingers that fit its motion and a sentence, inside the limits of a hand.

    Args:
        motion: T frames of one body at 30 frames a second, any T; its fingers do not matter.
        skeleton: of the body.
        sentence: such as "the right hand waves, the left rests"; see `check_sentence`.
        steps: denoising steps (paper: 1,000).
        generator: of the noise; another one makes other hands.
        networks: None for the shipped ones.
        on_step: told of the steps.

    Raises:
        CheckpointError: weights are missing or damaged.
    """
    made = sample(
        networks or load_networks(device=motion.root.device),
        BodyMotion(motion.root[None], motion.rotations[None]),
        skeleton,
        [sentence],
        SamplingConfig(steps=steps),
        generator=generator,
        on_step=on_step,
    )
    made = BodyMotion(made.root[0], made.rotations[0])
    return with_other_fingers(made, within_limits(made.rotations[:, BODY_JOINTS:]))
