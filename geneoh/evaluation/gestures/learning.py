"""Learning the encoder of motions and sentences from the training clips."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import torch
from jaxtyping import Float, Int
from tokenizers import Tokenizer
from torch import Tensor, nn

from geneoh.config import as_dict
from geneoh.evaluation.gestures.encoder import ClipBatch, EncoderConfig, GestureEncoder, Seen
from geneoh.generators.pieces import learned_pieces, sentence_numbers
from geneoh.metrics.features import retrieval
from geneoh.seeds import seeded_generator
from geneoh.synthesis.gestures.clips import Gestures
from geneoh.training.loop import OnePhase, first_weights
from geneoh.training.processes import Team
from geneoh.training.resume import digest

VALIDATED = 256  # clips that training is validated on
POOL = 32  # clips among which the right one is looked for (paper)


@dataclass(frozen=True)
class EncoderTask(OnePhase):
    """Learning which sentence belongs to which clip; a `training.loop.Task`."""

    config: EncoderConfig
    clips: Gestures
    validation: Gestures
    name: str = "gestures"

    @cached_property
    def tokenizer(self) -> Tokenizer:
        """The pieces of the words of the training sentences."""
        return learned_pieces(self.clips.joined.flatten().tolist(), self.config.text.pieces)

    @cached_property
    def seen(self) -> Seen:
        """What is seen of the training clips."""
        return Seen.of(self.clips)

    @cached_property
    def pieces_of_clips(self) -> Int[Tensor, "B K N"]:
        """All sentences of the training clips."""
        count, each = self.clips.joined.shape
        return self.numbers(self.clips.joined.flatten().tolist()).unflatten(0, (count, each))

    def numbers(self, sentences: Sequence[str]) -> Int[Tensor, "B N"]:
        """Sentences as numbers of pieces."""
        return sentence_numbers(self.tokenizer, sentences, self.config.text.longest)

    def network(self) -> nn.Module:
        """A fresh network with the scale of the clips."""
        with first_weights(self.config.seed, self.name, "weights"):
            made = GestureEncoder(self.config)
        made.set_scale(self.seen)
        return made

    def pieces(self, step: int, team: Team, device: torch.device) -> Sequence[ClipBatch]:
        """Random clips, each with a random one of its sentences, and others' hands."""
        generator = seeded_generator(self.config.seed, self.name, step)
        total, count = len(self.clips.body), self.config.batch
        chosen = torch.randperm(total, generator=generator)[:count]
        others = (chosen + torch.randint(1, total, chosen.shape, generator=generator)) % total
        which = torch.randint(self.clips.joined.shape[1], chosen.shape, generator=generator)
        hidden = torch.rand(len(chosen), generator=generator) < self.config.hidden
        told = self.pieces_of_clips[chosen, which]
        batch = ClipBatch(self.seen.take(chosen, "B"), self.seen.hands[others], told, hidden)
        return [batch.to(device)]

    @torch.no_grad()
    def validate(self, model: GestureEncoder, index: int) -> Float[Tensor, ""]:
        """Share of sentences of held-out clips that find another clip among 32."""
        clips = self.validation.take(slice(VALIDATED), "B")
        seen = Seen.of(clips)
        told = model.sentences(self.numbers(clips.joined[:, 0].tolist()))
        generator = seeded_generator("validation")
        found = retrieval(told, model.motions(seen), 1, pool=POOL, generator=generator)
        return torch.tensor(1 - found, dtype=torch.float64)

    def record(self) -> dict[str, Any]:
        """The recipe, the vocabulary and fingerprints of the clips."""
        data, validation = (digest([c.gesture, c.root]) for c in (self.clips, self.validation))
        return {
            "stage": self.name,
            "config": as_dict(self.config),
            "tokenizer": self.tokenizer.to_str(),
            "clips": len(self.clips.body),
            "data": data,
            "validation": validation,
        }
