"""Sentences to vectors by the encoder of Text2HOI, or by an external one of the user's."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from geneoh.errors import CheckpointError
from geneoh.generators.pieces import sentence_numbers, vocabulary_of
from geneoh.generators.text import TextEncoder, foreign_encoder
from geneoh.generators.text_network import Reading, TextConfig, TextNetwork
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.nn.weights import load_network

SHIPPED = Path(__file__).parent / "weights" / "text.safetensors"
ASKED = "Lift a mug with the right hand."
"""The sentence whose vector identifies a text encoder."""


class TextModel:
    """Our own encoder with its vocabulary and the classes of its heads."""

    def __init__(self, path: Path = SHIPPED) -> None:
        """Read a file of weights; `CheckpointError` if it is missing or of another network."""
        saved = load_checkpoint(path)
        self.network = load_network(path, TextNetwork, TextConfig, saved)
        self.tokenizer = vocabulary_of(saved.record, path)
        try:
            classes = saved.record["classes"]
            self.verbs: list[str] = list(classes["verbs"])
            self.hands: list[str | None] = list(classes["hands"])
        except (KeyError, TypeError) as error:
            raise CheckpointError(
                f"{path}: expected weights with the classes that they tell apart, got others; "
                "train them again with `geneoh train --stage text`"
            ) from error

    def vectors(self, sentences: Sequence[str]) -> Float[Tensor, "B W"]:
        """The vectors of one sentence or more."""
        longest = self.network.config.longest
        return self.network(sentence_numbers(self.tokenizer, sentences, longest))

    def read(self, sentence: str) -> Reading:
        """Logits of the heads for a sentence."""
        return self.network.read(self.vectors([sentence]))

    def encoder(self) -> TextEncoder:
        """The text encoder that conditions the other networks."""
        return TextEncoder(self.network.config.width, self.vectors)


@cache
def shipped_model() -> TextModel:
    """The encoder that ships with geneoh, which is read once."""
    return TextModel()


def load_text_encoder(folder: Path | None = None) -> TextEncoder:
    """The encoder of a folder, or the shipped one.

    A folder holds `text.safetensors` of `geneoh train --stage text`, or a CLIP or
    sentence-transformers model as the library transformers saves it.

    Raises:
        InputError: the folder holds no model that can be used.
        ConfigError: the library transformers is needed and not installed.
        CheckpointError: our weights in the folder are damaged.
    """
    if folder is None:
        return shipped_model().encoder()
    if (ours := folder / "text.safetensors").is_file():
        return TextModel(ours).encoder()
    return foreign_encoder(folder)
