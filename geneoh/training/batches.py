"""Training batches: random windows of interactions, corrupted, and in the canonical frame."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.baselines.networks import Observation
from geneoh.bundle import Bundle
from geneoh.denoisers.motion import MotionDenoiser, ObservedMotion
from geneoh.denoisers.spatial import SpatialEvidence, track_cues
from geneoh.denoisers.temporal import TemporalEvidence
from geneoh.diffusion.samplers import ddim, reverse_process
from geneoh.diffusion.schedule import descending_sigmas
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.parameters import HandParameters
from geneoh.representation.region import ContactRegion
from geneoh.streamed import Streamed
from geneoh.synthesis.draws import Draws, Part
from geneoh.synthesis.motions.motion import Interactions
from geneoh.training.augmentation import augmented, with_kept_contact
from geneoh.training.config import TrainConfig
from geneoh.training.corruption import draw_corruption
from geneoh.training.windows import draw_windows, filled


@dataclass(frozen=True)
class Batch(Bundle):
    """Clean and noisy hands in B windows of T frames, and the inputs of the networks."""

    clean: Float[Tensor, "B T 21 3"]  # world frame, metres
    noisy: Float[Tensor, "B T 21 3"]  # world frame, gaps filled; after MotionDiff if there is one
    observed: Float[Tensor, "B T 21 3"]  # before MotionDiff, gaps filled, world frame
    region: ContactRegion  # contact points of `noisy` and their canonical frame
    observation: Observation  # the noisy hand in the canonical frame of `region`

    hand: HandParameters  # the clean hand's parameters in the canonical frame of `region`
    motion: ObservedMotion  # input of MotionDiff, in the canonical frame of the observed hand
    evidence: SpatialEvidence  # input of SpatialDiff

    @property
    def clean_canon(self) -> Float[Tensor, "B T 21 3"]:
        """Clean keypoints in the canonical frame."""
        return self.region.to_canon(self.clean)

    @property
    def steps(self) -> TemporalEvidence:
        """Input of TemporalDiff: the motion of the noisy hand over the surface."""
        return TemporalEvidence.at(
            self.evidence, self.noisy, self.observed, self.observation.trust.mean(-1)
        )


def draw_batch(
    data: Streamed[Interactions],
    size: int,
    config: TrainConfig,
    *,
    generator: torch.Generator,
    motion_denoiser: MotionDenoiser | None = None,
    part: Part | None = None,
    device: torch.device | None = None,
) -> Batch:
    """A batch of `size` random windows, or the `part` of it, on a device.

    Random numbers are drawn on the CPU, the same for every device; nearest surface points are
    computed on the device. With `motion_denoiser`, noisy hands are first denoised by it.
    """
    draws = Draws(size if part is None else part.count, generator, part)
    windows = draw_windows(data, config.windows, draws)
    clean = augmented(windows.hand, draws, config.augmentation)
    frames = clean.wrist.shape[1]
    noise = draw_corruption(frames, draws, config.corruption)
    turn = axis_angle_to_matrix(3.0 * draws.normal(3))
    if device is not None:
        windows, clean = windows.to(device), clean.to(device)
        noise, turn = noise.to(device), turn.to(device)
    contact = config.augmentation.contact
    if contact.share:  # otherwise nothing is drawn, so that older seeds give the same batches
        kept = draws.chance(contact.share).to(clean.wrist.device)
        clean = with_kept_contact(clean, windows.hand, windows, contact, kept)
    windows = windows.shaken(noise.object_turn, noise.object_shift)
    noisy = filled(noise.tracked(clean), noise.keep)
    observed = joints = noisy.joints + noise.jitter
    region = windows.region(joints).turned(turn)
    motion = windows.observed(noisy, noise.keep, region)
    change, left = motion.hand.wrist.new_zeros(draws.batch, frames, 51), noisy
    if motion_denoiser is not None:
        change = after_motion(motion, motion_denoiser, config, draws)
        left = motion.hand.moved(change).to_world(region)
        joints = left.joints
        region = windows.region(joints).turned(turn)
    cues = track_cues(motion.hand, change, motion.trust, noise.object_noise)
    evidence = SpatialEvidence.around(windows, left.joints, noise.ray, cues)
    trust = noise.keep[..., None].expand(-1, -1, 21).float()
    observation = Observation(region.to_canon(joints), trust)
    hand = clean.to_canon(region)
    return Batch(clean.joints, joints, observed, region, observation, hand, motion, evidence)


@torch.no_grad()
def after_motion(
    observed: ObservedMotion, model: MotionDenoiser, config: TrainConfig, draws: Draws
) -> Float[Tensor, "B T 51"]:
    """MotionDiff's change of the observed hand by few steps; units of `UNIT`, canonical axes."""
    device = next(model.parameters()).device
    there = observed.to(device)

    def clean(x: Tensor, sigma: float) -> Tensor:
        level = x.new_full((len(x),), sigma).to(device)
        return model(x.to(device), level, there).to(x)

    sigmas = descending_sigmas(config.motion_level, config.motion_steps)
    noise = draws.normal(observed.trust.shape[1], 51).to(observed.hand.wrist)
    return reverse_process(clean, sigmas[0] * noise, sigmas, ddim)
