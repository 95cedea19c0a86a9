"""The training loss of each stage, and the validation score."""

import math
from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.baselines.networks import RegressionDenoiser, TochAutoencoder
from geneoh.denoisers.base import NOISE_SCALE
from geneoh.denoisers.latent import LatentDenoiser
from geneoh.denoisers.motion import MotionDenoiser
from geneoh.denoisers.relations import RelationDenoiser
from geneoh.denoisers.spatial import SpatialDenoiser, SpatialEvidence
from geneoh.denoisers.temporal import TemporalDenoiser, TemporalEvidence
from geneoh.denoisers.trajectory import TrajectoryDenoiser
from geneoh.diffusion.precondition import loss_weight
from geneoh.diffusion.samplers import normal_like
from geneoh.fitting.align import align_to_steps
from geneoh.representation.spatial import decode_spatial, encode_spatial
from geneoh.representation.temporal import DISTANCE_DECAY, encode_temporal
from geneoh.representation.window_scale import WindowScale
from geneoh.sequence.normalisation import NETWORK_FPS
from geneoh.synthesis.draws import Draws
from geneoh.training.batches import Batch

MOTION_SIGMAS = (0.15, 8.0)
"""Range of the noise levels of MotionDiff in training, in units of the data's deviation."""
TRAJECTORY_SIGMAS, RELATION_SIGMAS, LATENT_SIGMAS = (0.05, 2.5), (0.04, 0.9), (0.02, 0.5)
"""The same for the stages in the paper's form."""
TRAJECTORY_START, RELATION_START, LATENT_START = 2.0, 0.7, 0.34
"""Noise levels at which these start at inference (levels 400, 200 and 100), and are validated."""
HIGH_NOISE_BIAS, TRAJECTORY_HIGH_NOISE_BIAS = 4.0, 2.0
"""Preference for high noise levels in training (`draw_sigma`) of MotionDiff, whose observation is
hard to use there, and of MotionDiff in the paper's form."""
KEYPOINT_UNIT = 0.02  # keypoint error that counts as much as a parameter error of one unit, metres
TRIALS = 32  # shifts per window at which SpatialDiff's density is evaluated in training
TRIAL_SPREAD = ((0.0, 0.04), (0.0, 0.015), (1.0, 0.006), (1.0, 0.02))
"""The mixture from which they are drawn: mean as a multiple of the true shift, and standard
deviation in metres."""
SHIFT_WIDTH = 0.004  # standard deviation of the target density, metres: accuracy of the truth
PLACE_ERROR, STEP_ERROR = 0.01, 0.002
"""Errors of a keypoint's position, and of its step between frames, with equal weight; metres."""
CONTACT_DECAY = 0.01  # decay length of the weight of steps with distance to the surface, metres
WEIGHT_FLOOR = 0.1  # added to an input's squared error in `window_weight`, bounds the weight


def draw_sigma(
    draws: Draws, limits: tuple[float, float], high_noise_bias: float = 1.0
) -> Float[Tensor, " B"]:
    """Noise levels in units of the data's deviation; log-uniform for a bias of 1, higher above."""
    low, high = (torch.tensor(x).log() for x in limits)
    share = draws.share() ** (1 / high_noise_bias)
    return torch.exp(low + (high - low) * share)


def window_weight(
    noisy: Float[Tensor, "B T 21 3"], clean: Float[Tensor, "B T 21 3"]
) -> Float[Tensor, " B"]:
    """Weight of each window's squared error: about one over the RMS error of its input.

    Without it, the remaining error of a good track would hardly matter.
    """
    error = (noisy - clean).square().mean((1, 2, 3)) / KEYPOINT_UNIT**2
    return 1 / (error + WEIGHT_FLOOR).sqrt()


def motion_loss(model: MotionDenoiser, batch: Batch, draws: Draws) -> Float[Tensor, ""]:
    """Weighted squared error of the predicted hand parameters, and of their keypoints.

    All noise levels have equal weight: an error at a high level stays until the end.
    """
    seen, clean = batch.motion, batch.clean_canon
    change = seen.hand.change_to(batch.hand)
    sigma = draw_sigma(draws, MOTION_SIGMAS, HIGH_NOISE_BIAS).to(change)
    noise = draws.like(change)
    predicted = model(change + sigma[:, None, None] * noise, sigma, seen)
    parameters = (predicted - change).square().mean((1, 2))
    error = seen.hand.moved(predicted).joints - clean
    keypoints = error.square().mean((1, 2, 3)) / KEYPOINT_UNIT**2
    return (window_weight(seen.joints, clean) * (0.5 * parameters + keypoints)).mean()


