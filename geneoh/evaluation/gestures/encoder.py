"""The joint encoder of motions and sentences by which generated hands are scored.

With the encoder that BOTH2Hands released, real clips score at chance: its class token is random at
every start, and dropout stays on. Ours learns the token and the temperature and has no dropout. The
contrastive loss has negatives with the hands of another clip, besides other clips, because the body
alone already identifies many clips.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import torch
from jaxtyping import Bool, Float, Int
from tokenizers import Tokenizer
from torch import Tensor, nn
from torch.nn.functional import cross_entropy, normalize

from geneoh.body.motion import BodyMotion, pose
from geneoh.bundle import Bundle, concatenated
from geneoh.evaluation.generation.classifier import even_frames
from geneoh.generators.both2hands.features import BODY, HANDS, body_features, hand_features, placed
from geneoh.generators.text import SentenceConfig, SentenceNetwork, learned_pieces, sentence_numbers
from geneoh.metrics.features import retrieval
from geneoh.nn.blocks import sinusoid
from geneoh.seeds import seeded_generator
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.training.processes import Team
from geneoh.training.resume import digest
from geneoh.training.run_config import RunConfig
from geneoh.training.tasks import Task, first_weights

FRAMES_READ = 30  # frames of a clip that the encoder sees, evenly spaced from first to last
BATCH = 64  # clips whose features are computed together
LARGEST_INVERSE = 100.0  # largest inverse temperature of the loss


@dataclass(frozen=True)
class EncoderConfig(RunConfig):
    """The training configuration of the encoder; saved with it."""

    steps: int = 600
    batch: int = 48
    rate: float = 1.5e-3
    warmup: int = 40
    decay: float = 0.6
    ema: float = 0.98
    validate_every: int = 200
    checkpoint_every: int = 200
    validation_batches: int = 1
    width: int = 96
    depth: int = 2
    heads: int = 4
    features: int = 32  # length of the feature vectors of motions and sentences
    hidden: float = 0.3  # share of the training clips whose body is masked
    text: SentenceConfig = field(
        default_factory=lambda: SentenceConfig(pieces=1024, piece_width=48, width=96)
    )


@dataclass(frozen=True)
class Seen(Bundle):
    """Input of the encoder for B clips: features of body and fingers in S frames."""

    body: Float[Tensor, "B S 198"]
    hands: Float[Tensor, "B S 270"]  # in the axes of the wrists

    @staticmethod
    def of(clips: Gestures) -> "Seen":
        """Evenly spaced frames of clips, up to their ends."""
        firsts = range(0, len(clips.body), BATCH)  # rotations of all clips need much memory
        parts = (clips.take(slice(first, first + BATCH), "B") for first in firsts)
        return concatenated((Seen.moved(part, part.motion) for part in parts), "B")

    @staticmethod
    def moved(clips: Gestures, motion: BodyMotion) -> "Seen":
        """The same frames of clips whose skeletons move by `motion`."""
        frames = even_frames(clips.length, FRAMES_READ)
        rows = torch.arange(len(frames))[:, None]
        some = BodyMotion(motion.root[rows, frames], motion.rotations[rows, frames])
        posed = pose(clips.skeleton, placed(some, "world"))
        return Seen(body_features(posed), hand_features(posed, "wrist"))


class GestureEncoder(nn.Module):
    """Maps clips and sentences to unit vectors, which are near each other if they match."""

    mean: Tensor
    std: Tensor

    def __init__(self, config: EncoderConfig):
        super().__init__()
        width = config.width
        self.register_buffer("mean", torch.zeros(BODY + HANDS))
        self.register_buffer("std", torch.ones(BODY + HANDS))
        self.enter = nn.Sequential(nn.Linear(BODY + HANDS, width), nn.GELU())
        self.token = nn.Parameter(0.02 * torch.randn(width))
        layer = nn.TransformerEncoderLayer(
            width, config.heads, 2 * width, 0.0, "gelu", batch_first=True, norm_first=True
        )
        self.layers = nn.TransformerEncoder(layer, config.depth, enable_nested_tensor=False)
        self.leave = nn.Sequential(nn.LayerNorm(width), nn.Linear(width, config.features))
        self.text = SentenceNetwork(config.text)
        self.read = nn.Linear(config.text.width, config.features)
        self.cold = nn.Parameter(torch.tensor(math.log(10.0)))

    def motions(
        self, clips: Seen, hidden: Bool[Tensor, " B"] | None = None
    ) -> Float[Tensor, "B F"]:
        """Unit vectors of clips; the bodies of `hidden` clips are masked."""
        whole = (torch.cat([clips.body, clips.hands], -1) - self.mean) / self.std
        if hidden is not None:
            body = whole[..., :BODY].masked_fill(hidden[:, None, None], 0.0)
            whole = torch.cat([body, whole[..., BODY:]], -1)
        tokens = self.enter(whole)
        position = torch.arange(tokens.shape[1], device=tokens.device).float()
        tokens = tokens + sinusoid(position, tokens.shape[-1])
        token = self.token.expand(len(tokens), 1, -1)
        return normalize(self.leave(self.layers(torch.cat([token, tokens], 1))[:, 0]), dim=-1)

    def sentences(self, pieces: Int[Tensor, "B N"]) -> Float[Tensor, "B F"]:
        """Unit vectors of sentences, given as token indices."""
        return normalize(self.read(self.text(pieces)), dim=-1)


@dataclass(frozen=True)
class ClipBatch(Bundle):
    """A training batch of the encoder."""

    clips: Seen
    other: Float[Tensor, "B S 270"]  # hands of other clips, for negatives
    pieces: Int[Tensor, "B N"]  # token indices of a sentence of each clip
    hidden: Bool[Tensor, " B"]  # clips whose body is masked

    def loss(self, model: GestureEncoder) -> Tensor:
        """Contrastive loss: cross entropy of the right clip for each sentence, among all clips and
        all clips with wrong hands, and of the right sentence for each clip."""
        wrong = Seen(self.clips.body, self.other)
        motions = model.motions(concatenated([self.clips, wrong], "B"), self.hidden.repeat(2))
        texts = model.sentences(self.pieces)
        alike = model.cold.exp().clamp(max=LARGEST_INVERSE) * texts @ motions.T
        right = torch.arange(len(texts), device=texts.device)
        back = alike[:, : len(texts)].T
        return 0.5 * (cross_entropy(alike, right) + cross_entropy(back, right))


VALIDATED = 256  # largest number of validation clips in training
POOL = 32  # clips from which the right one is retrieved (the paper's code)


@dataclass(frozen=True)
class EncoderTask(Task):
    """Training of the encoder to match sentences and clips."""

    config: EncoderConfig
    clips: Gestures
    validation: Gestures
    name: str = "gestures"

    @cached_property
    def tokenizer(self) -> Tokenizer:
        """The tokenizer (word pieces) of the training sentences."""
        return learned_pieces(self.clips.joined.flatten().tolist(), self.config.text.pieces)

    @cached_property
    def seen(self) -> Seen:
        """The inputs of the training clips."""
        return Seen.of(self.clips)

    @cached_property
    def pieces_of_clips(self) -> Int[Tensor, "B K N"]:
        """Token indices of all K sentences of each training clip."""
        count, each = self.clips.joined.shape
        return self.numbers(self.clips.joined.flatten().tolist()).unflatten(0, (count, each))

    def numbers(self, sentences: Sequence[str]) -> Int[Tensor, "B N"]:
        """Sentences as token indices."""
        return sentence_numbers(self.tokenizer, sentences, self.config.text.longest)

    def network(self) -> nn.Module:
        """A new network, normalised by the training clips."""
        with first_weights(self.config.seed, self.name, "weights"):
            made = GestureEncoder(self.config)
        whole = torch.cat([self.seen.body, self.seen.hands], -1).flatten(0, 1)
        made.mean.copy_(whole.mean(0))
        made.std.copy_(whole.std(0).clamp(min=1e-3))
        return made

    def pieces(self, step: int, team: Team, device: torch.device) -> Sequence[ClipBatch]:
        """Random clips, each with one of its sentences at random, and the hands of another clip."""
        generator = seeded_generator(self.config.seed, self.name, step)
        total, count = len(self.clips.body), self.config.batch
        chosen = torch.randperm(total, generator=generator)[:count]
        others = (chosen + torch.randint(1, total, chosen.shape, generator=generator)) % total
        which = torch.randint(self.clips.joined.shape[1], chosen.shape, generator=generator)
        hidden = torch.rand(len(chosen), generator=generator) < self.config.hidden
        texts = self.pieces_of_clips[chosen, which]
        batch = ClipBatch(self.seen.take(chosen, "B"), self.seen.hands[others], texts, hidden)
        return [batch.to(device)]

    @torch.no_grad()
    def validate(self, model: GestureEncoder, index: int) -> Float[Tensor, ""]:
        """Share of sentences of held-out clips that retrieve a wrong clip out of `POOL`."""
        clips = self.validation.take(slice(VALIDATED), "B")
        seen = Seen.of(clips)
        texts = model.sentences(self.numbers(clips.joined[:, 0].tolist()))
        generator = seeded_generator("validation")
        found = retrieval(texts, model.motions(seen), 1, pool=POOL, generator=generator)
        return torch.tensor(1 - found, dtype=torch.float64)

    def learned_from(self) -> dict[str, Any]:
        """The vocabulary, and the number and fingerprints of the clips."""
        data, validation = (digest([c.gesture, c.root]) for c in (self.clips, self.validation))
        return {
            "tokenizer": self.tokenizer.to_str(),
            "clips": len(self.clips.body),
            "data": data,
            "validation": validation,
        }
