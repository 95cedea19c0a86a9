"""Objects that one hand passes to the other: which hand gives, in words and in motion.

The shipped networks do not hear the direction in a sentence, but half of what they draw goes each
way; so of several draws those that go as the sentence says are kept (`sample_actions`).
"""

import re
from collections.abc import Sequence

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.choices import OTHER_SIDE, SIDES, Side
from geneoh.generators.text2hoi.physics.resting import touching_hands
from geneoh.synthesis.actions.action import Actions

MY = r"(?:the |my |your |his |her |one's )?"
_FROM = re.compile(rf"\bfrom {MY}(left|right)\b.*\b(?:in)?to\b")
_TO = re.compile(rf"\b(?:in)?to {MY}(left|right)\b")
_TO_OTHER = re.compile(rf"\b(left|right)\b.*\b(?:in)?to {MY}other\b")
_FROM_ONE = re.compile(rf"\bfrom {MY}(left|right)(?: (?:hand|one)\b|$)")


def asked_giver(words: str) -> Side | None:
    """The hand from which lower-case words want an object passed to the other; None if not said."""
    if found := _FROM.search(words) or _TO_OTHER.search(words):
        return _side(found)
    if found := _TO.search(words):
        return OTHER_SIDE[_side(found)]
    found = _FROM_ONE.search(words)
    return _side(found) if found else None


def givers(actions: Actions) -> list[Side | None]:
    """The hand that touches the object earlier in each clip, None where neither is; see `leads`."""
    return ["left" if lead > 0 else "right" if lead < 0 else None for lead in leads(actions)]


def leads(actions: Actions) -> Float[Tensor, " B"]:
    """Frames by which the left hand touches the object earlier than the right one does.

    The time of a hand is the mean over the frames in which it touches the object; 0 where a hand
    never does.
    """
    touching = touching_hands(actions).double()
    frames = torch.arange(touching.shape[2], dtype=torch.float64)
    time = (touching * frames).sum(2) / touching.sum(2)
    return (time[:, 1] - time[:, 0]).nan_to_num(0.0)


def passed_by(actions: Actions, asked: Sequence[Side | None], draws: int = 1) -> Bool[Tensor, " B"]:
    """Whether the hand that is asked for gives the object in each clip; true where none is.

    Of `draws` neighbours those alone fit in which it leads by half of the most, so that what both
    hands hold nearly alike does not count where there is better.
    """
    sign = torch.tensor([0.0 if side is None else 1.0 - 2 * SIDES.index(side) for side in asked])
    told, lead = sign.nonzero()[:, 0], torch.zeros(len(sign), dtype=torch.float64)
    lead[told] = sign[told] * leads(actions.take(told, "B").to("cpu"))
    lead = lead.unflatten(0, (-1, draws))
    clear = (lead > 0) & (lead >= lead.amax(1, keepdim=True) / 2)
    return (clear.flatten() | (sign == 0)).to(actions.wrist.device)


def _side(found: re.Match[str]) -> Side:
    return SIDES[int(found[1] == "right")]
