"""Sentences for what hands do to an object: the paper's four phrasings, and freer ones.

Source: Text2HOI, supplement, "Text prompt annotation". The phrasings are "{action} {object} with
{hand}", its gerund, "{hand} {action} {object}" and "{object} is {action} by {hand}", with articles
as in the paper's examples.
"""

from collections.abc import Sequence

import torch

from geneoh.choices import HandsName, Side
from geneoh.language.conjugation import forms, gerund, participle, third_person
from geneoh.language.vocabulary import NOUN_WORDS, PARTICLES, PLURAL, VERB_WORDS, with_article
from geneoh.language.wording import chance, one_of

ADJECTIVES = ("small", "big", "red", "blue", "green", "black", "white", "old", "heavy", "light")
_ADVERBS = ("slowly", "carefully", "quickly", "gently", "firmly", "briefly", "once", "again")
_PEOPLE = ("someone", "a person", "the person", "she", "he", "the user", "a man", "a woman")
_FROM: dict[Side, str] = {
    "left": "from the left hand to the right hand",
    "right": "from the right hand to the left hand",
}
_FROM_HAND_TO_HAND = (
    "from hand to hand",
    "from one hand to the other",
    *_FROM.values(),
    "to the other hand",
)
_PLACES: dict[str, tuple[str, ...]] = {
    "lift": ("from the table", "off the table", "into the air", "from the desk"),
    "put down": ("on the table", "onto the table", "on the desk"),
    "carry": ("across the table", "to another place", "to the left", "to the right"),
    "slide": ("along the table", "across the table", "over the desk", "on the table", "forward"),
    "rotate": ("on the table", "about its axis", "halfway around"),
    "pour": ("into a glass", "into the bowl"),
    "tilt": ("to one side", "forward", "back"),
    "shake": ("up and down", "from side to side", "back and forth"),
    "inspect": ("closely", "from all sides", "from both sides"),
    "press": ("on the top", "on the table"),
}
"""Where each verb happens, in words that may end a sentence."""


def captions(verb: str, noun: str, hands: HandsName) -> list[str]:
    """The four phrasings of the paper: plain, gerund, with the hand as subject, passive.

    `verb` is one of `geneoh.synthesis.actions.action.VERBS` or a verb of a data set; `noun` gets
    its article here.
    """
    verb = VERB_WORDS.get(verb, (verb,))[0]
    thing, hand = with_article(noun), with_the(hands)
    does = verb if hands == "both hands" else third_person(verb)
    return [
        _sentence(f"{verb} {thing} with {hand}"),
        _sentence(f"{gerund(verb)} {thing} with {hand}"),
        _sentence(f"{hand} {does} {thing}"),
        _sentence(f"{thing} {_be(noun)} {participle(verb)} by {hand}"),
    ]


def caption(
    verb: str,
    noun: str,
    hands: HandsName | None,
    *,
    generator: torch.Generator,
    synonyms: Sequence[str] | None = None,
    giver: Side | None = None,
) -> str:
    """A random sentence for the action: half of them in the paper's phrasings, the others freer.

    If `hands` is None, no hand is named. If an object is passed and `giver` is None, the direction
    is random. Words that `VERB_WORDS` and `NOUN_WORDS` do not list are used as they are. `synonyms`
    of the verb replace the listed ones in all phrasings.
    """
    phrase = one_of(synonyms or VERB_WORDS.get(verb, (verb,)), generator)
    if hands is not None and chance(0.5, generator):
        return one_of(captions(phrase if synonyms else verb, noun, hands), generator)
    held = one_of(NOUN_WORDS.get(noun, (noun,)), generator)
    sentence = _phrased(phrase, held, hands, _tail(verb, hands, giver, generator), generator)
    if chance(0.1, generator):
        sentence = f"please {sentence}" if sentence.startswith(phrase.split()[0]) else sentence
    sentence = _sentence(sentence) if chance(0.7, generator) else sentence
    return sentence if chance(0.7, generator) else sentence.rstrip(".")


def _phrased(
    verb: str, noun: str, hands: HandsName | None, tail: str, generator: torch.Generator
) -> str:
    """A freer phrasing, which keeps the verb, without capital and full stop."""
    base, third, ing, past = forms(verb)
    thing = _described(noun, generator)
    actor = "" if hands is None else _told(hands, generator)
    with_hand = f" {one_of(('with', 'with', 'using'), generator)} {actor}" if actor else ""
    if not actor:
        actor = one_of(_PEOPLE, generator)
    several = hands == "both hands"
    form = int(torch.randint(7, (), generator=generator))
    if form == 0:
        return f"{one_of(_PEOPLE, generator)} {_over(third, thing, generator)}{tail}{with_hand}"
    if form == 1:
        by_hand = f" by {actor}" if with_hand and chance(0.7, generator) else with_hand
        return f"{thing} {_be(noun)} {past}{tail}{by_hand}"
    if form == 2:
        return f"{actor} {_over(base if several else third, thing, generator)}{tail}"
    if form == 3:
        return f"{_over(ing, thing, generator)}{tail}{with_hand}"
    if form == 4 and with_hand:
        return f"use {actor} to {_over(base, thing, generator)}{tail}"
    if form == 5 and with_hand:
        return f"with {actor}, {_over(base, thing, generator)}{tail}"
    return f"{_over(base, thing, generator)}{tail}{with_hand}"


def _over(verb: str, thing: str, generator: torch.Generator) -> str:
    """Verb and object; a particle may follow the object."""
    word, _, rest = verb.partition(" ")
    moved = rest in PARTICLES and chance(0.4, generator)
    return f"{word} {thing} {rest}" if moved else f"{verb} {thing}"


def _described(noun: str, generator: torch.Generator) -> str:
    """The noun with a random article and at times an adjective."""
    if chance(0.25, generator):
        noun = f"{one_of(ADJECTIVES, generator)} {noun}"
    article = one_of(("a", "a", "the", "the", "this", "my", ""), generator)
    plural = noun.split()[-1] in PLURAL
    if article == "a" or (plural and article == "this"):
        return with_article(noun)
    return f"{article} {noun}".strip()


def _told(hands: HandsName, generator: torch.Generator) -> str:
    """Words for the hands."""
    if hands == "both hands":
        return one_of(("both hands", "both hands", "two hands", "the two hands"), generator)
    whose = one_of(("the ", "the ", "", "your ", "my ", "her ", "his ", "one's "), generator)
    return f"{whose}{hands}"


def _tail(
    verb: str, hands: HandsName | None, giver: Side | None, generator: torch.Generator
) -> str:
    """How or where, with the space before it; often nothing."""
    if verb == "pass" and hands == "both hands" and chance(0.6, generator):
        phrase = one_of(_FROM_HAND_TO_HAND, generator)
        return f" {_FROM[giver] if giver and phrase in _FROM.values() else phrase}"
    if chance(0.6, generator):
        return ""
    return f" {one_of((*_ADVERBS[:6], *_PLACES.get(verb, _ADVERBS)), generator)}"


def _be(noun: str) -> str:
    return "are" if noun.split()[-1] in PLURAL else "is"


def with_the(hands: HandsName) -> str:
    """The hands with their article; both hands have none."""
    return hands if hands == "both hands" else f"the {hands}"


def _sentence(words: str) -> str:
    """With a capital and a full stop."""
    return f"{words[0].upper()}{words[1:]}."
