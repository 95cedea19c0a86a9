"""Sentences to pieces (subword tokens): byte-pair encoding learned on our captions and word lists.

Unknown and misspelt words fall into several pieces.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Int
from tokenizers import Tokenizer
from tokenizers.models import BPE
from tokenizers.pre_tokenizers import WhitespaceSplit
from tokenizers.trainers import BpeTrainer
from torch import Tensor

from geneoh.errors import CheckpointError
from geneoh.generators.text_network import PAD

_UNKNOWN = "?"
_START = "_"  # in front of the first piece of every word


def words_of(sentence: str) -> list[str]:
    """The words of a sentence in lower case, without punctuation."""
    return re.findall(r"[^\W_]+(?:'[^\W_]+)?", sentence.lower())


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
