"""Sentences on hands of a body: their words, what they rule out, and those that are refused."""

import re
from functools import cache

from geneoh.choices import SIDES
from geneoh.errors import shortened
from geneoh.generators.sentences import check_english, refused
from geneoh.generators.text import words_of
from geneoh.generators.text2hoi.sentences import prompt
from geneoh.generators.text2hoi.sentences.negation import rules_out, without_ruled_out
from geneoh.generators.text2hoi.sentences.outcomes import DETERMINERS
from geneoh.language.conjugation import all_forms
from geneoh.synthesis.gestures.one_handed import ONE_HANDED
from geneoh.synthesis.gestures.two_handed import TWO_HANDED

EXAMPLE = '"the right hand waves, the left rests"'
BODY_WORDS = """
    arm arms body chest chin clenched closed crossed curl curled do does doing ear ears elbow elbows
    extend extended extending eye eyes face facing fist forehead forearm forearms gesture gestures
    girl head high hip hips index inward joint joints knee knees knuckle knuckles lap leg legs
    little loose loosely lower lowered low middle move moves moving mouth nails naturally neck nose
    nothing only open opened outward palms pinky point pose position posture pressed raise raised
    relax relaxed relaxes relaxing rest resting rests ring separated shape shoulder shoulders sit
    sits sitting slightly speaker stand standing stands stay staying stays still straight
    straightened stomach stretch stretched thigh thighs thumbs tip together touch touches touching
    upward waist walk walking walks wrist wrists
"""
"""Words of descriptions of hands and bodies, beside those of synthetic gestures and of objects."""
_CLAUSE = re.compile(r"[,;.:]|\b(?:and|but|while|as|yet|although|though|whereas)\b", re.IGNORECASE)
_IN_TURN = {"then", "first", "before", "after", "until", "later", "again", "stops", "stop"}
"""Words of sentences about successive actions, which are not checked for contradictions."""


def check_sentence(sentence: str) -> None:
    """`InputError` for a text that is no English sentence on hands, or contradicts itself."""
    words = words_of(sentence)
    check_english(sentence, words, known_gesture_words(), on="what hands do", example=EXAMPLE)
    refuse_contradiction(sentence)


@cache
def known_gesture_words() -> frozenset[str]:
    """Words for what hands do: those of synthetic gestures, of bodies, and of objects."""
    phrases = said_of_gestures()
    verbs = [
        form for phrase in phrases for part in phrase.split(" and ") for form in all_forms(part)
    ]
    return prompt.known_words().union(BODY_WORDS.split(), " ".join(verbs).split())


def said_of_gestures() -> list[str]:
    """All phrases for synthetic gestures, such as "wave hello"; each begins with its verb."""
    made = (*ONE_HANDED.values(), *TWO_HANDED.values())
    return [phrase for gesture in made for phrase in gesture.says]


def refuse_contradiction(sentence: str) -> None:
    """Raise `InputError` for a sentence that both requests and rules out a verb for one hand.

    A clause without a side is about the hands of the clause before; the first one is about both. A
    verb is ruled out only at the end of its clause: "does not point down" allows pointing up.
    """
    named: set[tuple[str, str]] = set()
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
                named |= of_sides
            elif at == len(words) - 1:
                ruled_out |= of_sides
    for verb, side in sorted(named & ruled_out):
        both = f"the {side} one is to {verb} and is not to {verb}"
        raise refused(sentence, f"what hands do, found that {both}; keep one of them")


def ruled_out_words(sentence: str) -> str:
    """The first words that rule out something other than a hand ("don't make", "not a fist"); else
    empty."""
    words = without_ruled_out(" ".join(words_of(sentence)))[0].split()
    for at in range(len(words)):
        if count := rules_out(words, at):
            stop = at + count
            while words[stop : stop + 1] and words[stop] in DETERMINERS:
                stop += 1
            return " ".join(words[at : stop + 1])
    return ""


def unknown_words(sentence: str) -> str:
    """A note on words that are not among `known_gesture_words`; empty without such words.

    Negations have a note of their own.
    """
    known = known_gesture_words()
    unknown = {
        f"'{word}'": None
        for word in words_of(sentence)
        if known.isdisjoint((word, word.removesuffix("'s"), word.removesuffix("s")))
        and not rules_out([word], 0)
    }
    if not unknown:
        return ""
    verb = "is" if len(unknown) == 1 else "are"
    return f"{shortened(', '.join(unknown), 60)} {verb} not known and may be ignored"


@cache
def _verbs() -> dict[str, str]:
    """The base form of each inflected verb of synthetic gestures."""
    verbs = {phrase.split()[0] for phrase in said_of_gestures()}
    return {form: verb for verb in sorted(verbs) for form in all_forms(verb)}
