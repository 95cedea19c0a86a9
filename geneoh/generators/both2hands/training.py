"""The networks of BOTH2Hands as tasks of the training loop, and the settings of these."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal

import torch
from jaxtyping import Bool, Float, Int
from tokenizers import Tokenizer
from torch import Tensor, nn
from torch.nn import functional

from geneoh.bundle import Bundle, concatenated
from geneoh.choices import BODY_STAGES, BodyStage
from geneoh.generators.both2hands.features import (
    HandsFrame,
    PlacedBodies,
    Scale,
    hand_features,
    placed,
)
from geneoh.generators.both2hands.library import Branches, Speech
from geneoh.generators.both2hands.networks import (
    BlendConfig,
    Blender,
    BodyHands,
    HandsConfig,
    HandsDenoiser,
    TextHands,
    TextHandsConfig,
)
from geneoh.seeds import seeded_generator
from geneoh.synthesis.draws import Draws, Part
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.training.data import TrainingData
from geneoh.training.resume import digest
from geneoh.training.run_config import RunConfig
from geneoh.training.tasks import DrawnSamples, SamplesTask, first_weights

MOST_FITTED = 256  # largest number of clips that the scale of features is fitted to
CHUNK = 64  # clips whose features are computed at once


@dataclass(frozen=True)
class Both2HandsConfig(RunConfig):
    """The training of one network; every value is saved with the weights."""

    READ_BY: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **{stage: (stage,) for stage in BODY_STAGES},
        **{"gestures": ("text_hands",), "target": ("blend",)},
    }

    steps: int = 800
    batch: int = 16
    rate: float = 2e-3
    warmup: int = 30
    decay: float = 0.6
    ema: float = 0.995
    error: Literal["squared", "absolute"] = "squared"
    """Error that the loss averages: squared, whose best prediction is the mean; or absolute
    (paper)."""
    velocity: float = 1.0  # weight of this error for differences between frames (paper: 0)
    gestures: float = 0.3
    """Weight of the cross-entropy of each hand's gesture, which teaches words sooner than the hands
    do (paper: 0); only labelled clips count."""
    target: Literal["hands", "mean"] = "hands"
    """Target of blended hands: the true ones, so that the sentence counts wherever it tells more
    than the body; or the weighted mean of both predictions (paper)."""
    body_hands: HandsConfig = field(default_factory=HandsConfig)
    text_hands: TextHandsConfig = field(default_factory=TextHandsConfig)
    blend: BlendConfig = field(default_factory=BlendConfig)


@dataclass(frozen=True)
class Features(Bundle):
    """Features of bodies and true hands; stored in half precision until they are drawn."""

    body: Float[Tensor, "B T 198"]
    hands: Float[Tensor, "B T 270"]

    @staticmethod
    def of(scene: PlacedBodies, frame: HandsFrame) -> "Features":
        """The features of a scene."""
        return Features(scene.body, hand_features(scene.posed, frame))


@dataclass(frozen=True)
class GestureSamples(Bundle):
    """A batch of clips with one sentence each."""

    features: Features
    real: Bool[Tensor, "B T"]  # frames before the end of the clip
    sentence: Tensor  # indices of pieces (B, N), or vectors (B, W)
    gesture: Int[Tensor, "B 2"]  # of the left and the right hand; -1: unknown
    scene: PlacedBodies | None = None  # for the blend alone


@dataclass(frozen=True)
class HandsTask(SamplesTask):
    """One network of BOTH2Hands, learned from clips of bodies."""

    name: BodyStage
    config: Both2HandsConfig
    data: TrainingData[Gestures]
    speech: Speech
    tokenizer: Tokenizer | None = None  # of a network with a text encoder of its own
    branches: Branches | None = None  # the networks that are blended
    scale: Scale | None = None  # scale of hands to use instead of one fitted to the data

    def loss(self, model: Any, samples: GestureSamples, draws: Draws) -> Float[Tensor, ""]:
        """The loss of the network."""
        return task_loss(model, samples, self.config, draws, self.branches)

    def network(self) -> nn.Module:
        """An untrained network with scales fitted to the data, or with `scale` for hands."""
        with first_weights(self.config.seed, self.name, "weights"):
            if self.name == "blend":
                return Blender(self.config.blend)
            if self.name == "body_hands":
                network: HandsDenoiser = BodyHands(self.config.body_hands)
            else:
                network = TextHands(self.config.text_hands)
        set_scales(network, self.data.training, self.kept[0])
        if self.scale is not None:
            network.scale.load_state_dict(self.scale.state_dict())
        return network

    @cached_property
    def kept(self) -> tuple[Features, Features]:
        """The features of all training and of all validation clips, computed once."""
        training, validation = self.data.training, self.data.validation
        return kept_features(training, self.frame), kept_features(validation, self.frame)

    @property
    def frame(self) -> HandsFrame:
        """Frame of the hands' features."""
        body = self.config.body_hands if self.branches is None else self.branches.body.config
        return "wrist" if self.name == "text_hands" else body.frame

    def drawn(self, training: bool, own: Part, pieces: int, *parts: object) -> DrawnSamples:
        """The pieces of a batch of `GestureSamples`, each drawn separately."""
        for part in own.divided(pieces):
            generator = seeded_generator(self.config.seed, self.name, *parts)
            draws = Draws(part.count, generator, part)
            yield self.samples(training, draws), draws

    def samples(self, training: bool, draws: Draws) -> GestureSamples:
        """Random clips, each with a random one of its sentences."""
        data = self.data.training if training else self.data.validation
        pick = draws.integers(0, len(data.length))
        which = draws.integers(0, data.joined.shape[1])
        sentence = self.speech([str(data.joined[n, m]) for n, m in zip(pick, which, strict=True)])
        real, gesture = data.before_end[pick], data.gesture[pick]
        if self.name == "blend":
            scene = scene_of(data.take(pick, "B"), self.frame)
            return GestureSamples(Features.of(scene, self.frame), real, sentence, gesture, scene)
        kept = self.kept[0 if training else 1]
        return GestureSamples(kept.take(pick, "B").map(Tensor.float), real, sentence, gesture)

    def learned_from(self) -> dict[str, Any]:
        """Fingerprints of the clips, by lengths and last poses, of their sentences and of the
        networks that are blended, and the vocabulary."""
        both = self.data.training, self.data.validation
        clips, held_out = (digest([data.length, data.pose[:, -1]]) for data in both)
        return {
            "sequences": len(self.data.training.length),
            "data": clips,
            "validation": held_out,
            "words": digest(
                part for data in both for part in (data.gesture, *map(str, data.joined.ravel()))
            ),
            "branches": None if self.branches is None else self.branches.fingerprint,
            "tokenizer": None if self.tokenizer is None else self.tokenizer.to_str(),
            "made": self.data.record,
        }


