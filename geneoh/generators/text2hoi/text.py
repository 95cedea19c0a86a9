"""Sentences to vectors: our own small encoder, or a CLIP or sentence-transformers folder."""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import torch
from jaxtyping import Float
from tokenizers import Tokenizer
from torch import Tensor

from geneoh.config import with_table
from geneoh.errors import CheckpointError, ConfigError, InputError
from geneoh.generators.text2hoi.pieces import marked, piece_numbers, words_of
from geneoh.generators.text2hoi.text_network import Reading, TextConfig, TextNetwork
from geneoh.nn.checkpoint import Checkpoint, load_checkpoint

SHIPPED = Path(__file__).parent / "weights" / "text.safetensors"


class TextEncoder:
    """Sentences to vectors of `width` features, each sentence only once."""

    def __init__(self, width: int, embed: Callable[[list[str]], Tensor]) -> None:
        """`embed` gives the vectors of sentences, without gradient."""
        self.width = width
        self._embed = embed
        self._known: dict[str, Tensor] = {}

    def encode(self, sentences: Sequence[str]) -> Float[Tensor, "B W"]:
        """The vectors of sentences, on the CPU."""
        if new := [s for s in dict.fromkeys(sentences) if s not in self._known]:
            self._known |= zip(new, self._embed(new), strict=True)
        found = [self._known[sentence] for sentence in sentences]
        return torch.stack(found) if found else torch.zeros(0, self.width)


class TextModel:
    """Our own encoder with its vocabulary and the classes of its heads."""

    def __init__(self, checkpoint: Checkpoint, file: str) -> None:
        """Rebuild the network; `file` is named in errors.

        Raises:
            CheckpointError: the checkpoint is not of a text encoder of this version.
        """
        record: dict[str, Any] = checkpoint.record
        try:
            config = with_table(TextConfig(), dict(record["config"]["text"]), file)
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
    return _foreign_encoder(folder)


def _foreign_encoder(folder: Path) -> TextEncoder:
    """The text side of a CLIP model, or the mean of the last states of another one (as
    sentence-transformers does), scaled to the length 1 in both cases."""
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
