"""The meaning of a user's sentence: hands, verb, length and giving hand."""

import re
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

from geneoh.choices import HANDS, SIDES, HandsName, Side
from geneoh.generators.sentences import check_english, nearest_word, refused
from geneoh.generators.text import words_of
from geneoh.generators.text2hoi.networks.library import shipped_model
from geneoh.generators.text2hoi.sentences.captions import ADJECTIVES, WORDS
from geneoh.generators.text2hoi.sentences.duration import (
    length_in_frames,
    stated_length,
    without_amounts,
    without_rate,
)
from geneoh.generators.text2hoi.sentences.english import OTHER_VERBS, READ_AS, SMALL_WORDS, THINGS
from geneoh.generators.text2hoi.sentences.negation import no_hand_in, rules_out, without_ruled_out
from geneoh.generators.text2hoi.sentences.outcomes import DETERMINERS, outcomes_as_verbs
from geneoh.generators.text2hoi.sentences.passing import MY, asked_giver
from geneoh.language.conjugation import all_forms, forms
from geneoh.language.vocabulary import NOUN_WORDS, PARTICLES
from geneoh.synthesis.actions.action import VERBS

_VERB_WORDS = {verb: (*words, *READ_AS.get(verb, ())) for verb, words in WORDS.items()}
"""Words by which a sentence names the verbs that the text encoder knows."""
EXAMPLE = '"pour from the kettle with the right hand"'

JOINTED = ("open", "close")  # verbs whose training data have objects of two parts
_SIDES = rf"{MY}(left|right)( hand)?"
_BOTH = re.compile(
    rf"\b(both|two|each)( \w+)? hands?\b|\b(both|two) handed|\bbimanual|\bhand to hand\b(?! over\b)"
    rf"|\bboth\b(?! \w+s\b)|\b(with|using|by|between) {MY}hands\b|\b(in)?to the other hand\b"
    rf"|\b(left)( hand)? and {MY}right\b|\b(right)( hand)? and {MY}left\b"
    rf"|\b(left) hand\b.*\b(and|while)\b.*\bright hand\b"
    rf"|\b(right) hand\b.*\b(and|while)\b.*\bleft hand\b"
    rf"|\bfrom {MY}(left|right|one) hand\b.*\b(in)?to\b|\bfrom {_SIDES} (in)?to {MY}\w+ hand\b"
)
_TO_ITSELF = re.compile(rf"\bfrom {MY}(left|right) hand\b.*\b(?:in)?to {MY}\1 hand\b")
_WITH_ONE = re.compile(rf"\b(with|using|by) {MY}(left|right)\b")
_ONE: dict[HandsName, re.Pattern[str]] = {
    hands: re.compile(
        rf"\b{side}( \w+)? hand(ed|er|edly)?\b|\b{side}handed\b|\b(with|using|by) {MY}{side}\b"
    )
    for hands, side in zip(HANDS, SIDES, strict=False)
}
_OF_ONE = re.compile(
    r"\b(?:finger|fingertip)s?\b|\b(?:one|a|single) hand(?:ed|edly)?\b(?!.*\bother\b)"
)
"""What is of one hand, whichever it is."""
_DIRECTION = re.compile(
    r"\b(?:to|towards?) (?:the |my |your )?(?:left|right|front|back)\b(?! (?:\w+ )?hand)"
    r"|\b(?:for|back)wards?\b"
)
_FINGERS = re.compile(
    r"\b(?:left |right )?(?:(?:index|middle|ring|little|pinky) finger(?:tip)?s?"
    r"|forefingers?|pinky|thumbs?(?! drive))\b"
)
"""Fingers that are to act, by name."""
_ONE_HANDED = (["one", "handed"], ["single", "handed"])  # no form of "hand", to pass something
_NO_VERB_AFTER = frozenset(
    ("a", "an", "the", "this", "my", "your", "with", "by", "using", "left", "right", "both", "two")
)
"""Words that no verb follows: a word after them that looks like a verb is a noun."""
_NEXT = ("and", "then")
_OBJECT = ("it", "them", "the", "a", "an", "my", "your")
"""Words before which an unknown word after "and" is a verb."""
_GO_WITH_ANY = ("hold", "use")  # other verbs that any action includes