def task_loss(
    model: HandsDenoiser | Blender,
    samples: GestureSamples,
    config: Both2HandsConfig,
    draws: Draws,
    branches: Branches | None,
) -> Float[Tensor, ""]:
    """The loss of a network at random levels of noise; `branches` are those that are blended."""
    if isinstance(model, Blender):
        assert branches is not None, "the blend is learned with the two networks before it"
        found, clean = blended_answers(model, branches, samples, config, draws)
    else:
        found, clean = _denoised(model, samples, draws)
    loss = hands_loss(found, clean, samples.real, config)
    if isinstance(model, TextHands) and model.named is not None and config.gestures:
        loss = loss + config.gestures * naming_loss(model, samples)
    return loss


def _denoised(
    network: HandsDenoiser, samples: GestureSamples, draws: Draws
) -> tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]]:
    """The prediction of a network at random noise levels, and the clean features."""
    clean = network.scale.normalise(samples.features.hands)
    level = draws.integers(1, len(network.sigmas)).to(clean.device)
    if isinstance(network, BodyHands):
        condition = network.encode(samples.features.body)
    else:
        assert isinstance(network, TextHands), "a network is told the body or a sentence"
        condition = network.encode(samples.sentence)
    noisy = clean + network.sigmas[level][:, None, None] * draws.like(clean)
    return network.denoised(noisy, level.float(), condition), clean


