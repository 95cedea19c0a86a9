"""The trained networks of Text2HOI: where weights are, and how networks are rebuilt from them."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import GENERATOR_STAGES
from geneoh.errors import CheckpointError, ConfigError
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.contact import ContactConfig, ContactNetwork
from geneoh.generators.text2hoi.interaction import InteractionConfig, InteractionNetwork
from geneoh.generators.text2hoi.length import LengthConfig, LengthNetwork
from geneoh.generators.text2hoi.refiner import RefinerConfig, RefinerNetwork
from geneoh.generators.text2hoi.text import ASKED, load_text_encoder
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.nn.weights import file_or_shipped, load_network, refuse_none_of

SHIPPED = Path(__file__).parent / "weights"  # the weights in the package, STAGE.safetensors
ALIKE = 0.1
"""Two vectors of a sentence are of one encoder whose distance is at most this share of their
length: machines and precisions round by a hundredth at most, and trainings have nothing in common.
"""


@dataclass(frozen=True)
class Networks:
    """All that makes an interaction of a sentence and an object."""

    text: TextEncoder
    contact: ContactNetwork
    interaction: InteractionNetwork
    length: LengthNetwork


def load_networks(
    folder: Path | None = None,
    *,
    text_encoder: Path | None = None,
    device: torch.device | str = "cpu",
) -> Networks:
    """The networks of a folder of STAGE.safetensors; what it lacks, or all for None, is as shipped.

    `text_encoder` is the folder of another text encoder, with which the networks were trained.

    Raises:
        CheckpointError: the folder has no network, or a file does not fit its network.
        ConfigError: the networks were trained with another text encoder.
    """
    refuse_none_of(GENERATOR_STAGES, folder)
    text = encoder_of(folder, text_encoder)
    contact, interaction = contact_network(folder), interaction_network(folder)
    length = load_network(weights_of("length", folder), LengthNetwork, LengthConfig)
    trained = (("contact", contact), ("interaction", interaction), ("length", length))
    for name, network in trained:
        refuse_other_encoder(weights_of(name, folder), network.config.text, text)
    return Networks(text, contact.to(device), interaction.to(device), length)


def refuse_other_encoder(path: Path, width: int, text: TextEncoder) -> None:
    """Refuse weights for vectors of a width that were trained with another text encoder.

    Raises:
        CheckpointError: the file is damaged.
        ConfigError: the encoder is another one, as far as the weights tell of theirs.
    """
    if width != text.width:
        raise ConfigError(
            f"{path}: expected a text encoder of {width} features, got one of {text.width}; name "
            "the one that it was trained with"
        )
    learned, asked = vector_of_training(path, width), text.encode([ASKED])[0]
    if learned is not None and float((asked - learned).norm()) > ALIKE * float(learned.norm()):
        raise ConfigError(
            f"{path}: expected the text encoder that it was trained with, got another one of as "
            "many features; name that one, or train it again with `geneoh train --stage "
            f"{path.stem}`"
        )


def vector_of_training(path: Path, width: int) -> Float[Tensor, " W"] | None:
    """The vector of `ASKED` by the encoder that weights were trained with; None where unknown.

    Older weights tell a fingerprint of it alone. It is known where the shipped ones have the same.
    """
    record = load_checkpoint(path).record
    if "text_vector" not in record:
        shipped = record if path.parent == SHIPPED else load_checkpoint(SHIPPED / path.name).record
        return shipped_vector() if record.get("text") == shipped.get("text") else None
    try:
        return torch.tensor(record["text_vector"], dtype=torch.float32).view(width)
    except (ArithmeticError, TypeError, ValueError, RuntimeError) as error:
        raise CheckpointError(
            f"{path}: expected a record with the vector of a sentence, got another one; train it "
            "again or download it again"
        ) from error


@cache
def shipped_vector() -> Float[Tensor, " W"]:
    """The vector of `ASKED` by the shipped text encoder."""
    return load_text_encoder().encode([ASKED])[0]


def load_refiner(folder: Path | None = None) -> RefinerNetwork:
    """The refiner of a folder, else the shipped one.

    Raises:
        CheckpointError: the file is missing or does not fit.
    """
    return load_network(weights_of("refiner", folder), RefinerNetwork, RefinerConfig)


def encoder_of(folder: Path | None, text_encoder: Path | None = None) -> TextEncoder:
    """The text encoder that is named, else that of a folder, else the shipped one."""
    if text_encoder is None and folder is not None and (folder / "text.safetensors").is_file():
        text_encoder = folder
    return load_text_encoder(text_encoder)


def weights_of(name: str, folder: Path | None) -> Path:
    """The file of weights in a folder, else the shipped one."""
    return file_or_shipped(name, folder, SHIPPED)


def interaction_network(folder: Path | None) -> InteractionNetwork:
    """The interaction network of a folder, else the shipped one.

    Raises:
        CheckpointError: the file is missing or does not fit.
    """
    path = weights_of("interaction", folder)
    return load_network(path, InteractionNetwork, InteractionConfig)


def contact_network(folder: Path | None) -> ContactNetwork:
    """The contact network of a folder, else the shipped one; raises as above."""
    return load_network(weights_of("contact", folder), ContactNetwork, ContactConfig)