@dataclass(frozen=True)
class Prompt:
    """A sentence and its meaning."""

    sentence: str
    hands: HandsName
    verb: str
    """Of `geneoh.synthesis.actions.action.VERBS`: the verb of the sentence, or the nearest one."""
    known: bool
    """Whether the verb that the sentence names is one of synthetic actions."""
    notes: tuple[str, ...]
    """Assumptions, one sentence each, for the user."""
    network_text: str
    """The sentence for the networks, without its length and without what it rules out."""
    frames: int | None
    """The length that the sentence states, at 30 frames a second; None if it states none."""
    giver: Side | None
    """The hand that passes the object to the other; None where either may."""


def read_prompt(text: str, *, frames: int | None = None, jointed: bool = False) -> Prompt:
    """The meaning of a sentence, by its words first and then by our text encoder.

    A verb without synthetic actions is replaced by the nearest one that has some, and a sentence
    that names no hand gets the right one, or both to pass something; `notes` report this. `frames`
    is a length that overrides one in the sentence.

    Raises:
        InputError: the text is empty, too long or not English, contradicts itself in the hands,
            rules out its verb or all hands, or states a length that no clip has.
    """
    sentence = " ".join(text.split())
    words, on = words_of(sentence), "hands and an object"
    check_english(sentence, words, known_words(), on=on, example=EXAMPLE)
    rest, rate_notes = without_rate(sentence)
    rest, stated = stated_length(rest)
    rest, amount_notes = without_amounts(rest)
    length = length_in_frames(sentence, stated) if frames is None else None
    remaining, ruled_out = without_ruled_out(" ".join(words_of(rest) or words_of(sentence)))
    words = outcomes_as_verbs(remaining.split(), jointed=jointed)
    words, left_out = without_ruled_out_verbs(sentence, words)
    words = with_other_hand(sentence, words, ruled_out)
    made_of = sentence if words == words_of(sentence) else " ".join(words)
    verb, known, verb_notes = asked_verb(made_of, words)
    if verb in JOINTED and not jointed:
        verb_notes += (f"the object moves as a whole: a mesh has no joint to {verb}",)
    if jointed and verb not in JOINTED:
        verb_notes += ("the closed object moves as a whole: 'open' or 'close' moves one part",)
    way = _DIRECTION.search(" ".join(words))
    if way and not (verb == "pass" and way[0].endswith(SIDES)):  # to the left: to the left hand
        verb_notes += (f"'{way[0]}' is not followed: the networks choose the direction",)
    verb_notes += tuple(
        f"'{fingers}' is not followed: the networks choose the fingers"
        for fingers in dict.fromkeys(_FINGERS.findall(" ".join(words)))
    )
    hands, hand_notes = asked_hands(made_of, words, verb)
    notes = (*verb_notes, *left_out, *hand_notes, *rate_notes, *amount_notes)
    if stated is not None:
        other = length is None and frames != stated.frames
        instead = f", but {frames} are asked for" if other else ""
        notes += (f"the length is {stated.frames} frames by '{stated.words}'{instead}",)
    giver = asked_giver(" ".join(words)) if (verb, hands) == ("pass", "both hands") else None
    return Prompt(sentence, hands, verb, known, notes, made_of, length, giver)