def blended_answers(
    blender: Blender,
    branches: Branches,
    samples: GestureSamples,
    config: Both2HandsConfig,
    draws: Draws,
) -> tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]]:
    """Blended predictions for clips with their sentences at random noise levels, and the target.

    In our form both networks denoise the same noisy hands, in the paper's each its own.
    """
    scene = samples.scene
    assert scene is not None, "samples to blend come with their scene"
    device = samples.features.hands.device
    body, text = branches.body.to(device), branches.text.to(device)
    clean = body.scale.normalise(samples.features.hands)
    level = draws.integers(1, len(body.sigmas)).to(clean.device)
    noisy = other = clean + body.sigmas[level][:, None, None] * draws.like(clean)
    if config.blend.form == "paper":
        own = text.scale.normalise(hand_features(scene.posed, "wrist"))
        other = own + text.sigmas[level][:, None, None] * draws.like(own)
    with torch.no_grad():
        condition = body.encode(samples.features.body), text.encode(samples.sentence)
        answers = branches.answers((noisy, other), level.float(), condition, scene)
    target = clean if config.target == "hands" else blender.mean(*answers)
    return blender(*answers, level.float()), target


def hands_loss(
    found: Float[Tensor, "B T 270"],
    clean: Float[Tensor, "B T 270"],
    real: Bool[Tensor, "B T"],
    config: Both2HandsConfig,
) -> Float[Tensor, ""]:
    """Mean error of the features of real frames, plus that of their differences between frames."""

    def mean(error: Tensor, frames: Tensor) -> Tensor:
        size = error.square() if config.error == "squared" else error.abs()
        return (size.mean(-1) * frames).sum() / frames.sum().clamp(min=1)

    error = found - clean
    loss = mean(error, real)
    if config.velocity:
        loss = loss + config.velocity * mean(error.diff(dim=1), real[:, 1:])
    return loss


def naming_loss(network: TextHands, samples: GestureSamples) -> Float[Tensor, ""]:
    """Cross-entropy of each hand's gesture, as the network names it from the sentence alone."""
    scores = network.gestures(network.encode(samples.sentence)).flatten(0, 1)
    known = samples.gesture.flatten() >= 0
    taken = functional.cross_entropy(scores[known], samples.gesture.flatten()[known])
    return taken if bool(known.any()) else scores.sum() * 0


def scene_of(clips: Gestures, frame: HandsFrame) -> PlacedBodies:
    """Clips as a scene."""
    return PlacedBodies.of(clips.skeleton, placed(clips.motion, frame))


def kept_features(data: Gestures, frame: HandsFrame) -> Features:
    """The features of all clips, in half precision."""
    firsts = range(0, len(data.length), CHUNK)
    chunks = (data.take(slice(first, first + CHUNK), "B") for first in firsts)
    made = (Features.of(scene_of(each, frame), frame).map(Tensor.half) for each in chunks)
    return concatenated(made, "B")


def set_scales(network: HandsDenoiser, data: Gestures, kept: Features) -> None:
    """Fit the scales of a network's features to clips of the data."""
    some = slice(None, None, -(-len(data.length) // MOST_FITTED))
    features = kept.take(some, "B").map(Tensor.float)
    real = data.before_end[some]
    scaling = network.config.scaling
    network.scale.fit(features.hands, real, scaling)
    if isinstance(network, BodyHands):
        network.body_scale.fit(features.body, real, scaling)
