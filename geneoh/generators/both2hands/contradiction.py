"""What sentences on a body rule out, and those that contradict themselves."""

import re
from functools import cache

from geneoh.choices import SIDES
from geneoh.errors import InputError, shortened
from geneoh.generators.both2hands.words import said_of_gestures
from geneoh.generators.pieces import words_of
from geneoh.generators.text2hoi.negation import rules_out, without_ruled_out
from geneoh.language.conjugation import forms

_CLAUSE = re.compile(r"[,;.:]|\b(?:and|but|while|as|yet|although|though|whereas)\b", re.IGNORECASE)
_IN_TURN = {"then", "first", "before", "after", "until", "later", "again", "stops", "stop"}
"""Words of a sentence that says one thing after the other, which is no contradiction."""


def refuse_contradiction(sentence: str) -> None:
    """Refuse a sentence that says of a hand that it does something and that it does not.

    A clause without a side is on the hands of the clause before, at first on both. A verb is ruled
    out at the end of its clause alone: who points up may well not point down.
    """
    said: set[tuple[str, str]] = set()
    ruled_out: set[tuple[str, str]] = set()
    sides: tuple[str, ...] = SIDES
    for clause in _CLAUSE.split(sentence):
        words = words_of(clause)
        if _IN_TURN.intersection(words):
            return
        sides = SIDES if "both" in words else tuple(s for s in SIDES if s in words) or sides
        denied = {at + count for at in range(len(words)) if (count := rules_out(words, at))}
        for at, word in enumerate(words):
            of_sides = {(_verbs()[word], side) for side in sides if word in _verbs()}
            if at not in denied:
                said |= of_sides
            elif at == len(words) - 1:
                ruled_out |= of_sides
    for verb, side in sorted(said & ruled_out):
        raise InputError(
            f"prompt '{shortened(sentence, 60)}': expected what hands do, found that the {side} "
            f"one is to {verb} and is not to {verb}; keep one of them"
        )


def ruled_out_words(sentence: str) -> str:
    """The first words that rule out something else than a hand, such as "don't make"; or none."""
    words = without_ruled_out(" ".join(words_of(sentence)))[0].split()
    for at in range(len(words)):
        if count := rules_out(words, at):
            return " ".join(words[at : at + count + 1])
    return ""


@cache
def _verbs() -> dict[str, str]:
    """The verb of each form of the verbs of made gestures."""
    verbs = {phrase.split()[0] for phrase in said_of_gestures()}
    return {form: verb for verb in sorted(verbs) for form in forms(verb)}
