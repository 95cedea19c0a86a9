"""The networks of BOTH2Hands as tasks of the training loop."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from jaxtyping import Bool, Float, Int
from tokenizers import Tokenizer
from torch import Tensor, nn
from torch.nn import functional

from geneoh.bundle import Bundle, concatenated
from geneoh.choices import BodyStage
from geneoh.config import as_dict
from geneoh.generators.both2hands.blend import Blender
from geneoh.generators.both2hands.config import Both2HandsConfig
from geneoh.generators.both2hands.denoiser import BodyHands, HandsDenoiser, TextHands
from geneoh.generators.both2hands.features import HandsFrame, hand_features, placed
from geneoh.generators.both2hands.library import Branches, Speech
from geneoh.generators.both2hands.scale import Scale
from geneoh.generators.both2hands.scene import Scene, both_answers
from geneoh.seeds import seeded_generator
from geneoh.synthesis.draws import Draws, Part
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.training.loop import OnePhase, first_weights, own_part
from geneoh.training.processes import Team
from geneoh.training.resume import digest

MOST = 256  # clips of which the scale of features is taken
CHUNK = 64  # clips whose features are made at once


@dataclass(frozen=True)
class Features(Bundle):
    """Bodies and true hands as networks see them; in half precision while they wait."""

    body: Float[Tensor, "B T 198"]
    hands: Float[Tensor, "B T 270"]

    @staticmethod
    def of(scene: Scene, frame: HandsFrame) -> "Features":
        """The features of a scene."""
        return Features(scene.body, hand_features(scene.posed, frame))


@dataclass(frozen=True)
class Samples(Bundle):
    """A batch of clips with what is said of each."""

    features: Features
    real: Bool[Tensor, "B T"]  # frames before the end of the clip
    said: Tensor  # numbers of pieces (B, N), or vectors (B, W)
    gesture: Int[Tensor, "B 2"]  # of the left and the right hand; -1: unknown
    scene: Scene | None = None  # of networks that are blended


@dataclass(frozen=True)
class HandsPiece:
    """Clips on which the loss is taken at once."""

    samples: Samples
    config: Both2HandsConfig
    generator: torch.Generator
    part: Part
    branches: Branches | None

    def loss(self, model: Any) -> Tensor:
        """What the clips add to the loss of the batch."""
        draws = Draws(self.part.count, self.generator, self.part)
        if isinstance(model, Blender):
            assert self.branches is not None, "the blend is learned with the two networks before it"
            found, clean = blended(model, self.branches, self.samples, self.config, draws)
        else:
            found, clean = denoised(model, self.samples, draws)
        loss = hands_loss(found, clean, self.samples.real, self.config)
        if isinstance(model, TextHands) and model.named is not None and self.config.gestures:
            loss = loss + self.config.gestures * naming_loss(model, self.samples)
        return self.part.count / self.part.total * loss


@dataclass(frozen=True)
class HandsTask(OnePhase):
    """One network of BOTH2Hands, learned from clips of bodies; a `geneoh.training.loop.Task`."""

    name: BodyStage
    config: Both2HandsConfig
    data: Gestures
    validation: Gestures
    speech: Speech
    tokenizer: Tokenizer | None = None  # of a network that reads words itself
    branches: Branches | None = None  # the networks that are blended
    made: Mapping[str, Any] | None = None  # how the data was made, for the record
    scale: Scale | None = None  # of hands, instead of that of the data

    def network(self) -> nn.Module:
        """A fresh network with the scales of the data, or with the one that is given."""
        with first_weights(self.config.seed, self.name, "weights"):
            if self.name == "blend":
                return Blender(self.config.blend)
            if self.name == "body_hands":
                network: HandsDenoiser = BodyHands(self.config.body_hands)
            else:
                network = TextHands(self.config.text_hands)
        set_scales(network, self.data, self.kept)
        if self.scale is not None:
            network.scale.load_state_dict(self.scale.state_dict())
        return network

    @cached_property
    def kept(self) -> Features:
        """The features of all clips to learn from, which are made once."""
        return kept_features(self.data, self.frame)

    @cached_property
    def kept_validation(self) -> Features:
        """The same of the clips to validate on."""
        return kept_features(self.validation, self.frame)

    @property
    def frame(self) -> HandsFrame:
        """Axes that the clips are told in."""
        body = self.config.body_hands if self.branches is None else self.branches.body.config
        return "wrist" if self.name == "text_hands" else body.frame

    def drawn(self, training: bool, *parts: object, part: Part) -> tuple[Samples, torch.Generator]:
        """A batch, or part of it, with its generator, by seed and `parts` (purpose, number)."""
        data = self.data if training else self.validation
        generator = seeded_generator(self.config.seed, self.name, *parts)
        draws = Draws(part.count, generator, part)
        pick = draws.integers(0, len(data.length))
        which = draws.integers(0, data.joined.shape[1])
        said = self.speech([str(data.joined[n, m]) for n, m in zip(pick, which, strict=True)])
        real = torch.arange(data.root.shape[1]) < data.length[pick, None]
        if self.name == "blend":
            scene = scene_of(data.take(pick, "B"), self.frame)
            features = Features.of(scene, self.frame)
            return Samples(features, real, said, data.gesture[pick], scene), generator
        kept = self.kept if training else self.kept_validation
        features = kept.take(pick, "B").map(Tensor.float)
        return Samples(features, real, said, data.gesture[pick]), generator

    def pieces(self, step: int, team: Team, device: torch.device) -> list[HandsPiece]:
        """This process's part of the batch of a step, in the pieces that are worked off in turn."""
        pieces = []
        for part in own_part(self.config, team).divided(self.config.accumulate):
            samples, generator = self.drawn(True, "step", step, part=part)
            pieces.append(self.piece(samples.to(device), generator, part))
        return pieces

    def piece(self, samples: Samples, generator: torch.Generator, part: Part) -> HandsPiece:
        """Samples with all that their loss takes."""
        return HandsPiece(samples, self.config, generator, part, self.branches)

    @torch.no_grad()
    def validate(self, model: nn.Module, index: int) -> Float[Tensor, ""]:
        """The loss on a fixed batch of validation clips."""
        whole = Part(0, self.config.batch, self.config.batch)
        samples, generator = self.drawn(False, "validation", index, part=whole)
        device = next(model.parameters()).device
        return self.piece(samples.to(device), generator, whole).loss(model)

    def record(self) -> dict[str, Any]:
        """Network, config, fingerprints of what it learns from, and how that was made."""
        return {
            "stage": self.name,
            "config": as_dict(self.config),
            "sequences": len(self.data.length),
            "data": data_digest(self.data),
            "validation": data_digest(self.validation),
            "words": words_digest(self.data, self.validation),
            "branches": None if self.branches is None else self.branches.fingerprint,
            "tokenizer": None if self.tokenizer is None else self.tokenizer.to_str(),
            "made": None if self.made is None else dict(self.made),
        }


