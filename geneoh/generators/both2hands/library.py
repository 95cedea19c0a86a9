"""The trained networks of BOTH2Hands: where weights are, and how networks are rebuilt from them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import torch
from jaxtyping import Float
from tokenizers import Tokenizer
from torch import Tensor

from geneoh.choices import BODY_STAGES
from geneoh.errors import ConfigError
from geneoh.generators.both2hands.features import PlacedBodies
from geneoh.generators.both2hands.networks import (
    BlendConfig,
    Blender,
    BodyHands,
    EncodedBody,
    HandsConfig,
    TextHands,
    TextHandsConfig,
)
from geneoh.generators.text import foreign_encoder, sentence_numbers, vocabulary_of
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.nn.weights import file_or_shipped, load_network, refuse_none_of
from geneoh.training.resume import digest

SHIPPED = Path(__file__).parent / "weights"  # the weights in the package, STAGE.safetensors

Speech = Callable[[Sequence[str]], Tensor]
"""From sentences to the condition of the text network: piece indices, or vectors."""


@dataclass(frozen=True)
class Branches:
    """The two networks that are blended, and the encoding of sentences for the second one."""

    body: BodyHands
    text: TextHands
    speech: Speech

    @property
    def fingerprint(self) -> str:
        """A fingerprint of the weights of both."""
        return digest(t for n in (self.body, self.text) for t in n.state_dict().values())

    def on_bodies(
        self, answer: Float[Tensor, "B T 270"], scene: PlacedBodies
    ) -> Float[Tensor, "B T 270"]:
        """A prediction of the text network put onto bodies, normalised as in the body's network."""
        local = self.text.scale.denormalise(answer)
        return self.body.scale.normalise(scene.projected(local, self.body.config.frame))

    def answers(
        self,
        noisy: tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]],
        level: Float[Tensor, " B"],
        conditions: tuple[EncodedBody, EncodedBody],
        scene: PlacedBodies,
    ) -> tuple[Float[Tensor, "B T 270"], Float[Tensor, "B T 270"]]:
        """Clean hands predicted by both networks, both normalised as in the body's network.

        `noisy` are the noisy hands for the body's and for the text network, equal if both networks
        share one reverse process.
        """
        of_body = self.body.denoised(noisy[0], level, conditions[0])
        of_text = self.text.denoised(noisy[1], level, conditions[1])
        return of_body, self.on_bodies(of_text, scene)


@dataclass(frozen=True)
class Both2HandsNetworks(Branches):
    """All networks that make hands for a body and a sentence."""

    blend: Blender


def load_both2hands(
    folder: Path | None = None,
    *,
    text_encoder: Path | None = None,
    device: torch.device | str = "cpu",
) -> Both2HandsNetworks:
    """The networks of a folder of STAGE.safetensors; shipped ones for missing files, or for None.

    `text_encoder` is the folder of the CLIP or sentence-transformers model that networks were
    trained with; None for networks with a text encoder of their own.

    Raises:
        CheckpointError: the folder has no network, or a file does not fit its network.
        ConfigError: the networks were trained with another text encoder or on different data, or
            the blend was trained with other networks.
    """
    refuse_none_of(BODY_STAGES, folder)
    branches = load_branches(folder, text_encoder=text_encoder)
    path = both2hands_weights("blend", folder)
    saved = load_checkpoint(path)
    blend = load_network(path, Blender, BlendConfig, saved)
    if blend.config.form == "ours":
        refuse_other_scales(branches, folder)
    if saved.record.get("branches") not in (None, branches.fingerprint):
        raise ConfigError(
            f"{path}: expected the networks body_hands and text_hands that it was trained with, "
            "got others; train it again with `geneoh train --stage blend` in the folder that holds "
            "those"
        )
    body, text = branches.body.to(device), branches.text.to(device)
    return Both2HandsNetworks(body, text, branches.speech, blend.to(device))


def load_branches(folder: Path | None, *, text_encoder: Path | None = None) -> Branches:
    """The two networks that are blended; arguments and errors are those of `load_both2hands`."""
    body = load_network(both2hands_weights("body_hands", folder), BodyHands, HandsConfig)
    path = both2hands_weights("text_hands", folder)
    saved = load_checkpoint(path)
    text = load_network(path, TextHands, TextHandsConfig, saved)
    encoder = None if text_encoder is None else foreign_encoder(text_encoder)
    if text.config.text != (encoder.width if encoder else 0):
        wanted = f"a text encoder of {text.config.text} features" if text.config.text else "none"
        raise ConfigError(
            f"{path}: expected {wanted}, as the network was trained with, got "
            f"{f'one of {encoder.width}' if encoder else 'none'}; change --text-encoder"
        )
    speech = (
        encoder.encode if encoder else reader_of(vocabulary_of(saved.record, path), text.config)
    )
    return Branches(body, text, speech)


def refuse_other_scales(branches: Branches, folder: Path | None) -> None:
    """Raise `ConfigError` if both networks cannot denoise the same noisy hands in one process."""
    body, text = branches.body, branches.text
    scales = zip(body.scale.state_dict().values(), text.scale.state_dict().values(), strict=True)
    alike = all(torch.equal(a, b) for a, b in scales) and body.config.noise == text.config.noise
    if body.config.frame != "wrist" or not alike:
        raise ConfigError(
            f"{folder or SHIPPED}: expected body_hands and text_hands that were trained on the "
            "same data and noise in the frame 'wrist', as both denoise the same hands, got others; "
            "train both again, or the blend with blend.form=paper"
        )


def reader_of(tokenizer: Tokenizer, config: TextHandsConfig) -> Speech:
    """The encoding of sentences as indices of their pieces."""
    return partial(sentence_numbers, tokenizer, longest=config.words.longest)


def both2hands_weights(name: str, folder: Path | None) -> Path:
    """The file of weights in a folder, else the shipped one."""
    return file_or_shipped(name, folder, SHIPPED)
