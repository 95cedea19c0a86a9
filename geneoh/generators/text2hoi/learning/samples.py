"""Training batches of the networks of Text2HOI, and the settings of the training.

A batch has actions with their sentences and contact maps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import ACTION_STAGES, TAKING_PART, HandsName
from geneoh.config import Limits
from geneoh.generators.text import TextEncoder
from geneoh.generators.text2hoi.learning.recorded import RecordedConfig
from geneoh.generators.text2hoi.networks.autoencoders import ContactConfig, ContactNetwork
from geneoh.generators.text2hoi.networks.interaction import InteractionConfig
from geneoh.generators.text2hoi.networks.losses import LossWeights
from geneoh.generators.text2hoi.networks.objects import Objects, contact_maps
from geneoh.generators.text2hoi.networks.refiner import RefinerConfig, RefinerWeights
from geneoh.generators.text2hoi.sentences.captions import caption
from geneoh.generators.text2hoi.sentences.passing import givers
from geneoh.language.vocabulary import noun_of
from geneoh.streamed import Streamed
from geneoh.synthesis.actions.action import VERBS, Actions
from geneoh.synthesis.draws import Draws
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


@dataclass(frozen=True)
class ActionData:
    """Actions with their contact maps, and the names of objects."""

    actions: Streamed[Actions]
    names: tuple[str, ...]
    verbs: tuple[str, ...] | None = None
    """The verbs of recordings, which get no synonyms; None for synthetic actions, whose verbs are
    `VERBS` with their synonyms."""

    @property
    def verb_words(self) -> tuple[str, ...]:
        """The verbs that `Actions.verb` is an index into."""
        return self.verbs or VERBS

    @cached_property
    def contact(self) -> Bool[Tensor, "B P"]:
        """True contact maps: mask of the points that are touched."""
        return self.actions.each(contact_maps)

    @cached_property
    def lengths(self) -> Int[Tensor, " B"]:
        """Frames of each action."""
        return self.actions.each(lambda actions: actions.length)

    @cached_property
    def kind(self) -> Tensor:
        """An index of each action's combination of verb and hands."""
        both = torch.tensor([1, 2])
        return self.actions.each(lambda actions: 4 * actions.verb + actions.hands.long() @ both)


@dataclass(frozen=True)
class ActionSamples(Bundle):
    """A batch of actions with their contact maps and sentence vectors."""

    actions: Actions
    touched: Float[Tensor, "B P"]  # the true contact map
    contact: Float[Tensor, "B P"]  # the map that conditions the network, true or estimated
    text: Float[Tensor, "B W"]

    @property
    def objects(self) -> Objects:
        """The objects of the actions."""
        return Objects.of(self.actions)


@torch.no_grad()
def draw_samples(
    data: ActionData,
    config: Text2HoiConfig,
    encoder: TextEncoder,
    draws: Draws,
    network: ContactNetwork | None = None,
) -> ActionSamples:
    """Random actions with a random sentence each, some of them mirrored.

    Clips are cut to the longest one of the whole batch, even if `draws` is for a part of it. With a
    contact network some clips have its estimated contact maps in place of the true ones.
    """
    counts = torch.bincount(data.kind).double()
    weight = counts[data.kind] ** -config.balance
    edges = weight.cumsum(0) / weight.sum()
    every = torch.searchsorted(edges, draws.whole.share().double()).clamp(max=len(edges) - 1)
    pick = draws.own(every)
    chosen, touched = data.actions.take(pick), data.contact[pick].float()
    chosen = chosen.mirrored(draws.chance(config.mirrored))
    chosen = chosen.take(slice(int(data.lengths[every].max())), "T")
    text = encoder.encode(sentences(chosen, data, draws))
    contact = touched.clone()
    if network is not None:
        estimated, latent = draws.chance(config.estimated), draws.normal(network.config.latent)
        objects = Objects.of(chosen).take(estimated, "B")
        contact[estimated] = network.decode(latent[estimated], objects, text[estimated]).sigmoid()
    return ActionSamples(chosen, touched, contact, text)


def sentences(actions: Actions, data: ActionData, draws: Draws) -> list[str]:
    """A random sentence for each of some actions of the data, each with a seed of its own."""
    seeds = draws.integers(0, 2**31).tolist()
    verbs = [data.verb_words[verb] for verb in actions.verb.tolist()]
    passed = torch.tensor([n for n, verb in enumerate(verbs) if verb == "pass"], dtype=torch.long)
    giver = dict(zip(passed.tolist(), givers(actions.take(passed, "B")), strict=True))
    rows = zip(verbs, actions.name.tolist(), hands_of(actions), seeds, strict=True)
    return [
        caption(
            verb,
            noun_of(str(data.names[name])),
            hands,
            generator=torch.Generator().manual_seed(seed),
            synonyms=None if data.verbs is None else (verb,),
            giver=giver.get(clip),
        )
        for clip, (verb, name, hands, seed) in enumerate(rows)
    ]


def hands_of(actions: Actions) -> list[HandsName]:
    """The hands of each action in words."""
    words: dict[tuple[bool, bool], HandsName] = {s: name for name, s in TAKING_PART.items()}
    return [words[left, right] for left, right in actions.hands.tolist()]