def denoised(
    network: HandsDenoiser, samples: Samples, draws: Draws
) -> tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]]:
    """The answer of a network at random levels of noise, and the clean numbers."""
    clean = network.scale.normalise(samples.features.hands)
    level = draws.integers(1, len(network.sigmas)).to(clean.device)
    if isinstance(network, BodyHands):
        told = network.encode(samples.features.body)
    else:
        assert isinstance(network, TextHands), "a network is told the body or a sentence"
        told = network.encode(samples.said)
    return network.denoised(_noisy(network, clean, level, draws), level.float(), told), clean


def blended(
    blender: Blender,
    branches: Branches,
    samples: Samples,
    config: Both2HandsConfig,
    draws: Draws,
) -> tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]]:
    """Blended answers to a clip and its own sentence at random levels of noise, and their target.

    In our form both networks answer to the same noisy hands, in the paper's each to its own.
    """
    scene = samples.scene
    assert scene is not None, "samples to blend come with their scene"
    device = samples.features.hands.device
    body, text = branches.body.to(device), branches.text.to(device)
    clean = body.scale.normalise(samples.features.hands)
    level = draws.integers(1, len(body.sigmas)).to(clean.device)
    noisy = other = _noisy(body, clean, level, draws)
    if config.blend.form == "paper":
        other = _noisy(
            text, text.scale.normalise(hand_features(scene.posed, "wrist")), level, draws
        )
    with torch.no_grad():
        told = body.encode(samples.features.body), text.encode(samples.said)
        answers = both_answers(body, text, (noisy, other), level.float(), told, scene)
    target = clean if config.target == "hands" else blender.mean(*answers)
    return blender(*answers, level.float()), target


def hands_loss(
    found: Float[Tensor, "B T 270"],
    clean: Float[Tensor, "B T 270"],
    real: Bool[Tensor, "B T"],
    config: Both2HandsConfig,
) -> Float[Tensor, ""]:
    """Mean error of the numbers of real frames, and of their differences between frames."""

    def mean(error: Tensor, told: Tensor) -> Tensor:
        size = error.square() if config.error == "squared" else error.abs()
        return (size.mean(-1) * told).sum() / told.sum().clamp(min=1)

    error = found - clean
    loss = mean(error, real)
    if config.velocity:
        loss = loss + config.velocity * mean(error.diff(dim=1), real[:, 1:])
    return loss


def naming_loss(network: TextHands, samples: Samples) -> Float[Tensor, ""]:
    """Cross-entropy of what each hand does, by the sentence alone."""
    scores = network.gestures(network.encode(samples.said)).flatten(0, 1)
    known = samples.gesture.flatten() >= 0
    taken = functional.cross_entropy(scores[known], samples.gesture.flatten()[known])
    return taken if bool(known.any()) else scores.sum() * 0


def scene_of(clips: Gestures, frame: HandsFrame) -> Scene:
    """Clips as a scene."""
    return Scene.of(clips.skeleton, placed(clips.motion, frame))


def kept_features(data: Gestures, frame: HandsFrame) -> Features:
    """The features of all clips, in half precision."""
    firsts = range(0, len(data.length), CHUNK)
    chunks = (data.take(slice(first, first + CHUNK), "B") for first in firsts)
    made = (Features.of(scene_of(each, frame), frame).map(Tensor.half) for each in chunks)
    return concatenated(made, "B")


def set_scales(network: HandsDenoiser, data: Gestures, kept: Features) -> None:
    """Set the scales of a network's features by clips of the data."""
    some = slice(None, None, -(-len(data.length) // MOST))
    features = kept.take(some, "B").map(Tensor.float)
    real = torch.arange(data.root.shape[1]) < data.length[some, None]
    scaling = network.config.scaling
    network.scale.fit(features.hands, real, scaling)
    if isinstance(network, BodyHands):
        network.body_scale.fit(features.body, real, scaling)


def data_digest(data: Gestures) -> str:
    """A fingerprint of clips by their lengths and last poses."""
    return digest([data.length, data.pose[:, -1]])


def words_digest(*several: Gestures) -> str:
    """A fingerprint of what is said of clips, and of the gestures that it names."""
    told = ((clips.gesture, *map(str, clips.joined.ravel())) for clips in several)
    return digest(part for parts in told for part in parts)


def _noisy(
    network: HandsDenoiser, clean: Float[Tensor, "B T 270"], level: Tensor, draws: Draws
) -> Float[Tensor, "B T 270"]:
    noise = draws.normal(*clean.shape[1:]).to(clean)
    return clean + network.sigmas[level][:, None, None] * noise
