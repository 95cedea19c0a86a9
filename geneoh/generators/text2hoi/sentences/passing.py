"""Objects that one hand passes to the other: which hand gives, in words and in motion.

The shipped networks ignore the direction in a sentence, and half of their samples go each way. So
samples in the direction that the sentence names are preferred (`sample_actions`).
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
    """The hand that gives the object by the lower-case words of a sentence; None if unnamed."""
    if found := _FROM.search(words) or _TO_OTHER.search(words):
        return _side(found)
    if found := _TO.search(words):
        return OTHER_SIDE[_side(found)]
    found = _FROM_ONE.search(words)
    return _side(found) if found else None


def givers(actions: Actions) -> list[Side | None]:
    """The hand that touches the object earlier in each clip, or None for neither; see `leads`."""
    lead = leads(touching_hands(actions))
    return ["left" if frames > 0 else "right" if frames < 0 else None for frames in lead]


def leads(touching: Bool[Tensor, "B 2 T"]) -> Float[Tensor, " B"]:
    """Frames by which the left hand touches the object earlier than the right one does.

    The time of a hand is the mean over the frames in which it touches the object. The result is 0
    if a hand never does.
    """
    touching = touching.double()
    frames = torch.arange(touching.shape[2], dtype=torch.float64)
    time = (touching * frames).sum(2) / touching.sum(2)
    return (time[:, 1] - time[:, 0]).nan_to_num(0.0)


def handed_over(touching: Bool[Tensor, "2 T"], giver: Side) -> bool:
    """Whether one hand has the object first and the other one alone has it in the end, by the
    frames in which each hand touches it.

    First and end are the first and the last tenth of the frames in which a hand touches it.
    """
    frames = torch.nonzero(touching.any(0))[:, 0]
    gives, takes = touching.double()[[SIDES.index(giver), SIDES.index(OTHER_SIDE[giver])]]
    tenth = max(1, len(frames) // 10)
    first, end = frames[:tenth], frames[-tenth:]
    alone = takes[end].mean() > 0.5 and gives[end].mean() < 0.5
    return bool(len(frames) and gives[first].mean() > 0.5 and alone)


def passed_by(actions: Actions, giver: Sequence[Side | None], draws: int = 1) -> Bool[Tensor, " B"]:
    """Whether the requested hand gives the object in each clip; true where none is requested.

    Of `draws` consecutive samples those pass in which it is `handed_over`. If there is none, those
    do whose lead is at least half of the largest one.
    """
    asked: list[tuple[int, Side]] = [
        (clip, side) for clip, side in enumerate(giver) if side is not None
    ]
    known = torch.tensor([clip for clip, _ in asked], dtype=torch.long)
    touching = touching_hands(actions.take(known, "B").to("cpu"))
    sign = torch.tensor([1.0 - 2 * SIDES.index(side) for _, side in asked])
    lead, whole = torch.zeros(len(giver), dtype=torch.float64), torch.ones(len(giver)) > 0
    lead[known] = sign * leads(touching)
    hands = zip(touching, asked, strict=True)
    whole[known] = torch.tensor(
        [handed_over(each, side) for each, (_, side) in hands], dtype=torch.bool
    )
    lead, whole = (each.unflatten(0, (-1, draws)) for each in (lead, whole))
    clear = (lead > 0) & (lead >= lead.amax(1, keepdim=True) / 2)
    passed = torch.where(whole.any(1, keepdim=True), whole, clear).flatten()
    return passed.to(actions.wrist.device)


def _side(found: re.Match[str]) -> Side:
    return SIDES[int(found[1] == "right")]
