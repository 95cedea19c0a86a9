"""From sentences and objects to actions: contact maps, then a reverse process over all numbers."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.choices import DRAWS, GUIDANCE, STEPS, TAKING_PART, HandsName, Side
from geneoh.generators.from_noise import Sampler, from_noise
from geneoh.generators.smoothing import smoothed_clips
from geneoh.generators.text2hoi.choosing import best_draws
from geneoh.generators.text2hoi.networks.interaction import Condition, InteractionNetwork
from geneoh.generators.text2hoi.networks.library import Text2HoiNetworks
from geneoh.generators.text2hoi.networks.objects import Objects
from geneoh.generators.text2hoi.networks.tokens import NUMBERS, Tokens, actions_of
from geneoh.generators.text2hoi.physics.resting import retimed
from geneoh.generators.text2hoi.sentences.passing import passed_by
from geneoh.nn.checkpoint import finite_output
from geneoh.progress import OnStep
from geneoh.synthesis.actions.action import Actions

UNKNOWN = -1
"""Verb and name of actions that are made for a sentence."""


@dataclass(frozen=True)
class Text2HoiSampling:
    """How actions are drawn from the networks."""

    sampler: Sampler = "multistep"
    steps: int = STEPS  # from noise to numbers (paper: 1,000 ancestral ones)
    guidance: float = GUIDANCE
    """How far answers are moved from the one without a sentence to the one with it: 1 is the answer
    with it (paper), and more than 1 goes beyond it, at twice the time."""
    smoothing: float = 2.0
    """Deviation in frames of the Gaussian over the numbers at last; 0 for none (paper)."""
    draws: int = DRAWS
    """Actions that are drawn for each that is kept, see `best_draws` (paper: 1)."""


@torch.no_grad()
def sample_actions(
    networks: Text2HoiNetworks,
    objects: Objects,
    sentences: Sequence[str],
    hands: Sequence[HandsName],
    lengths: Int[Tensor, " B"],
    config: Text2HoiSampling | None = None,
    *,
    generator: torch.Generator,
    contact: Float[Tensor, "B P"] | None = None,
    giver: Sequence[Side | None] | None = None,
    fitting: Callable[[Actions], Bool[Tensor, " B"]] | None = None,
    on_step: OnStep | None = None,
) -> tuple[Actions, Float[Tensor, "B P"]]:
    """An action for each sentence with its object, its hands and its number of frames; and the
    contact map that it was made for.

    Of `config.draws` actions for a sentence the best one is kept (see `best_draws`). Each of them
    has a random contact map of its own, unless those of the sentences are given. Where
    `giver` names the hand that passes the object to the other, one in which that hand does is kept,
    if one was drawn; or `fitting` tells of all drawn actions which ones fit. Verbs and names are
    `UNKNOWN`. Clips are drawn with whole tokens, because axes that frames of a token share fit no
    parts of one, and then take the time that is asked for.

    Raises:
        CheckpointError: the networks answer with NaN, as of damaged weights.
    """
    config, device = config or Text2HoiSampling(), objects.points.device
    clips = torch.arange(len(sentences), device=device).repeat_interleave(config.draws)
    objects, lengths = objects.take(clips, "B"), lengths.to(device)[clips]
    sentences = [sentences[int(clip)] for clip in clips]
    hands = [hands[int(clip)] for clip in clips]
    # maps are drawn where they are given, too, so that the noise of the actions is the same
    text = networks.text.encode(sentences).to(objects.points)
    maps = networks.contact.sample(objects, text, generator=generator)
    contact = maps if contact is None else contact[clips]
    each = networks.interaction.config.frames_per_token
    whole = (lengths + each - 1) // each * each
    condition = condition_of(networks.interaction, objects, text, hands, whole, contact)
    numbers = drawn_numbers(
        networks.interaction, condition, config, generator=generator, on_step=on_step
    )
    drawn = actions_of_numbers(networks.interaction, numbers, condition, lengths, config.smoothing)
    if config.draws == 1:
        return drawn, contact
    fits = None
    if giver is not None:
        asked: list[Side | None] = [giver[int(clip)] for clip in clips]
        fits = passed_by(drawn, asked, config.draws)
    if fitting is not None:
        fits = fitting(drawn)
    kept = best_draws(drawn, config.draws, fits)
    return drawn.take(kept, "B"), contact[kept]


def actions_of_numbers(
    network: InteractionNetwork,
    numbers: Float[Tensor, "B T 208"],
    condition: Condition,
    lengths: Int[Tensor, " B"],
    smoothing: float,
) -> Actions:
    """Drawn numbers as actions in the time that is asked for; see `sample_actions`."""
    valid, objects = condition.valid, condition.objects
    numbers = smoothed_clips(finite_output(numbers), smoothing, valid.sum(1))
    flat, frame = network.denormalise(numbers), network.config.frame
    tokens = Tokens.of_flat(flat, valid, condition.present, objects.jointed, frame)
    return retimed(actions_of(tokens, still(objects, valid.shape[1])), lengths)


def condition_of(
    network: InteractionNetwork,
    objects: Objects,
    text: Float[Tensor, "B W"],
    hands: Sequence[HandsName],
    lengths: Int[Tensor, " B"],
    contact: Float[Tensor, "B P"],
) -> Condition:
    """What the interaction network is told; contact maps are made binary for the paper's form."""
    device = objects.points.device
    told = torch.ones(len(text), dtype=torch.bool, device=device)
    sides = [TAKING_PART[each] for each in hands]
    return Condition(
        text,
        objects,
        (contact > 0.5).to(contact) if network.config.form == "paper" else contact,
        torch.tensor(sides, device=device),
        torch.arange(int(lengths.max()), device=device) < lengths[:, None],
        told,
        told,
    )


def drawn_numbers(
    network: InteractionNetwork,
    condition: Condition,
    config: Text2HoiSampling,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "B T 208"]:
    """Normalised numbers by the reverse process."""
    told, guided = network.encode(condition), config.guidance != 1
    untold = network.encode(condition.without_text()) if guided else told

    def answer(x: Tensor, level: Tensor) -> Tensor:
        level = level.expand(len(x))
        found = network.denoised(x, level, told)
        if guided:
            without = network.denoised(x, level, untold)
            found = without + config.guidance * (found - without)
        return found

    return from_noise(
        answer,
        (*condition.valid.shape, NUMBERS),
        network.sigmas,
        sampler=config.sampler,
        steps=config.steps,
        generator=generator,
        on_step=on_step,
    )


def still(objects: Objects, frames: int) -> Actions:
    """Actions in which nothing happens, with given objects."""
    points = objects.points
    count = len(points)
    unknown = torch.full((count,), UNKNOWN, device=points.device)
    return Actions(
        verb=unknown,
        name=unknown,
        hands=torch.zeros(count, 2, dtype=torch.bool, device=points.device),
        length=torch.full_like(unknown, frames),
        pose=points.new_zeros(count, 2, frames, 16, 3),
        wrist=points.new_zeros(count, 2, frames, 3),
        rotation=torch.eye(3).to(points).expand(count, frames, 3, 3),
        translation=points.new_zeros(count, frames, 3),
        joint=points.new_zeros(count, frames),
        **vars(objects),
    )
