"""The rows of the table: baseline hands and generated hands on the bodies of real clips."""

from collections.abc import Sequence

import torch
from jaxtyping import Int
from torch import Tensor

from geneoh.body.motion import BodyMotion
from geneoh.body.skeleton import BODY_JOINTS
from geneoh.bundle import concatenated
from geneoh.evaluation.gestures.encoder import Seen
from geneoh.generators.both2hands.features import with_other_fingers
from geneoh.generators.both2hands.library import Both2HandsNetworks
from geneoh.generators.both2hands.sampling import Both2HandsSampling, Branch, sample_hands
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.progress import OnStep, steps
from geneoh.synthesis.gestures.clips import Gestures

BATCH = 16  # clips that are sampled together


def shuffled(real: Gestures, *, generator: torch.Generator) -> BodyMotion:
    """Every body with the hands of another clip."""
    order = torch.randperm(len(real.body), generator=generator)
    other = torch.empty_like(order)
    other[order] = order.roll(1)
    return _hands_of(real, real, other)


def mean_pose(real: Gestures, training: Gestures) -> BodyMotion:
    """Every body with the constant mean finger pose of the training clips."""
    mean = training.pose[training.before_end][:, BODY_JOINTS:].mean(0)
    fingers = axis_angle_to_matrix(mean).expand(*real.pose.shape[:2], -1, -1, -1)
    return with_other_fingers(real.motion, fingers)


def nearest_body(real: Gestures, training: Gestures, seen: tuple[Seen, Seen]) -> BodyMotion:
    """Every body with the hands of the training clip whose body motion is nearest.

    `seen` are the encoder inputs of both; body features are divided by their standard deviation.
    """
    scale = seen[1].body.flatten(0, 1).std(0).clamp(min=1e-3)
    own, known = ((each.body / scale).flatten(1) for each in seen)
    return _hands_of(real, training, torch.cdist(own, known).argmin(1))


def _hands_of(real: Gestures, source: Gestures, which: Int[Tensor, " B"]) -> BodyMotion:
    """The real bodies with the finger poses of clips `which` of `source`."""
    fingers = axis_angle_to_matrix(source.pose[which][:, :, BODY_JOINTS:])
    return with_other_fingers(real.motion, fingers)


def made_by_networks(
    networks: Both2HandsNetworks,
    real: Gestures,
    sentences: Sequence[str],
    branch: Branch,
    sampling_steps: int,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> BodyMotion:
    """Hands that the networks generate for the real bodies with one sentence each."""
    config = Both2HandsSampling(steps=sampling_steps, branch=branch)
    parts = []
    for start in steps(range(0, len(sentences), BATCH), on_step):
        some = real.take(slice(start, start + BATCH), "B")
        texts = sentences[start : start + BATCH]
        skeleton = some.skeleton
        parts.append(
            sample_hands(networks, some.motion, skeleton, texts, config, generator=generator)
        )
    return concatenated(parts, "B")
