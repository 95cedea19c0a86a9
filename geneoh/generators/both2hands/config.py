"""Settings of the training of the networks of BOTH2Hands."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar, Literal

from geneoh.choices import BODY_STAGES
from geneoh.generators.both2hands.blend import BlendConfig
from geneoh.generators.both2hands.denoiser import HandsConfig, TextHandsConfig
from geneoh.training.run_config import RunConfig


@dataclass(frozen=True)
class Both2HandsConfig(RunConfig):
    """The training of one network; every value is saved with the weights."""

    READ_BY: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **{stage: (stage,) for stage in BODY_STAGES},
        **{"gestures": ("text_hands",), "target": ("blend",)},
    }

    steps: int = 800
    batch: int = 16
    rate: float = 2e-3
    warmup: int = 30
    decay: float = 0.6
    ema: float = 0.995
    error: Literal["squared", "absolute"] = "squared"
    """What is averaged over numbers: squared errors, whose best answer is the mean; or absolute
    ones (paper)."""
    velocity: float = 1.0  # weight of the same of differences between frames (paper: 0)
    gestures: float = 0.3
    """Weight of naming what each hand does, from which words are learned sooner than from hands
    (paper: 0); only clips that are labelled count."""
    target: Literal["hands", "mean"] = "hands"
    """What blended hands are to be: the true ones, so that the sentence counts wherever it tells
    more than the body; or the weighted mean of both answers (paper)."""
    body_hands: HandsConfig = field(default_factory=HandsConfig)
    text_hands: TextHandsConfig = field(default_factory=TextHandsConfig)
    blend: BlendConfig = field(default_factory=BlendConfig)
