"""Stage "text" of the generator: training of the text encoder."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import torch
from jaxtyping import Float, Int
from tokenizers import Tokenizer
from torch import Tensor
from torch.nn import functional

from geneoh.choices import HANDS, HandsName
from geneoh.config import check_limits
from geneoh.generators.text import TextConfig, TextNetwork, marked, piece_numbers, words_of
from geneoh.generators.text2hoi.sentences import captions
from geneoh.generators.text2hoi.sentences.captions import Sentences, caption, draw_sentences
from geneoh.language.vocabulary import NOUN_WORDS
from geneoh.language.wording import misspelt, one_of
from geneoh.seeds import seeded_generator
from geneoh.synthesis.actions.action import VERBS
from geneoh.synthesis.draws import Draws, Part
from geneoh.training.run_config import RunConfig
from geneoh.training.tasks import DrawnSamples, SamplesTask, divided_batch, first_weights

KINDS = ("seen words", "unseen phrasings", "misspellings", "unseen synonyms")
"""Kinds of validation sentences."""
MEASURED = 512  # validation sentences of each kind


@dataclass(frozen=True)
class TextTrainConfig(RunConfig):
    """The training of the text encoder."""

    steps: int = 2500
    batch: int = 48  # meanings, each in two phrasings
    rate: float = 1e-3
    validation_batches: int = 4  # one of each of `KINDS`
    temperature: float = 0.1  # of the contrastive loss between phrasings
    contrast: float = 0.5  # weight of the contrastive loss
    nouns: float = 0.5  # weight of the noun's cross-entropy
    withhold: bool = True
    """Whether the synonyms of `captions.WITHHELD` are withheld from training. The shipped weights
    were trained with them; unseen synonyms were measured in a run without them."""
    text: TextConfig = field(
        default_factory=lambda: TextConfig(**{n: len(of) for n, of in captions.CLASSES.items()})
    )

    def __post_init__(self) -> None:
        """Refuse values outside of their limits, and heads with too few classes."""
        super().__post_init__()
        named = captions.CLASSES.items()
        check_limits(self.text, {head: (len(each), self.text.LARGEST) for head, each in named})


def text_loss(network: TextNetwork, batch: Sentences, config: TextTrainConfig) -> Float[Tensor, ""]:
    """Cross-entropy of verb, hands and noun, and a contrastive loss between phrasings.

    Each phrasing of a meaning should be closer to the other one than to any sentence of another
    meaning in the batch.
    """
    vectors = network(batch.pieces.flatten(0, 1))
    reading = network.read(vectors)
    verb, hands, noun = (x.repeat_interleave(2) for x in (batch.verb, batch.hands, batch.noun))
    named = functional.cross_entropy(reading.verbs, verb)
    named = named + functional.cross_entropy(reading.hands, hands)
    named = named + config.nouns * functional.cross_entropy(reading.nouns, noun)
    first, second = functional.normalize(vectors, dim=-1).unflatten(0, (-1, 2)).unbind(1)
    alike = first @ second.mT / config.temperature
    meaning = torch.stack([batch.verb, batch.hands, batch.noun], -1)
    same = (meaning[:, None] == meaning).all(-1)
    other = same & ~torch.eye(len(same), dtype=torch.bool, device=same.device)
    alike = alike.masked_fill(other, -torch.inf)
    right = torch.arange(len(alike), device=alike.device)
    found = functional.cross_entropy(alike, right) + functional.cross_entropy(alike.mT, right)
    return named + config.contrast * found / 2


@dataclass(frozen=True)
class TextTask(SamplesTask):
    """The text encoder, learned from captions that are generated for every batch."""

    config: TextTrainConfig
    name: str = "text"

    @cached_property
    def tokenizer(self) -> Tokenizer:
        """The tokenizer, the same for every run of a seed."""
        generator = seeded_generator(self.config.seed, "text", "pieces")
        return captions.vocabulary(self.config.text.pieces, generator=generator)

    def loss(self, model: TextNetwork, samples: Sentences, draws: Draws) -> Float[Tensor, ""]:
        """The loss of the network, which draws nothing."""
        return text_loss(model, samples, self.config)

    def network(self) -> TextNetwork:
        """An untrained network."""
        with first_weights(self.config.seed, "text", "weights"):
            return TextNetwork(self.config.text)

    def drawn(self, training: bool, own: Part, pieces: int, *parts: object) -> DrawnSamples:
        """The pieces of this process's part of a batch, which is drawn as a whole."""
        config = self.config
        generator = seeded_generator(config.seed, self.name, *parts, 0)
        words = captions.SEEN_WORDS if config.withhold else captions.WORDS
        drawn = draw_sentences(
            self.tokenizer, config.batch, config.text.longest, words, generator=generator
        )
        drawn = drawn.take(slice(own.first, own.first + own.count), "B")
        return divided_batch(drawn, generator, own, pieces)

    def validate(self, model: TextNetwork, index: int) -> Float[Tensor, ""]:
        """Error rate on sentences of one of `KINDS`, the mean of that of verbs and of hands."""
        generator = seeded_generator(self.config.seed, "text", "validation", index)
        kind = KINDS[index % len(KINDS)]
        right = accuracy(model, self.tokenizer, kind, generator=generator)
        return torch.tensor(1 - sum(right) / 2)

    def learned_from(self) -> dict[str, Any]:
        """The tokenizer and the classes, without which the weights mean nothing."""
        return {"tokenizer": self.tokenizer.to_str(), "classes": captions.CLASSES}


@torch.no_grad()
def accuracy(
    network: TextNetwork, tokenizer: Tokenizer, kind: str, *, generator: torch.Generator
) -> tuple[float, float]:
    """Accuracy of verbs and of hands on random sentences of a kind, with verbs of `VERBS`."""
    chosen: list[tuple[str, str, HandsName]] = [
        (one_of(VERBS, generator), one_of(tuple(NOUN_WORDS), generator), one_of(HANDS, generator))
        for _ in range(MEASURED)
    ]
    texts = []
    for verb, noun, hands in chosen:
        if kind == "unseen phrasings":
            sentence = captions.unseen_phrasing(verb, noun, hands, generator=generator)
        else:
            words = captions.UNSEEN if kind == "unseen synonyms" else captions.SEEN_WORDS
            sentence = caption(verb, noun, hands, generator=generator, synonyms=words[verb])
        split = words_of(sentence)
        wrong = kind == "misspellings"
        texts.append(marked(misspelt(split, generator=generator) if wrong else split))
    was_training = network.training
    device = next(network.parameters()).device
    pieces = piece_numbers(tokenizer, texts, network.config.longest).to(device)
    reading = network.eval().read(network(pieces))
    network.train(was_training)
    verbs: Int[Tensor, " B"] = torch.tensor([VERBS.index(verb) for verb, _, _ in chosen])
    sides: Int[Tensor, " B"] = torch.tensor([HANDS.index(hands) for _, _, hands in chosen])
    return (
        float((reading.verbs.argmax(-1).cpu() == verbs).float().mean()),
        float((reading.hands.argmax(-1).cpu() == sides).float().mean()),
    )