def without_ruled_out_verbs(
    sentence: str, words: Sequence[str]
) -> tuple[list[str], tuple[str, ...]]:
    """Words without ruled out verbs, and a note on each; `InputError` if no verb is left."""
    kept, left_out = list(words), []
    for index in reversed(range(len(words))):
        start = index + rules_out(kept, index)
        used = kept[start : start + 1] in (["use"], ["using"])
        of_hands = used and no_hand_in(" ".join(kept[index:]))
        if start > index and starts_with_verb(kept[start:]) and not of_hands:
            stop = start + 1 + (kept[start + 1 : start + 2] in (["it"], ["them"]))
            left_out.append(" ".join(kept[index:stop]))
            del kept[index:stop]
    if left_out and not named_verbs(as_meant(kept)):
        only = f"found only '{left_out[-1]}'; say what they do, such as {EXAMPLE}"
        raise refused(sentence, f"an action that hands do, {only}")
    return kept, tuple(f"'{phrase}' is not followed" for phrase in reversed(left_out))


def starts_with_verb(words: Sequence[str]) -> bool:
    """Whether words start with a verb, whose particle may follow later."""
    meant = as_meant(words)
    more = named_verbs(meant).keys() - named_verbs(meant[1:]).keys()
    return bool(more or named_verbs(meant[:1]))


def with_other_hand(sentence: str, words: list[str], ruled_out: frozenset[Side]) -> list[str]:
    """Words, with the other hand added if they rule out one hand and name none.

    Raises:
        InputError: they rule out both hands, or a hand that they also name.
    """
    text, found = " ".join(words), ""
    if len(ruled_out) == len(SIDES):
        found = "neither of the two"
    elif none := no_hand_in(text):
        found = f"'{none}'"
    elif ruled_out and (_BOTH.search(text) or any(f"{side} hand" in text for side in ruled_out)):
        found = f"the {min(ruled_out)} hand both named and ruled out"
    if found:
        raise refused(sentence, f"hands that act, found {found}; name those that do")
    if not ruled_out or any(pattern.search(text) for pattern in _ONE.values()):
        return words
    return [*words, "with", "the", next(side for side in SIDES if side not in ruled_out), "hand"]


def asked_verb(sentence: str, words: Sequence[str]) -> tuple[str, bool, tuple[str, ...]]:
    """The verb of synthetic actions that is meant, whether the sentence names it, and notes."""
    named, meant, model = named_verbs(words), words, shipped_model()
    if not named:
        meant = as_meant(words)
        named = named_verbs(meant)
    found = zip(model.verbs, model.read(sentence).verbs[0].tolist(), strict=True)
    scores = defaultdict(float, found)  # 0 for verbs that are newer than the weights
    if not named:
        nearest = max(VERBS, key=lambda verb: scores[verb])
        return nearest, False, (f"no verb of the sentence is known; the nearest is '{nearest}'",)
    chosen = max(named, key=lambda verb: scores[verb])
    phrase_words = named[chosen].split()
    notes = tuple(
        f"'{word}' is read as '{other}'"
        for word, other in zip(words, meant, strict=True)
        if word != other and other in phrase_words
    )
    others = [phrase for verb, phrase in named.items() if verb in VERBS and verb != chosen]
    notes += tuple(
        f"one action is made, '{named[chosen]}'; '{phrase}' is left out"
        for phrase in (*others, *further_actions(words, chosen))
    )
    if chosen in VERBS:
        return chosen, True, notes
    nearest = OTHER_VERBS[chosen][0]
    note = f"'{named[chosen]}' was never learned; the nearest verb is '{nearest}'"
    return nearest, False, (note, *notes)


def named_verbs(words: Sequence[str]) -> dict[str, str]:
    """Verbs of `_VERB_WORDS` that words name, with the words that name them.

    A longer phrase takes precedence over a shorter one in it ("put in" over "put"). The particle of
    a phrase may follow later in the sentence.
    """
    found: dict[str, str] = {}
    for start, word in enumerate(words):
        pair = list(words[start - 1 : start + 1])
        if start and (pair[0] in _NO_VERB_AFTER or pair in _ONE_HANDED):
            continue
        for phrase, verb in _phrases().get(word, ()):
            rest = phrase.split()[1:]
            after = list(words[start + 1 :])
            later = len(rest) == 1 and rest[0] in PARTICLES and _follows(rest[0], after)
            if after[: len(rest)] == rest or later:
                found.setdefault(verb, phrase)
                break
    return found