def trajectory_loss(model: TrajectoryDenoiser, batch: Batch, draws: Draws) -> Float[Tensor, ""]:
    """Weighted squared error of clean canonical keypoints (paper C.4; x0 form of its eps loss).

    Windows are scaled by the deviation of the noisy window, as at inference. The mean is that of
    the clean window, as in the paper, so that constant errors do not occur in training. High noise
    levels are drawn more often, because an error there stays until the end of a chain.
    """
    deviation = WindowScale.of(batch.observation.joints).deviation
    scale = WindowScale(WindowScale.of(batch.clean_canon).mean, deviation)
    clean = scale.normalised(batch.clean_canon)
    sigma = draw_sigma(draws, TRAJECTORY_SIGMAS, TRAJECTORY_HIGH_NOISE_BIAS).to(clean)
    noise = draws.like(clean)
    noisy = clean + sigma[:, None, None, None] * noise
    predicted = model(noisy, sigma, scale.deviation.flatten())
    weight = loss_weight(sigma)
    return (weight * (predicted - clean).square().mean((1, 2, 3))).mean()


def relation_loss(model: RelationDenoiser, batch: Batch, draws: Draws) -> Float[Tensor, ""]:
    """Squared error of the hand predicted at each contact point, and of their mean (eq. 8).

    Each point has its own noise, in units of the deviation of the noisy window, as at inference.
    """
    scale = WindowScale.of(batch.observation.joints[:, :, None])
    relations = encode_spatial(batch.clean_canon, batch.region)
    sigma = draw_sigma(draws, RELATION_SIGMAS).to(relations.hands)
    noise = draws.like(relations.hands)
    noise = noise * (sigma[:, None, None, None, None] * scale.deviation)
    predicted = model(replace(relations, hands=relations.hands + noise), sigma, scale)
    weight = loss_weight(sigma) / scale.deviation.flatten().square()
    each = (predicted.hands - relations.hands).square().mean((1, 2, 3, 4))
    together = (decode_spatial(predicted) - batch.clean_canon).square().mean((1, 2, 3))
    return (weight * (0.5 * each + 0.5 * together)).mean()


def spatial_loss(model: SpatialDenoiser, batch: Batch, draws: Draws) -> Float[Tensor, ""]:
    """Kullback-Leibler divergence KL(target || model) of densities of the hand's shift.

    The target is narrow around the true shift. Both densities are normalised over `TRIALS` shifts
    drawn from a mixture, by importance weights.
    """
    evidence, shift = _spatial_question(batch)
    phase = float(torch.rand((), generator=draws.generator))
    evidence = evidence.spread_over(model.config.frames, phase=phase)
    spread = shift.new_tensor(TRIAL_SPREAD)
    around, width = spread[torch.arange(TRIALS) % len(spread)].unbind(-1)
    noise = draws.like(shift[:, None].expand(-1, TRIALS, -1))
    places = around[:, None] * shift[:, None] + width[:, None] * noise
    drawn = torch.stack(
        [_log_normal(places, share * shift[:, None], float(std)) for share, std in spread]
    ).logsumexp(0)
    wanted = (_log_normal(places, shift[:, None], SHIFT_WIDTH) - drawn).softmax(1)
    density = (model(places, evidence) - drawn).clamp(min=-1e4).log_softmax(1)
    return (wanted * (wanted.clamp(min=1e-12).log() - density)).sum(1).mean()


def _spatial_question(batch: Batch) -> tuple[SpatialEvidence, Float[Tensor, "B 3"]]:
    """Input of SpatialDiff, and the true shift: mean error over keypoints and frames, metres."""
    return batch.evidence, (batch.clean - batch.evidence.joints).mean((1, 2))


def _log_normal(
    x: Float[Tensor, "*B 3"], mean: Float[Tensor, "*#B 3"], std: float
) -> Float[Tensor, "*B"]:
    """Log density of an isotropic normal distribution, without its constant."""
    return -0.5 * ((x - mean) / std).square().sum(-1) - 3 * math.log(std)


def temporal_loss(model: TemporalDenoiser, batch: Batch, draws: Draws) -> Float[Tensor, ""]:
    """Error of the aligned hand's steps, with more weight near the surface, and of its positions.

    A shift of the whole window does not count, since SpatialDiff corrects it. Errors are not
    squared: where a finger either holds or slides, the likelier is right, not the mean of both.
    """
    del draws  # draws nothing; the signature is shared by all losses
    seen, clean, moved = _temporal_question(model, batch)
    error = moved - clean
    steps = error.diff(dim=1).norm(dim=-1) / STEP_ERROR
    near = torch.exp(-(seen.nearest - seen.joints).norm(dim=-1) / CONTACT_DECAY)[:, 1:]
    places = (error - error.mean((1, 2), keepdim=True)).norm(dim=-1) / PLACE_ERROR
    return ((0.5 + near) * steps).mean() + places.mean()


def _temporal_question(
    model: TemporalDenoiser, batch: Batch
) -> tuple[TemporalEvidence, Float[Tensor, "B T 21 3"], Float[Tensor, "B T 21 3"]]:
    """Input of TemporalDiff, the clean hand, and the aligned hand, in the object's frame."""
    seen = batch.steps
    answer = model(seen)
    shift = align_to_steps(answer.change, answer.steps, answer.places)
    return seen, seen.from_world(batch.clean), seen.joints + shift


