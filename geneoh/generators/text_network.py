"""The network of a text encoder: a small transformer over the pieces of words."""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from geneoh.config import Limits
from geneoh.nn.blocks import NetworkConfig, check_heads, drawn

PAD = 0  # index of the piece that pads short sentences


@dataclass(frozen=True)
class SentenceConfig(NetworkConfig):
    """Size of the network."""

    LIMITS: ClassVar[Limits] = {"pieces": (2, 65536)}

    pieces: int = 2048  # size of the vocabulary
    piece_width: int = 64  # features of a piece's embedding; small to keep the table small
    width: int = 128  # features of a sentence
    depth: int = 1
    heads: int = 4
    longest: int = 40  # most pieces of a sentence; the rest is cut off


@dataclass(frozen=True)
class TextConfig(SentenceConfig):
    """Size of the network with the heads of Text2HOI."""

    verbs: int = 1  # classes of the three heads
    hands: int = 1
    nouns: int = 1


class Reading(NamedTuple):
    """Logits of the heads for B sentences."""

    verbs: Float[Tensor, "B V"]
    hands: Float[Tensor, "B H"]
    nouns: Float[Tensor, "B N"]


class SentenceNetwork(nn.Module):
    """Maps the pieces of a sentence to one vector, whose features have about zero mean and unit
    variance."""

    def __init__(self, config: SentenceConfig) -> None:
        check_heads(config.width, config.heads, unit=1)
        super().__init__()
        self.config = config
        width = config.width
        pieces = drawn(1.0, config.pieces, config.piece_width)
        self.pieces = nn.Embedding.from_pretrained(pieces, freeze=False)
        self.widen = nn.Linear(config.piece_width, width)
        self.places = nn.Parameter(drawn(0.02, config.longest, width))
        layer = nn.TransformerEncoderLayer(
            width, config.heads, 2 * width, 0.0, "gelu", batch_first=True, norm_first=True
        )
        self.layers = nn.TransformerEncoder(layer, config.depth, enable_nested_tensor=False)
        self.weight = nn.Linear(width, 1)
        self.norm = nn.LayerNorm(width)

    def forward(self, pieces: Int[Tensor, "B N"]) -> Float[Tensor, "B W"]:
        """A vector for each sentence; rows are padded with `PAD` and hold at least one piece."""
        return self.read_pieces(pieces)[0]

    def read_pieces(
        self, pieces: Int[Tensor, "B N"]
    ) -> tuple[Float[Tensor, "B W"], Float[Tensor, "B M W"], Bool[Tensor, "B M"]]:
        """Vectors of sentences, vectors of their pieces, and the mask of pieces without padding."""
        pieces = pieces[:, : self.config.longest]
        padded = pieces == PAD
        tokens = self.widen(self.pieces(pieces)) + self.places[: pieces.shape[1]]
        tokens = self.layers(tokens, src_key_padding_mask=padded)
        weight = self.weight(tokens)[..., 0].masked_fill(padded, -torch.inf).softmax(-1)
        return self.norm((weight[..., None] * tokens).sum(1)), tokens, ~padded


class TextNetwork(SentenceNetwork):
    """The text encoder of Text2HOI, with heads that classify verb, hands and noun."""

    config: TextConfig

    def __init__(self, config: TextConfig) -> None:
        super().__init__(config)
        self.verbs = nn.Linear(config.width, config.verbs)
        self.hands = nn.Linear(config.width, config.hands)
        self.nouns = nn.Linear(config.width, config.nouns)

    def read(self, sentence: Float[Tensor, "B W"]) -> Reading:
        """Logits of the heads for vectors of sentences."""
        return Reading(self.verbs(sentence), self.hands(sentence), self.nouns(sentence))
