"""Sentences to vectors by the encoder of Text2HOI, or by one that the user has."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from tokenizers import Tokenizer
from torch import Tensor

from geneoh.config import with_table
from geneoh.denoisers.library import refuse_depths
from geneoh.errors import CheckpointError
from geneoh.generators.pieces import marked, piece_numbers, words_of
from geneoh.generators.text import TextEncoder, foreign_encoder
from geneoh.generators.text_network import Reading, TextConfig, TextNetwork
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint

SHIPPED = Path(__file__).parent / "weights" / "text.safetensors"
ASKED = "Lift a mug with the right hand."
"""The sentence by whose vector an encoder is known again."""


class TextModel:
    """Our own encoder with its vocabulary and the classes of its heads."""

    def __init__(self, checkpoint: Checkpoint, file: str) -> None:
        """Rebuild the network; `file` is named in errors.

        Raises:
            CheckpointError: the checkpoint is not of a text encoder of this version.
        """
        record: dict[str, Any] = checkpoint.record
        try:
            size = dict(record["config"]["text"])
            refuse_depths(size, len(checkpoint.tensors))
            config = with_table(TextConfig(), size, file)
            with torch.device("meta"):
                network = TextNetwork(config)
            network.load_state_dict(checkpoint.tensors, assign=True)
            self.tokenizer = Tokenizer.from_str(record["tokenizer"])
            self.verbs: list[str] = list(record["classes"]["verbs"])
            self.hands: list[str | None] = list(record["classes"]["hands"])
        except Exception as error:  # the library tokenizers raises plain ones
            raise CheckpointError(
                f"{file}: expected weights of this version's text encoder, got others "
                f"({str(error).splitlines()[-1].strip()}); train them again with "
                "`geneoh train --stage text`"
            ) from error
        self.network = network.eval().requires_grad_(False)

    def vectors(self, sentences: Sequence[str]) -> Float[Tensor, "B W"]:
        """The vectors of one sentence or more."""
        said = [marked(words_of(sentence)) for sentence in sentences]
        return self.network(piece_numbers(self.tokenizer, said, self.network.config.longest))

    def read(self, sentence: str) -> Reading:
        """What the heads make of a sentence."""
        return self.network.read(self.vectors([sentence]))

    def encoder(self) -> TextEncoder:
        """The model as it conditions the other networks."""
        return TextEncoder(self.network.config.width, self.vectors)


def load_text_model(path: Path = SHIPPED) -> TextModel:
    """Our own encoder from a file of weights; by default the shipped one.

    Raises:
        CheckpointError: the file is missing or holds something else.
    """
    return TextModel(load_checkpoint(path), str(path))


def load_text_encoder(folder: Path | None = None) -> TextEncoder:
    """Our own encoder; or one that the user has.

    Args:
        folder: holds `text.safetensors` of `geneoh train --stage text`, or a CLIP or
            sentence-transformers model as the library transformers saves it; None is for the
            shipped encoder.

    Raises:
        InputError: the folder holds no model that can be used.
        ConfigError: the library transformers is needed and not installed.
        CheckpointError: our weights in the folder are damaged.
    """
    if folder is None:
        return load_text_model().encoder()
    if (ours := folder / "text.safetensors").is_file():
        return load_text_model(ours).encoder()
    return foreign_encoder(folder)
