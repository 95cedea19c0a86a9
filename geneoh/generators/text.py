"""Text encoders, which map sentences to vectors, and external ones that users bring (CLIP)."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import ConfigError, InputError

KEPT = 4096
"""Number of latest sentences whose vectors are cached: training draws new ones in every step."""


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
