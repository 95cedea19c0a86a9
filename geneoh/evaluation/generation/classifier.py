"""The action classifier whose features and scores evaluate generated clips.

Text2HOI released no classifier, so scores with ours cannot be compared with the paper's. Ours reads
15 frames spread over a clip, as its code does: both hands' keypoints in the world and the object's
frame, and the object's pose. It is trained on real clips that are not scored.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.seeds import seeded_generator
from geneoh.synthesis.actions.action import VERBS, Actions
from geneoh.training.processes import Team
from geneoh.training.resume import digest
from geneoh.training.run_config import RunConfig
from geneoh.training.tasks import Task, first_weights

FRAMES_READ = 15  # frames of a clip in the input (the paper's code)
PER_METRE = 5.0  # factor of positions, 1/m, by which inputs are of order one
POINTS = 2 * 2 * 21 + 3  # keypoints in both frames, the object's position, two of its axes
INPUTS = 3 * POINTS + 3  # features per frame; the last are the joint and the mask of hands
SOFTENED = 0.1  # label smoothing, so that scores stay bounded
VALIDATED = 256  # largest number of validation clips in training


@dataclass(frozen=True)
class ClassifierConfig(RunConfig):
    """The training configuration of the classifier; saved with it."""

    steps: int = 1200
    batch: int = 64
    rate: float = 1e-3
    warmup: int = 50
    decay: float = 0.5
    ema: float = 0.99
    validate_every: int = 400
    checkpoint_every: int = 400
    validation_batches: int = 1
    width: int = 128
    features: int = 32  # length of a clip's feature vector


class ActionClassifier(nn.Module):
    """Convolutions over time, mean and max pooling, a feature vector, and a score per verb."""

    def __init__(self, config: ClassifierConfig, verbs: int = len(VERBS)):
        super().__init__()
        width = config.width
        self.enter = nn.Sequential(nn.Linear(INPUTS, width), nn.LayerNorm(width), nn.GELU())
        self.mix = nn.ModuleList(nn.Conv1d(width, width, 3, padding=1) for _ in range(3))
        # normalised features, so that distances do not grow during training
        length = nn.LayerNorm(config.features, elementwise_affine=False)
        self.feature = nn.Sequential(nn.Linear(2 * width, config.features), length)
        self.answer = nn.Linear(config.features, verbs)

    def features(self, inputs: Float[Tensor, "B S D"]) -> Float[Tensor, "B F"]:
        """Feature vectors of clips."""
        mixed = self.enter(inputs).mT
        for layer in self.mix:
            mixed = mixed + nn.functional.gelu(layer(mixed))
        pooled = torch.cat([mixed.mean(-1), mixed.amax(-1)], -1)
        return self.feature(pooled)

    def forward(self, inputs: Float[Tensor, "B S D"]) -> Float[Tensor, "B C"]:
        """A score for each verb."""
        return self.answer_to(self.features(inputs))

    def answer_to(self, features: Float[Tensor, "B F"]) -> Float[Tensor, "B C"]:
        """A score for each verb from the features."""
        return self.answer(nn.functional.gelu(features))


@dataclass(frozen=True)
class LabelledClips:
    """A training batch of the classifier."""

    inputs: Float[Tensor, "B S D"]
    verb: Int[Tensor, " B"]

    def loss(self, model: ActionClassifier) -> Tensor:
        """Cross entropy with smoothed labels."""
        return nn.functional.cross_entropy(model(self.inputs), self.verb, label_smoothing=SOFTENED)


@dataclass(frozen=True)
class ClassifierTask(Task):
    """Training of the classifier on real clips."""

    config: ClassifierConfig
    clips: Actions
    validation: Actions
    verbs: int = len(VERBS)  # number of verbs
    name: str = "actions"

    def network(self) -> nn.Module:
        """A new network, initialised from the config's seed."""
        with first_weights(self.config.seed, self.name, "weights"):
            return ActionClassifier(self.config, self.verbs)

    def pieces(self, step: int, team: Team, device: torch.device) -> Sequence[LabelledClips]:
        """Random clips, rotated about the vertical, with a random frame of each of 15 intervals."""
        generator = seeded_generator(self.config.seed, "step", step)
        count = self.config.batch
        chosen = torch.randint(len(self.clips.verb), (count,), generator=generator)
        clips = self.clips.take(chosen, "B")
        share = torch.rand(count, FRAMES_READ, generator=generator)
        angle = 2 * math.pi * torch.rand(count, generator=generator)
        turn = axis_angle_to_matrix(angle[:, None] * torch.eye(3)[2])
        inputs = inputs_of(clips, frames_within(clips.length, share), turn)
        return [LabelledClips(inputs.to(device), clips.verb.to(device))]

    @torch.no_grad()
    def validate(self, model: ActionClassifier, index: int) -> Float[Tensor, ""]:
        """Share of misclassified validation clips, whose objects are held out."""
        clips = self.validation.take(slice(VALIDATED), "B")
        wrong = model(clip_inputs(clips)).argmax(-1) != clips.verb
        return wrong.double().mean()

    def learned_from(self) -> dict[str, Any]:
        """The number and fingerprints of the clips."""
        return {
            "clips": len(self.clips.verb),
            "data": _data_digest(self.clips),
            "validation": _data_digest(self.validation),
        }


