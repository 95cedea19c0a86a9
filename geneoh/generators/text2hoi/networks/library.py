"""The trained networks of Text2HOI: where weights are, and how networks are rebuilt from them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import GENERATOR_STAGES
from geneoh.errors import CheckpointError, ConfigError
from geneoh.generators.text import (
    Reading,
    TextConfig,
    TextEncoder,
    TextNetwork,
    foreign_encoder,
    sentence_numbers,
    vocabulary_of,
)
from geneoh.generators.text2hoi.networks.autoencoders import (
    ContactConfig,
    ContactNetwork,
    LengthConfig,
    LengthNetwork,
)
from geneoh.generators.text2hoi.networks.interaction import InteractionConfig, InteractionNetwork
from geneoh.generators.text2hoi.networks.refiner import RefinerConfig, RefinerNetwork
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.nn.weights import file_or_shipped, load_network, refuse_none_of

SHIPPED = Path(__file__).parent / "weights"  # the weights in the package, STAGE.safetensors
ASKED = "Lift a mug with the right hand."  # the sentence whose vector identifies a text encoder
SAME = 0.1
"""Largest relative distance of a sentence's vectors that count as made by one encoder: rounding
differs by at most a hundredth between machines, and separately trained encoders are unrelated."""
NETWORKS: dict[str, tuple[Any, Any]] = {
    "contact": (ContactNetwork, ContactConfig),
    "interaction": (InteractionNetwork, InteractionConfig),
    "length": (LengthNetwork, LengthConfig),
}
"""Network class and configuration class of each stage that is conditioned on a sentence."""


class TextModel:
    """Our own encoder with its vocabulary and the classes of its heads."""

    def __init__(self, path: Path = SHIPPED / "text.safetensors") -> None:
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


def load_text_encoder(text_encoder: Path | None = None, folder: Path | None = None) -> TextEncoder:
    """The text encoder in `text_encoder`, else that of a folder of weights, else the shipped one.

    `text_encoder` holds `text.safetensors` of `geneoh train --stage text`, or a CLIP or
    sentence-transformers model as the library transformers saves it.

    Raises:
        InputError: the folder holds no model that can be used.
        ConfigError: the library transformers is needed and not installed.
        CheckpointError: our weights in the folder are damaged.
    """
    if text_encoder is None and folder is not None and (folder / "text.safetensors").is_file():
        text_encoder = folder
    if text_encoder is None:
        return shipped_model().encoder()
    if (ours := text_encoder / "text.safetensors").is_file():
        return TextModel(ours).encoder()
    return foreign_encoder(text_encoder)


@dataclass(frozen=True)
class Text2HoiNetworks:
    """All networks that make an interaction from a sentence and an object."""

    text: TextEncoder
    contact: ContactNetwork
    interaction: InteractionNetwork
    length: LengthNetwork


def load_text2hoi(
    folder: Path | None = None,
    *,
    text_encoder: Path | None = None,
    device: torch.device | str = "cpu",
) -> Text2HoiNetworks:
    """The networks of a folder of STAGE.safetensors; shipped ones for missing files, or for None.

    `text_encoder` is the folder of another text encoder, with which the networks were trained.

    Raises:
        CheckpointError: the folder has no network, or a file does not fit its network.
        ConfigError: the networks were trained with another text encoder.
    """
    refuse_none_of(GENERATOR_STAGES, folder)
    text = load_text_encoder(text_encoder, folder)
    return Text2HoiNetworks(
        text,
        conditioned_network("contact", folder, text).to(device),
        conditioned_network("interaction", folder, text).to(device),
        conditioned_network("length", folder, text),
    )


def conditioned_network(name: str, folder: Path | None, text: TextEncoder) -> Any:
    """A network of a folder, else the shipped one; errors are those of `load_text2hoi`."""
    path = text2hoi_weights(name, folder)
    saved = load_checkpoint(path)
    found = load_network(path, *NETWORKS[name], saved)
    refuse_other_encoder(path, saved.record, found.config.text, text)
    return found


def refuse_other_encoder(
    path: Path, record: Mapping[str, Any], width: int, text: TextEncoder
) -> None:
    """Raise `ConfigError` for weights that were trained with another text encoder."""
    if width != text.width:
        raise ConfigError(
            f"{path}: expected a text encoder of {width} features, got one of {text.width}; name "
            "the one that it was trained with"
        )
    learned, vector = vector_of_training(path, record, width), text.encode([ASKED])[0]
    if learned is not None and float((vector - learned).norm()) > SAME * float(learned.norm()):
        raise ConfigError(
            f"{path}: expected the text encoder that it was trained with, got another one of as "
            "many features; name that one, or train it again with `geneoh train --stage "
            f"{path.stem}`"
        )


def vector_of_training(
    path: Path, record: Mapping[str, Any], width: int
) -> Float[Tensor, " W"] | None:
    """The vector of `ASKED` by the encoder that weights were trained with; None where unknown.

    Older weights store only its fingerprint; it is known if that of the shipped weights is equal.
    """
    if "text_vector" not in record:
        shipped = record if path.parent == SHIPPED else load_checkpoint(SHIPPED / path.name).record
        known = record.get("text") == shipped.get("text")
        return shipped_model().vectors([ASKED])[0] if known else None
    try:
        return torch.tensor(record["text_vector"], dtype=torch.float32).view(width)
    except (ArithmeticError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(
            f"{path}: expected a record with the vector of a sentence, got another one; train it "
            "again or download it again"
        ) from error


def load_refiner(folder: Path | None) -> RefinerNetwork:
    """The refiner of a folder, else the shipped one; `CheckpointError` where it does not fit."""
    return load_network(text2hoi_weights("refiner", folder), RefinerNetwork, RefinerConfig)


def text2hoi_weights(name: str, folder: Path | None) -> Path:
    """The file of weights in a folder, else the shipped one."""
    return file_or_shipped(name, folder, SHIPPED)
