"""Sentences for what two hands do, for either hand and for both together."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from geneoh.choices import Side
from geneoh.language import conjugation
from geneoh.language.wording import chance, misspelt, one_of

_PEOPLE = ("someone", "a person", "the person", "she", "he", "a man", "a woman", "the speaker")
_BOTH = ("both hands", "the hands", "both hands together", "the two hands", "her hands")
JOINED = 4  # number of sentences about both hands per clip
MISSPELT = 0.08  # share of these, apart from the plain one, with a typing error


@dataclass(frozen=True)
class Doing:
    """Phrases for what a hand does, or both do together, and whether that is rest."""

    says: Sequence[str]
    rests: bool = False


def third_person_phrase(phrase: str) -> str:
    """What one hand does: "opens and closes" of "open and close"."""
    return " and ".join(map(conjugation.third_person, phrase.split(" and ")))


def gerund_phrase(phrase: str) -> str:
    """The form in -ing of a phrase."""
    return " and ".join(map(conjugation.gerund, phrase.split(" and ")))


def hand_sentence(side: Side, doing: Doing, *, generator: torch.Generator) -> str:
    """A sentence about one hand: "The right hand waves hello." """
    verb = one_of(doing.says, generator)
    hand = f"{one_of(('the', 'the', 'the', 'her', 'his', 'a'), generator)} {side} hand"
    form = int(torch.randint(4, (), generator=generator))
    if form == 0:
        sentence = f"{hand} is {gerund_phrase(verb)}"
    elif form == 1:
        sentence = f"{gerund_phrase(verb)} with {hand}"
    else:
        sentence = f"{hand} {third_person_phrase(verb)}"
    return _written(sentence, generator)


def joined_sentences(left: Doing, right: Doing, *, generator: torch.Generator) -> list[str]:
    """Sentences about both hands: the first names both plainly, the others are freer.

    The plain one is "the right hand waves, the left hand rests", or "both hands clap" where they do
    the same.
    """
    if left == right:
        plain = f"both hands {right.says[0]}"
    else:
        plain = f"the right hand {third_person_phrase(right.says[0])}, "
        plain += f"the left hand {third_person_phrase(left.says[0])}"
    free = [_free(left, right, generator) for _ in range(JOINED - 1)]
    return [plain, *(_with_errors(each, generator) for each in free)]


def _free(left: Doing, right: Doing, generator: torch.Generator) -> str:
    if left == right:
        return _together(right, generator)
    sides: list[tuple[Side, Doing]] = [("left", left), ("right", right)]
    first, second = sides if chance(0.5, generator) else sides[::-1]
    if first[1].rests and chance(0.6, generator):
        first, second = second, first
    if second[1].rests and chance(0.35, generator):
        return _written(_alone(*first, generator), generator)
    one, other = (one_of(doing.says, generator) for _, doing in (first, second))
    hand, its = f"the {first[0]} hand", f"the {second[0]}"
    its = its if chance(0.4, generator) else f"{its} hand"
    form = int(torch.randint(6, (), generator=generator))
    if form <= 1:
        link = one_of((", ", " and ", " while ", ", while ", ", and "), generator)
        sentence = f"{hand} {third_person_phrase(one)}{link}{its} {third_person_phrase(other)}"
    elif form == 2:
        sentence = f"{one} with {hand} and {other} with {its}"
    elif form == 3:
        sentence = f"{gerund_phrase(one)} with {hand}, {gerund_phrase(other)} with {its}"
    elif form == 4:
        sentence = f"{first[0]} hand: {one}, {second[0]} hand: {other}"
    else:
        whose = one_of(_PEOPLE, generator)
        sentence = (
            f"{whose} {third_person_phrase(one)} with {hand}, {its} {third_person_phrase(other)}"
        )
    return _written(sentence, generator)


def _alone(side: Side, doing: Doing, generator: torch.Generator) -> str:
    """A sentence about one hand that leaves out the other, resting one."""
    verb, hand = one_of(doing.says, generator), f"the {side} hand"
    return one_of(
        (
            f"{verb} with {hand}",
            f"{hand} {third_person_phrase(verb)}",
            f"{one_of(_PEOPLE, generator)} {third_person_phrase(verb)} with {hand}",
            f"only {hand} {third_person_phrase(verb)}",
            f"{gerund_phrase(verb)} with {hand}",
        ),
        generator,
    )


def _together(doing: Doing, generator: torch.Generator) -> str:
    verb = one_of(doing.says, generator)
    hands = one_of(_BOTH, generator)
    person = one_of(_PEOPLE, generator)
    sentence = one_of(
        (
            f"{hands} {verb}",
            f"{hands} {verb}",
            f"{hands} are {gerund_phrase(verb)}",
            f"{verb} with both hands",
            f"{gerund_phrase(verb)} with both hands",
            f"{person} {third_person_phrase(verb)}",
            f"{person} is {gerund_phrase(verb)} with both hands",
            verb,
        ),
        generator,
    )
    return _written(sentence, generator)


def _written(sentence: str, generator: torch.Generator) -> str:
    """The sentence with a capital and a full stop, or unchanged, at random."""
    return f"{sentence[0].upper()}{sentence[1:]}." if chance(0.6, generator) else sentence


def _with_errors(sentence: str, generator: torch.Generator) -> str:
    if not chance(MISSPELT, generator):
        return sentence
    return " ".join(misspelt(sentence.split(), generator=generator))