def _data_digest(clips: Actions) -> str:
    """A fingerprint of clips by their verbs and the first position of each wrist."""
    return digest([clips.verb, clips.wrist[:, :, 0]])


@torch.no_grad()
def classified(
    model: ActionClassifier, clips: Actions
) -> tuple[Float[Tensor, "N F"], Float[Tensor, "N C"]]:
    """Features of clips, and a score for each verb."""
    features = model.features(clip_inputs(clips))
    return features, model.answer_to(features)


def clip_inputs(clips: Actions) -> Float[Tensor, "B S D"]:
    """Input of the classifier for clips: evenly spaced frames from the first to the last."""
    return inputs_of(clips, even_frames(clips.length, FRAMES_READ))


def even_frames(length: Int[Tensor, " B"], count: int) -> Int[Tensor, "B S"]:
    """Evenly spaced frames of clips, from the first to the last."""
    share = torch.arange(count) / (count - 1)
    return (share * (length[:, None] - 1)).round().long()


def frames_within(length: Int[Tensor, " B"], share: Float[Tensor, "B S"]) -> Int[Tensor, "B S"]:
    """One frame from each of S equal intervals of a clip, at a `share` (0 to 1) of the interval."""
    groups = torch.arange(share.shape[1]) + share
    frames = (groups / share.shape[1] * length[:, None]).long()
    return frames.minimum(length[:, None] - 1)  # a share close to 1 may round up


def inputs_of(
    clips: Actions, frames: Int[Tensor, "B S"], turn: Float[Tensor, "B 3 3"] | None = None
) -> Float[Tensor, "B S D"]:
    """Input of the classifier for some frames of clips.

    World positions are relative to the point of the table below the object in the first of these
    frames. Absent hands are zero. `turn` rotates the world about the vertical.
    """
    clips = clips.at_frames(frames)
    start = clips.translation[:, :1] * torch.tensor([1.0, 1.0, 0.0])
    joints = clips.keypoints().transpose(1, 2).flatten(2, 3)
    local = (joints - clips.translation[:, :, None]) @ clips.rotation
    axes = clips.rotation.mT[:, :, :2] / PER_METRE
    world = torch.cat([joints, clips.translation[:, :, None]], 2) - start[:, :, None]
    if turn is not None:
        world, axes = world @ turn[:, None].mT, axes @ turn[:, None].mT
    absent = ~clips.hands.repeat_interleave(21, 1)[:, None, :, None]
    hands = [each.masked_fill(absent, 0.0) for each in (world[:, :, :-1], local)]
    points = PER_METRE * torch.cat([*hands, world[:, :, -1:], axes], 2).flatten(2)
    seen = clips.hands[:, None].expand(-1, frames.shape[1], -1).to(points)
    joint = clips.joint * clips.joint_units
    return torch.cat([points, joint[..., None], seen], -1)
