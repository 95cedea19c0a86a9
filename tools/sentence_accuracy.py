"""Accuracy of a text encoder: `python -m tools.sentence_accuracy FOLDER`.

Prints, for each kind of sentence, how often the encoder of `FOLDER/text.safetensors` finds the verb
and the hands of random sentences with the verbs of synthetic actions.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from statistics import fmean

from geneoh.generators.text2hoi.learning.text_training import KINDS, MEASURED, accuracy
from geneoh.generators.text2hoi.networks.library import TextModel
from geneoh.seeds import seeded_generator

ROUNDS = 4
"""Number of times that `MEASURED` sentences of each kind are drawn."""


def table(model: TextModel, rounds: int = ROUNDS) -> Iterator[str]:
    """Lines of a table in Markdown."""
    yield f"| {rounds * MEASURED:,} sentences of each kind | verb | hands |"
    yield "|---|---:|---:|"
    for kind in KINDS:
        found = [
            accuracy(
                model.network,
                model.tokenizer,
                kind,
                generator=seeded_generator("sentence accuracy", kind, round_),
            )
            for round_ in range(rounds)
        ]
        verbs, hands = (fmean(right) for right in zip(*found, strict=True))
        yield f"| {kind} | {verbs:.2f} | {hands:.2f} |"


if __name__ == "__main__":
    for line in table(TextModel(Path(sys.argv[1]) / "text.safetensors")):
        print(line)