def further_actions(words: Sequence[str], chosen: str) -> list[str]:
    """What hands are to do after "and" or "then" by verbs that no synthetic action has, in words:
    those of `OTHER_VERBS` but `chosen`, and unknown ones before their object."""
    found, words = [], [word for word in words if not word.endswith("ly")]
    for before, *rest in (words[start:] for start in range(len(words) - 1)):
        if before not in _NEXT or rest[0] in SMALL_WORDS:
            continue
        if starts_with_verb(rest):
            named = named_verbs(rest).items() - named_verbs(rest[1:]).items()
            found += [p for verb, p in named if verb not in (*VERBS, *_GO_WITH_ANY, chosen)]
        elif rest[1:2] and rest[1] in _OBJECT:
            found.append(rest[0])
    return found


def _follows(particle: str, words: Sequence[str]) -> bool:
    """Whether a particle is among words, and not as an adjective as in "the open drawer"."""
    before = ("", *words)
    return any(w == particle and before[n] not in DETERMINERS for n, w in enumerate(words))


def asked_hands(
    sentence: str, words: Sequence[str], verb: str
) -> tuple[HandsName, tuple[str, ...]]:
    """The hands that a sentence asks for: by its words, else as our encoder reads it."""
    text = " ".join(words)
    if found := _TO_ITSELF.search(text):
        twice = f"the {found[1]} hand twice; name the other one, or leave out where it goes"
        raise refused(sentence, f"two hands to pass something between, found {twice}")
    passed = verb == "pass" and asked_giver(text) and not _WITH_ONE.search(text)
    if passed or _BOTH.search(text):
        return "both hands", ()
    one: list[HandsName] = [hands for hands, pattern in _ONE.items() if pattern.search(text)]
    if len(one) == 2:
        both = "the left hand and the right hand; write 'both hands', or name one of them"
        raise refused(sentence, f"one choice of hands, found {both}")
    if one:
        return one[0], ()
    model, of_one = shipped_model(), _OF_ONE.search(text)  # "two fingers" are of one hand
    aimless = _DIRECTION.sub("", text)  # "to the left" names no hand
    read = "" if of_one else model.hands[int(model.read(aimless).hands[0].argmax())]
    if read == "left hand" or read == "right hand" or read == "both hands":
        return read, (f"the sentence names no hand plainly; it is read as '{read}'",)
    hands: HandsName = "both hands" if verb == "pass" and not of_one else "right hand"
    return hands, (f"the sentence names no hand; '{hands}' is taken",)


@cache
def _phrases() -> dict[str, tuple[tuple[str, str], ...]]:
    """All inflected verb phrases by their first word, longest first, each with its verb."""
    found: dict[str, list[tuple[str, str]]] = {}
    for verb, words in _VERB_WORDS.items():
        for phrase in (form for word in (*words, verb) for form in all_forms(word)):
            if phrase not in ("hand", "hands"):  # the hand that acts, nearly always
                found.setdefault(phrase.split()[0], []).append((phrase, verb))
    return {first: tuple(sorted(f, key=lambda each: -len(each[0]))) for first, f in found.items()}


def as_meant(words: Sequence[str]) -> list[str]:
    """Words with misspelt ones replaced by the known words that they resemble."""
    return [nearest_word(word, known_words()) or word for word in words]


@cache
def known_words() -> frozenset[str]:
    """All words of our lists on hands and objects."""
    verbs = [form for words in _VERB_WORDS.values() for word in words for form in forms(word)]
    nouns = [noun for words in NOUN_WORDS.values() for noun in words]
    listed = " ".join([*verbs, *nouns, *NOUN_WORDS, *THINGS, *ADJECTIVES])
    return frozenset(listed.split()) | SMALL_WORDS
