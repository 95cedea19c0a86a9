"""Inflected forms of English verbs, including phrasal verbs such as "put down"."""

import re
from itertools import pairwise

_VOWELS = "aeiou"
_DOUBLED = frozenset({"transfer", "uncap", "unplug", "unwrap", "unzip"})
"""Verbs of two syllables that double their last letter, as verbs of one syllable do."""
_IRREGULAR = """
    beat beaten, bend bent, bite bitten, break broken, bring brought, catch caught, cut cut,
    draw drawn, drink drunk, drive driven, eat eaten, feel felt, fight fought, fling flung,
    fly flown, get got, give given, go gone, grind ground, hang hung, hit hit, hold held, keep kept,
    lay laid, let let, make made, put put, read read, ring rung, rise risen, say said, see seen,
    set set, sew sewn, shake shaken, show shown, shut shut, slide slid, spin spun, split split,
    spread spread, stand stood, strike struck, sweep swept, swing swung, take taken, tear torn,
    throw thrown, tie tied, wear worn, wind wound, wring wrung, write written
"""
_PARTICIPLES: dict[str, str] = dict(re.findall(r"(\w+) (\w+)", _IRREGULAR))
"""Past participles that no rule gives."""
_OTHER_PAST = """
    beat beat, bite bit, break broke, draw drew, drink drank, drive drove, eat ate, fly flew,
    give gave, go went, ring rang, rise rose, see saw, sew sewed, shake shook, show showed,
    take took, tear tore, throw threw, wear wore, write wrote
"""
_PASTS: dict[str, str] = dict(re.findall(r"(\w+) (\w+)", _OTHER_PAST))
"""Simple pasts that are other words than the past participle."""


def gerund(verb: str) -> str:
    """The form in -ing: "putting down" of "put down"."""
    word, rest = _split(verb)
    if word.endswith("ie"):
        return f"{word[:-2]}ying{rest}"
    if word.endswith("e") and not word.endswith(("ee", "oe", "ye")):
        return f"{word[:-1]}ing{rest}"
    return f"{_stem(word)}ing{rest}"


def third_person(verb: str) -> str:
    """The third person singular: "carries" of "carry"."""
    word, rest = _split(verb)
    if _ends_in_y(word):
        return f"{word[:-1]}ies{rest}"
    hissing = word.endswith(("s", "x", "z", "ch", "sh", "o")) and not word.endswith("oo")
    return f"{word}{'es' if hissing else 's'}{rest}"


def participle(verb: str) -> str:
    """The past participle: "picked up" of "pick up", "shaken" of "shake"."""
    word, rest = _split(verb)
    if word in _PARTICIPLES:
        return f"{_PARTICIPLES[word]}{rest}"
    if _ends_in_y(word):
        return f"{word[:-1]}ied{rest}"
    return f"{word}d{rest}" if word.endswith("e") else f"{_stem(word)}ed{rest}"


def forms(verb: str) -> tuple[str, str, str, str]:
    """The verb itself, third person, gerund and past participle."""
    return verb, third_person(verb), gerund(verb), participle(verb)


def all_forms(verb: str) -> tuple[str, str, str, str, str]:
    """The `forms`, and the simple past: "shook" of "shake"."""
    word, rest = _split(verb)
    past = f"{_PASTS[word]}{rest}" if word in _PASTS else participle(verb)
    return *forms(verb), past


def _split(verb: str) -> tuple[str, str]:
    """The first word, which is inflected, and the rest with its leading space."""
    word, space, rest = verb.partition(" ")
    return word, space + rest


def _ends_in_y(word: str) -> bool:
    return word.endswith("y") and word[-2:-1] not in _VOWELS


def _stem(word: str) -> str:
    """The word, with its last letter doubled where the ending needs it."""
    syllables = sum(a in _VOWELS and b not in _VOWELS for a, b in pairwise(word))
    closed = (
        len(word) > 2
        and word[-1] not in f"{_VOWELS}wxy"
        and word[-2] in _VOWELS
        and word[-3] not in _VOWELS
    )
    return word + word[-1] if word in _DOUBLED or (closed and syllables == 1) else word
