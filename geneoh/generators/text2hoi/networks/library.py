"""The trained networks of Text2HOI: where weights are, and how networks are rebuilt from them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import GENERATOR_STAGES
from geneoh.errors import CheckpointError, ConfigError
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.networks.contact import ContactConfig, ContactNetwork
from geneoh.generators.text2hoi.networks.interaction import InteractionConfig, InteractionNetwork
from geneoh.generators.text2hoi.networks.length import LengthConfig, LengthNetwork
from geneoh.generators.text2hoi.networks.refiner import RefinerConfig, RefinerNetwork
from geneoh.generators.text2hoi.networks.text import ASKED, load_text_encoder, shipped_model
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.nn.weights import file_or_shipped, load_network, refuse_none_of

SHIPPED = Path(__file__).parent / "weights"  # the weights in the package, STAGE.safetensors
SAME = 0.1
"""Largest relative distance of a sentence's vectors that count as made by one encoder: rounding
differs by at most a hundredth between machines, and separately trained encoders are unrelated."""


NETWORKS: dict[str, tuple[Any, Any]] = {
    "contact": (ContactNetwork, ContactConfig),
    "interaction": (InteractionNetwork, InteractionConfig),
    "length": (LengthNetwork, LengthConfig),
}
"""Network class and configuration class of each stage that is conditioned on a sentence."""


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
    text = encoder_of(folder, text_encoder)
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


def encoder_of(folder: Path | None, text_encoder: Path | None = None) -> TextEncoder:
    """The text encoder in `text_encoder`, else that of the folder, else the shipped one."""
    if text_encoder is None and folder is not None and (folder / "text.safetensors").is_file():
        text_encoder = folder
    return load_text_encoder(text_encoder)


def text2hoi_weights(name: str, folder: Path | None) -> Path:
    """The file of weights in a folder, else the shipped one."""
    return file_or_shipped(name, folder, SHIPPED)
