"""Rows of generated clips: what the networks make of the sentences and objects of real clips."""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.bundle import Bundle, concatenated
from geneoh.choices import Side
from geneoh.generators.text2hoi.library import Networks
from geneoh.generators.text2hoi.objects import Objects
from geneoh.generators.text2hoi.passing import asked_giver
from geneoh.generators.text2hoi.refiner import RefinerNetwork, refined_by
from geneoh.generators.text2hoi.samples import ActionData, hands_of, sentences
from geneoh.generators.text2hoi.sampling import sample
from geneoh.progress import OnStep, steps
from geneoh.synthesis.actions import Actions
from geneoh.synthesis.draws import Draws

AT_ONCE = 16  # clips that are drawn together


@dataclass(frozen=True)
class Drawn(Bundle):
    """Actions as they were drawn, with the contact maps that they were made for."""

    actions: Actions
    touched: Float[Tensor, "B P"]


def draw_clips(
    networks: Networks,
    data: ActionData,
    *,
    generator: torch.Generator,
    contact: bool = True,
    on_step: OnStep | None = None,
) -> Drawn:
    """An action for a random sentence on each real clip, with its object, hands and length.

    Without `contact` the networks are told that no point of the object is touched.
    """
    real = data.actions.take(slice(None))
    said = sentences(real, data, Draws(len(real.verb), generator))
    parts, every = [], torch.arange(real.joint.shape[1])
    for start in steps(range(0, len(said), AT_ONCE), on_step):
        some = real.take(slice(start, start + AT_ONCE), "B")
        objects = Objects.of(some)
        asked = objects, said[start : start + AT_ONCE], hands_of(some), some.length
        given = None if contact else torch.zeros_like(objects.points[..., 0])
        verbs = [data.verb_words[verb] for verb in some.verb.tolist()]
        giver: list[Side | None] = [
            asked_giver(sentence.lower()) if verb == "pass" else None
            for sentence, verb in zip(asked[1], verbs, strict=True)
        ]
        made, touched = sample(networks, *asked, generator=generator, contact=given, giver=giver)
        # clips that were drawn together are as long as the longest of them
        made = made.at_frames(every.minimum(made.length[:, None] - 1))
        parts.append(Drawn(replace(made, verb=some.verb, name=some.name), touched))
    return concatenated(parts, "B")


def drawn_and_refined(drawn: Drawn, refiner: RefinerNetwork | None = None) -> Actions:
    """The drawn actions, after the paper's refiner or without one."""
    if refiner is None:
        return drawn.actions
    parts = [drawn.take(slice(n, n + AT_ONCE), "B") for n in range(0, len(drawn.touched), AT_ONCE)]
    return concatenated([refined_by(refiner, some.actions, some.touched) for some in parts], "B")
