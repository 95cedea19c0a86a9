"""Training sentences of the text encoder, with their meanings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Int
from tokenizers import Tokenizer
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import HANDS, HandsName
from geneoh.generators.text import learned_pieces, marked, piece_numbers, words_of
from geneoh.generators.text2hoi.sentences.captions import caption, with_the
from geneoh.generators.text2hoi.sentences.english import OTHER_VERBS, SMALL_WORDS, THINGS
from geneoh.language.conjugation import forms
from geneoh.language.vocabulary import NOUN_WORDS, VERB_WORDS
from geneoh.language.wording import chance, misspelt, one_of
from geneoh.synthesis.actions.action import VERBS

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
