"""Settings of the training of the networks of Text2HOI."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from geneoh.choices import ACTION_STAGES
from geneoh.config import Limits
from geneoh.generators.text2hoi.learning.recorded import RecordedConfig
from geneoh.generators.text2hoi.networks.contact import ContactConfig
from geneoh.generators.text2hoi.networks.interaction import InteractionConfig
from geneoh.generators.text2hoi.networks.losses import LossWeights
from geneoh.generators.text2hoi.networks.refiner import RefinerConfig, RefinerWeights
from geneoh.training.run_config import RunConfig


@dataclass(frozen=True)
class Text2HoiConfig(RunConfig):
    """The training of one network; every value is saved with the weights."""

    LIMITS: ClassVar[Limits] = {
        **RunConfig.LIMITS,
        **dict.fromkeys(("mirrored", "text_dropout", "object_dropout", "estimated"), (0, 1)),
    }
    READ_BY: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **{stage: (stage,) for stage in ACTION_STAGES},
        **{"divergence": ("contact",), "losses": ("interaction",), "refining": ("refiner",)},
        **dict.fromkeys(("text_dropout", "object_dropout", "estimated"), ACTION_STAGES[1:]),
    }

    balance: float = 0.5
    """A clip is drawn with the weight n^-balance, where n is the number of clips with its verb and
    hands: 0 draws all clips equally often, 1 all pairs of verb and hands (code: 1, sentences)."""
    mirrored: float = 0.5  # share of the clips that are mirrored, left hands to right ones
    text_dropout: float = 0.1  # share of the clips whose sentence is dropped
    object_dropout: float = 0.1  # share of the clips whose object is dropped, independently
    estimated: float = 0.5
    """Share of the clips with an estimated contact map in the place of the true one (paper: 1,
    code: 0)."""
    divergence: float = 0.005  # weight of the KL divergence of the latent of contact maps
    contact: ContactConfig = field(default_factory=ContactConfig)
    interaction: InteractionConfig = field(default_factory=InteractionConfig)
    losses: LossWeights = field(default_factory=LossWeights)
    refiner: RefinerConfig = field(default_factory=RefinerConfig)
    refining: RefinerWeights = field(default_factory=RefinerWeights)
    recorded: RecordedConfig = field(default_factory=RecordedConfig)
    """How recordings of the user become actions."""
