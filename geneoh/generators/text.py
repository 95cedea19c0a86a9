"""Sentences to vectors: pieces of words, a small transformer over them, and encoders of the user's.

Pieces (subword tokens) come from byte-pair encoding learned on our captions and word lists; unknown
and misspelt words fall into several.
"""

import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from tokenizers import Tokenizer
from tokenizers.models import BPE
from tokenizers.pre_tokenizers import WhitespaceSplit
from tokenizers.trainers import BpeTrainer
from torch import Tensor, nn

from geneoh.config import Limits
from geneoh.errors import CheckpointError, ConfigError, InputError
from geneoh.nn.blocks import NetworkConfig, check_heads, drawn

_UNKNOWN = "?"
_START = "_"  # in front of the first piece of every word
PAD = 0  # index of the piece that pads short sentences
KEPT = 4096
"""Number of latest sentences whose vectors are cached: training draws new ones in every step."""


def words_of(sentence: str) -> list[str]:
    """The words of a sentence in lower case, without punctuation; a typographic apostrophe becomes
    a plain one."""
    return re.findall(r"[^\W_]+(?:'[^\W_]+)?", sentence.lower().replace("\u2019", "'"))


def learned_pieces(sentences: Iterable[str], count: int) -> Tokenizer:
    """A tokenizer with a vocabulary of at most `count` pieces; index 0 is the padding."""
    tokenizer = Tokenizer(BPE(unk_token=_UNKNOWN, fuse_unk=True))
    tokenizer.pre_tokenizer = WhitespaceSplit()
    special = ["", _UNKNOWN]
    trainer = BpeTrainer(
        vocab_size=count,
        special_tokens=special,
        limit_alphabet=count - len(special),
        min_frequency=2,
        show_progress=False,
    )
    tokenizer.train_from_iterator((marked(words_of(each)) for each in sentences), trainer)
    return tokenizer


def vocabulary_of(record: Mapping[str, Any], path: Path) -> Tokenizer:
    """The tokenizer that is stored with the weights of a network that encodes sentences itself.

    Raises:
        CheckpointError: the record holds no vocabulary; the message names the file.
    """
    try:
        return Tokenizer.from_str(record["tokenizer"])
    except Exception as error:  # tokenizers raises plain Exceptions
        raise CheckpointError(
            f"{path}: expected weights with their vocabulary, got others "
            f"({str(error).splitlines()[-1].strip()}); train them again"
        ) from error


def marked(words: Sequence[str]) -> str:
    """Words joined by spaces, each with the start mark that the tokenizer expects."""
    return " ".join(_START + word for word in words)


def sentence_numbers(
    tokenizer: Tokenizer, sentences: Iterable[str], longest: int
) -> Int[Tensor, "B N"]:
    """Indices of the pieces of plain sentences; see `piece_numbers`."""
    return piece_numbers(tokenizer, [marked(words_of(each)) for each in sentences], longest)


def piece_numbers(
    tokenizer: Tokenizer, marked_sentences: Sequence[str], longest: int
) -> Int[Tensor, "B N"]:
    """Indices of the pieces of marked sentences, at most `longest`, padded with `PAD`."""
    unknown = tokenizer.token_to_id(_UNKNOWN)
    rows = [
        (encoding.ids or [unknown])[:longest]
        for encoding in tokenizer.encode_batch(list(marked_sentences))
    ]
    most = max(map(len, rows), default=0)
    return torch.tensor([row + [PAD] * (most - len(row)) for row in rows])


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


class TextEncoder:
    """Maps sentences to vectors of `width` features, and caches those of the latest sentences.

    Each sentence is embedded alone: in a batch the last bits of its vector would depend on the
    others, and a resumed training run would differ from an uninterrupted one.
    """

    def __init__(self, width: int, embed: Callable[[list[str]], Tensor]) -> None:
        """`embed` gives the vectors of sentences, without gradient."""
        self.width = width
        self._embed = embed
        self._known: dict[str, Tensor] = {}

    def encode(self, sentences: Sequence[str]) -> Float[Tensor, "B W"]:
        """The vectors of sentences, on the CPU."""
        if new := [s for s in dict.fromkeys(sentences) if s not in self._known]:
            self._known |= {sentence: self._embed([sentence])[0] for sentence in new}
        found = [self._known[sentence] for sentence in sentences]
        for old in list(self._known)[:-KEPT]:
            del self._known[old]
        return torch.stack(found) if found else torch.zeros(0, self.width)


def foreign_encoder(folder: Path) -> TextEncoder:
    """The text encoder of a CLIP model, or mean pooling over the last hidden states of another
    model (as in sentence-transformers); vectors have unit length in both cases.

    Raises:
        InputError: the folder holds no model that can be used.
        ConfigError: the library transformers is not installed.
    """
    kind = _model_type(folder)
    try:
        from transformers import AutoModel, AutoTokenizer, CLIPTextModelWithProjection
    except ImportError as error:
        raise ConfigError(
            f"{folder}: a text encoder of this kind needs the library transformers, which is not "
            'installed; run `pip install "geneoh[text]"`, or leave the option out to use ours'
        ) from error
    try:
        network = CLIPTextModelWithProjection if kind.startswith("clip") else AutoModel
        tokenizer = AutoTokenizer.from_pretrained(str(folder), local_files_only=True)
        model = network.from_pretrained(str(folder), local_files_only=True).eval()
    except (OSError, ValueError, KeyError, ImportError, RuntimeError) as error:
        raise InputError(
            f"{folder}: expected a whole CLIP or sentence-transformers model, with its weights and "
            f"tokenizer, got '{str(error).splitlines()[0]}'; download it again"
        ) from error

    @torch.no_grad()
    def embed(sentences: list[str]) -> Tensor:
        inputs = tokenizer(sentences, padding=True, truncation=True, return_tensors="pt")
        made = model(**inputs)
        if kind.startswith("clip"):
            return torch.nn.functional.normalize(made.text_embeds.float(), dim=-1)
        real = inputs["attention_mask"][..., None].float()
        mean = (real * made.last_hidden_state.float()).sum(1) / real.sum(1)
        return torch.nn.functional.normalize(mean, dim=-1)

    return TextEncoder(embed([""]).shape[-1], embed)


def _model_type(folder: Path) -> str:
    """The kind of network in a folder, as its config.json names it."""
    expected = "expected a folder with a CLIP or sentence-transformers model, or text.safetensors"
    remedy = "name the folder that holds config.json"
    config = folder / "config.json"
    if not config.is_file():
        found = "a folder without config.json" if folder.is_dir() else "no folder"
        raise InputError(f"{folder}: {expected}, found {found}; {remedy}")
    try:
        return str(json.loads(config.read_text(encoding="utf-8"))["model_type"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{config}: {expected}, found a damaged file; {remedy}") from error