def reconstruction_loss(model: LatentDenoiser, batch: Batch, draws: Draws) -> Float[Tensor, ""]:
    """Reconstruction error of the relations T of clean and noisy hands, weighted by closeness."""
    del draws  # draws nothing; the signature is shared by all losses
    points, total = batch.region.points_canon[:, :-1], batch.clean.new_zeros(())
    for joints in (batch.clean, batch.noisy):
        relations = encode_temporal(joints, batch.region, NETWORK_FPS)
        around = relations.object_velocity, relations.normals, points
        decoded = model.autoencoder.decode(model.autoencoder.encode(relations, points), *around)
        near = torch.exp(-0.5 * DISTANCE_DECAY * relations.distance) + 0.05
        speed = relations.velocity.norm(dim=-1) + 0.1
        total = total + (near * ((decoded.distance - relations.distance) / 0.01).square()).mean()
        total = total + ((decoded.tangential - relations.tangential).abs() / 0.05).mean()
        total = total + ((decoded.normal - relations.normal).abs() / 0.05).mean()
        error = (decoded.velocity - relations.velocity).norm(dim=-1)
        total = total + (near * error / speed).mean()
    return total


def latent_loss(model: LatentDenoiser, batch: Batch, draws: Draws) -> Float[Tensor, ""]:
    """Weighted squared error of the predicted clean latent; the autoencoder is frozen."""
    clean = temporal_latent(model, batch, batch.clean)
    sigma = draw_sigma(draws, LATENT_SIGMAS).to(clean)
    noise = draws.like(clean)
    predicted = model(clean + sigma[:, None, None] * noise, sigma)
    weight = loss_weight(sigma)
    return (weight * (predicted - clean).square().mean((1, 2))).mean()


@torch.no_grad()
def temporal_latent(
    model: LatentDenoiser, batch: Batch, joints: Float[Tensor, "B T 21 3"]
) -> Float[Tensor, "B T1 Z"]:
    """The latent of a hand (`joints` in the world frame) at the contact points of a batch."""
    points = batch.region.points_canon[:, :-1]
    return model.autoencoder.encode(encode_temporal(joints, batch.region, NETWORK_FPS), points)


def keypoint_loss(
    model: TochAutoencoder | RegressionDenoiser, batch: Batch, draws: Draws
) -> Float[Tensor, ""]:
    """Mean distance of the predicted keypoints to the clean ones, in units of `NOISE_SCALE`."""
    del draws  # draws nothing; the signature is shared by all losses
    observation = batch.observation
    predicted = model(observation, encode_spatial(observation.joints, batch.region))
    return (predicted - batch.clean_canon).norm(dim=-1).mean() / NOISE_SCALE


@torch.no_grad()
def recovered_fraction(
    model: nn.Module, batch: Batch, *, generator: torch.Generator
) -> Float[Tensor, ""]:
    """Validation score: mean error after one call of the network, over that of its input.

    Diffusion networks start at a fixed noise level. Errors are of keypoints, of shifts of the hand
    (spatial), of its steps between frames (temporal), or of latents.
    """
    noisy, clean = batch.observation.joints, batch.clean_canon
    one = noisy.new_ones(len(noisy))
    match model:
        case MotionDenoiser():
            hand = batch.motion.hand
            change = torch.zeros_like(hand.change_to(hand))
            start = MOTION_SIGMAS[1]
            noise = start * normal_like(change, generator=generator)
            got = hand.moved(model(change + noise, start * one, batch.motion)).joints
            noisy = hand.joints
        case TrajectoryDenoiser():
            scale, start = WindowScale.of(noisy), TRAJECTORY_START
            noise = start * normal_like(noisy, generator=generator)
            noisy_window = scale.normalised(noisy) + noise
            got = scale.metres(model(noisy_window, start * one, scale.deviation.flatten()))
        case SpatialDenoiser():
            evidence, clean = _spatial_question(batch)
            noisy = torch.zeros_like(clean)
            axes = torch.eye(3).to(clean)
            got = model.posterior(evidence, axes, rounds=4, places=48, generator=generator).mean
        case RelationDenoiser():
            relations = encode_spatial(noisy, batch.region)
            scale = WindowScale.of(relations.hands)
            noise = RELATION_START * scale.deviation
            noise = noise * normal_like(relations.hands, generator=generator)
            hands = replace(relations, hands=relations.hands + noise)
            got = decode_spatial(model(hands, RELATION_START * one, scale))
        case TemporalDenoiser():
            seen, clean, got = _temporal_question(model, batch)
            clean, got, noisy = (hand.diff(dim=1) for hand in (clean, got, seen.joints))
        case LatentDenoiser():
            clean, noisy = (
                temporal_latent(model, batch, hand) for hand in (batch.clean, batch.noisy)
            )
            noise = LATENT_START * normal_like(noisy, generator=generator)
            got = model(noisy + noise, LATENT_START * one)
        case TochAutoencoder() | RegressionDenoiser():
            got = model(batch.observation, encode_spatial(noisy, batch.region))
        case _:
            raise AssertionError(f"no denoiser: {type(model).__name__}")
    return (got - clean).norm(dim=-1).mean() / (noisy - clean).norm(dim=-1).mean()
