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
    """Error that the loss averages: squared, whose best prediction is the mean; or absolute
    (paper)."""
    velocity: float = 1.0  # weight of this error for differences between frames (paper: 0)
    gestures: float = 0.3
    """Weight of the cross-entropy of each hand's gesture, which teaches words sooner than the hands
    do (paper: 0); only labelled clips count."""
    target: Literal["hands", "mean"] = "hands"
    """Target of blended hands: the true ones, so that the sentence counts wherever it tells more
    than the body; or the weighted mean of both predictions (paper)."""
    body_hands: HandsConfig = field(default_factory=HandsConfig)
    text_hands: TextHandsConfig = field(default_factory=TextHandsConfig)
    blend: BlendConfig = field(default_factory=BlendConfig)
