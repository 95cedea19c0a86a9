"""From sentences and objects to actions: contact maps, then the reverse diffusion of motion."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.choices import DRAWS, GUIDANCE, STEPS, TAKING_PART, HandsName, Side
from geneoh.generators.sampling import Sampler, from_noise, smoothed_clips
from geneoh.generators.text2hoi.choosing import best_draws
from geneoh.generators.text2hoi.networks.interaction import Condition, InteractionNetwork
from geneoh.generators.text2hoi.networks.library import Text2HoiNetworks
from geneoh.generators.text2hoi.networks.objects import Objects, map_as_read
from geneoh.generators.text2hoi.networks.tokens import NUMBERS, Tokens, actions_of
from geneoh.generators.text2hoi.physics.resting import retimed
from geneoh.generators.text2hoi.sentences.passing import passed_by
from geneoh.nn.checkpoint import finite_output
from geneoh.progress import OnStep
from geneoh.synthesis.actions.action import Actions

UNKNOWN = -1  # index of the verb and of the object's name in generated actions


@dataclass(frozen=True)
class Text2HoiSampling:
    """How actions are drawn from the networks."""

    sampler: Sampler = "multistep"
    steps: int = STEPS  # denoising steps (the paper's code: 1,000 ancestral ones)
    guidance: float = GUIDANCE
    """Classifier-free guidance scale: 1 takes the prediction with the sentence (paper); more
    extrapolates beyond it, away from the one without a sentence, at twice the time."""
    smoothing: float = 2.0
    """Standard deviation of the final Gaussian over time, frames; 0 for none (paper)."""
    draws: int = DRAWS
    """Actions that are sampled for each that is kept, see `best_draws` (paper: 1)."""


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
    """An action for each sentence, object, hands and length, and the contact map it was made for.

    Of `config.draws` samples for a sentence the best one is kept (see `best_draws`). Each sample
    has a random contact map of its own, unless `contact` has one for each sentence. If `giver`
    names the hand that passes the object to the other, samples in which it does are preferred;
    `fitting`, if passed, decides instead which samples fit. Verbs and names are `UNKNOWN`. Clips
    are sampled in whole tokens, because principal axes over the frames of a token do not fit a part
    of it, and then resampled to `lengths`.

    Raises:
        CheckpointError: the networks return NaN, as damaged weights do.
    """
    config, device = config or Text2HoiSampling(), objects.points.device
    clips = torch.arange(len(sentences), device=device).repeat_interleave(config.draws)
    objects, lengths = objects.take(clips, "B"), lengths.to(device)[clips]
    sentences = [sentences[int(clip)] for clip in clips]
    hands = [hands[int(clip)] for clip in clips]
    # maps are sampled even if `contact` is passed, so that actions get the same noise
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
        givers: list[Side | None] = [giver[int(clip)] for clip in clips]
        fits = passed_by(drawn, givers, config.draws)
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
    """Sampled features as actions, smoothed and resampled to `lengths`."""
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
    """The condition of the interaction network."""
    device = objects.points.device
    given_all = torch.ones(len(text), dtype=torch.bool, device=device)
    sides = [TAKING_PART[each] for each in hands]
    return Condition(
        text,
        objects,
        map_as_read(contact, network.config.form),
        torch.tensor(sides, device=device),
        torch.arange(int(lengths.max()), device=device) < lengths[:, None],
        given_all,
        given_all,
    )


def drawn_numbers(
    network: InteractionNetwork,
    condition: Condition,
    config: Text2HoiSampling,
    *,
    generator: torch.Generator,
    on_step: OnStep | None = None,
) -> Float[Tensor, "B T 208"]:
    """Normalised features sampled by the reverse process, with guidance."""
    encoded, guided = network.encode(condition), config.guidance != 1
    untold = network.encode(condition.without_text()) if guided else encoded

    def answer(x: Tensor, level: Tensor) -> Tensor:
        level = level.expand(len(x))
        found = network.denoised(x, level, encoded)
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
    """Actions of the objects without hands and motion."""
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
