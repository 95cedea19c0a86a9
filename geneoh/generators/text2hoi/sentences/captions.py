"""Sentences for what hands do to an object, and the training sentences of the text encoder.

Source of the four phrasings: Text2HOI, supplement, "Text prompt annotation": "{action} {object}
with {hand}", its gerund, "{hand} {action} {object}" and "{object} is {action} by {hand}", with
articles as in the paper's examples. Others are freer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Int
from tokenizers import Tokenizer
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import HANDS, HandsName, Side
from geneoh.generators.text import learned_pieces, marked, piece_numbers, words_of
from geneoh.generators.text2hoi.sentences.english import OTHER_VERBS, SMALL_WORDS, THINGS
from geneoh.language.conjugation import forms, gerund, participle, third_person
from geneoh.language.vocabulary import NOUN_WORDS, PARTICLES, PLURAL, VERB_WORDS, with_article
from geneoh.language.wording import chance, misspelt, one_of
from geneoh.synthesis.actions.action import VERBS

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
VERB_CLASSES: tuple[str, ...] = (*VERBS, *OTHER_VERBS)
HANDS_CLASSES: tuple[HandsName | None, ...] = (*HANDS, None)  # None: the sentence names no hand
NOUN_CLASSES: tuple[str, ...] = (*NOUN_WORDS, "")  # the last one: any other noun
CLASSES = {"verbs": VERB_CLASSES, "hands": HANDS_CLASSES, "nouns": NOUN_CLASSES}
"""The classes of each head of the encoder."""
WORDS: dict[str, tuple[str, ...]] = VERB_WORDS | {v: w[1:] for v, w in OTHER_VERBS.items()}
"""Words of every class of verbs."""
WITHHELD = frozenset(
    {"hoist", "deposit", "relocate", "shove", "swivel", "decant", "tilt over", "shake up"}
    | {"observe", "push down", "open up", "fold up", "pass over"}
)
"""One synonym of each verb that is withheld from training, to measure unseen ones."""
SEEN_WORDS = {verb: tuple(w for w in words if w not in WITHHELD) for verb, words in WORDS.items()}
UNSEEN = {verb: tuple(w for w in words if w in WITHHELD) for verb, words in VERB_WORDS.items()}
UNSEEN_PHRASINGS = (
    "I want to see {hands} {ing} {noun}",
    "it is {noun} that {hands} should {verb}",
    "there is {noun} being {past} by {hands}",
    "show me how to {verb} {noun} if only {hands} may be used",
    "the action is {ing} {noun} and the actor is {hands}",
)
"""Phrasings that no training caption has, for validation."""


def captions(verb: str, noun: str, hands: HandsName, phrase: str | None = None) -> list[str]:
    """The four phrasings of the paper: plain, gerund, with the hand as subject, passive.

    `verb` is one of `geneoh.synthesis.actions.action.VERBS` or a verb of a data set, and `phrase`
    what stands for it; `noun` gets its article here.
    """
    verb = phrase or VERB_WORDS.get(verb, (verb,))[0]
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
        return one_of(captions(verb, noun, hands, phrase if synonyms else None), generator)
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


@dataclass(frozen=True)
class Sentences(Bundle):
    """B meanings, each in two phrasings."""

    pieces: Int[Tensor, "B 2 N"]
    verb: Int[Tensor, " B"]  # of `VERB_CLASSES`
    hands: Int[Tensor, " B"]  # of `HANDS_CLASSES`
    noun: Int[Tensor, " B"]  # of `NOUN_CLASSES`


def vocabulary(pieces: int, *, generator: torch.Generator) -> Tokenizer:
    """A tokenizer of at most `pieces` pieces, learned on captions and word lists."""
    verbs = [form for words in SEEN_WORDS.values() for word in words for form in forms(word)]
    listed = [*verbs, *THINGS, *sorted(SMALL_WORDS)] * 5
    texts = [
        caption(*each, generator=generator, synonyms=SEEN_WORDS[each[0]])
        for each in (meaning(generator) for _ in range(6000))
    ]
    return learned_pieces([*texts, *listed], pieces)


def meaning(generator: torch.Generator) -> tuple[str, str, HandsName | None]:
    """A random verb, noun and hands; two of three verbs are those of synthetic actions."""
    verb = one_of(VERBS if chance(0.67, generator) else tuple(OTHER_VERBS), generator)
    noun = one_of(tuple(NOUN_WORDS) if chance(0.7, generator) else THINGS, generator)
    hands = None if chance(0.1, generator) else one_of(HANDS, generator)
    return verb, noun, hands


def draw_sentences(
    tokenizer: Tokenizer,
    count: int,
    longest: int,
    words: Mapping[str, Sequence[str]],
    *,
    generator: torch.Generator,
) -> Sentences:
    """Random meanings in two random phrasings each, some of them misspelt or split apart."""
    meanings = [meaning(generator) for _ in range(count)]
    texts = [
        disturbed(caption(*each, generator=generator, synonyms=words[each[0]]), generator=generator)
        for each in meanings
        for _ in range(2)
    ]
    verbs, nouns, hands = zip(*meanings, strict=True)
    known = {noun: n for n, noun in enumerate(NOUN_CLASSES)}
    return Sentences(
        piece_numbers(tokenizer, texts, longest).unflatten(0, (count, 2)),
        torch.tensor([VERB_CLASSES.index(verb) for verb in verbs]),
        torch.tensor([HANDS_CLASSES.index(each) for each in hands]),
        torch.tensor([known.get(noun, known[""]) for noun in nouns]),
    )


def disturbed(sentence: str, *, generator: torch.Generator) -> str:
    """The marked words of a sentence, some of them misspelt, cut in two or, if small, dropped, so
    that the encoder relies on no single piece."""
    words = words_of(sentence)
    if chance(0.15, generator):
        words = misspelt(words, generator=generator)
    words = [
        word
        for word in words
        if word in ("left", "right", "both", "two") or word not in SMALL_WORDS
        or not chance(0.06, generator)
    ]  # fmt: skip
    pieces = []
    for word in marked(words).split():
        cut = 2 + int(torch.randint(8, (), generator=generator))
        apart = cut < len(word) and chance(0.08, generator)
        pieces += [word[:cut], word[cut:]] if apart else [word]
    return " ".join(pieces)


def unseen_phrasing(verb: str, noun: str, hands: HandsName, *, generator: torch.Generator) -> str:
    """A sentence in a phrasing that no caption has."""
    base, _, ing, past = forms(one_of(SEEN_WORDS[verb], generator))
    pattern = one_of(UNSEEN_PHRASINGS, generator)
    named = {"hands": with_the(hands), "noun": f"the {noun}"}
    return pattern.format(**named, verb=base, ing=ing, past=past)
