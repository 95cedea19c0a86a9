"""Objects that one hand passes to the other: which hand gives, in words and in motion.

The shipped networks do not hear the direction in a sentence, but half of what they draw goes each
way; so of several draws those that go as the sentence says are kept (`sample`).
"""

import re
from collections.abc import Sequence

import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.choices import OTHER_SIDE, SIDES, Side
from geneoh.generators.text2hoi.resting import touching_hands
from geneoh.synthesis.actions import Actions

MY = r"(?:the |my |your |his |her |one's )?"
_FROM = re.compile(rf"\bfrom {MY}(left|right)\b.*\b(?:in)?to\b")
_TO = re.compile(rf"\b(?:in)?to {MY}(left|right)\b")
_TO_OTHER = re.compile(rf"\b(left|right)\b.*\b(?:in)?to {MY}other\b")


def asked_giver(words: str) -> Side | None:
    """The hand from which lower-case words want an object passed to the other; None if not said."""
    if found := _FROM.search(words) or _TO_OTHER.search(words):
        return _side(found)
    found = _TO.search(words)
    return OTHER_SIDE[_side(found)] if found else None


def givers(actions: Actions) -> list[Side | None]:
    """The hand that touches the object earlier in each clip, on average over its touches.

    None where a hand never touches it, or neither is earlier.
    """
    found: list[Side | None] = []
    for touching in touching_hands(actions):
        left, right = (hand.nonzero().double().mean() for hand in touching)
        found.append("left" if left < right else "right" if right < left else None)
    return found


def passed_by(actions: Actions, asked: Sequence[Side | None]) -> Bool[Tensor, " B"]:
    """Whether the hand that is asked for gives the object in each clip; true where none is."""
    given = givers(actions)
    fits = [want is None or want == gives for want, gives in zip(asked, given, strict=True)]
    return torch.tensor(fits, device=actions.wrist.device)


def _side(found: re.Match[str]) -> Side:
    return SIDES[int(found[1] == "right")]
