"""The numbers of a sentence: its length, such as "for two seconds", and those not followed."""

import re
from dataclasses import dataclass
from fractions import Fraction

from geneoh.generators.sentences import refused
from geneoh.generators.text2hoi.networks.autoencoders import SHORTEST_ACTION
from geneoh.synthesis.actions.action import FPS, LONGEST

_SMALL = (
    *("zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten"),
    *("eleven", "twelve", "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen"),
    "nineteen",
)
_TENS = ("twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety")
_VALUES = {word: value for value, word in enumerate(_SMALL)}
_VALUES |= {word: 10 * value for value, word in enumerate(_TENS, 2)}
# "quarters" comes first, as a shorter word before it would be found in its place
_VALUES |= {"a": 1, "an": 1, "couple": 2, "half": 0.5, "quarters": 0.25, "quarter": 0.25}
_UNITS = {"frame": 1.0, "minute": 60 * FPS, "milli": FPS / 1000, "ms": FPS / 1000}
"""Frames of each unit; all other units are seconds."""
_WORD = "|".join((*_VALUES, "hundred"))
_FRACTION = r"(?:\d{1,3} (?:and )?)?\d{1,3}/[1-9]\d{0,2}"
_DIGITS = r"\d{1,9}(?:[.,]\d{1,9})?(?:[ -]and[ -]a[ -]half)?"
_NUMBER = rf"{_FRACTION}|{_DIGITS}|(?:{_WORD})(?:[ -](?:(?:and|of)[ -])?(?:{_WORD}))*"
_RANGE = r"(?: to | or | - ?|(?<!ty)- ?(?!(?:and|an?|half|quarters?|hundred)\b)|-(?=\w+ty\b))"
"""What stands between the ends of a range: the hyphens of "twenty-five" and "half-a" do not."""
_ABOUT = (
    r"(?:(?:about|around|exactly|roughly|almost|nearly|only|just|at least|at most|more than"
    r"|less than) )*"
)
_BEFORE = rf"\b(?:(?:for|in|within|over|during|lasting|lasts|taking|takes) )?{_ABOUT}"
_STATED = re.compile(
    rf"(?P<words>(?P<before>{_BEFORE})(?:\b(?:{_NUMBER}){_RANGE})?"
    rf"(?P<minus>(?<!\S)-|\bminus )?(?P<number>\b(?:{_NUMBER}))"
    r"(?: of)?(?: an?)?(?: |-)?"
    r"(?P<unit>milliseconds?|msecs?|ms|seconds?|secs?|s|frames?|minutes?|min)\b"
    r"(?P<half> and a half\b)?(?: long)?)",
    re.IGNORECASE,
)
_RATE = re.compile(
    rf"\b(?:at |in )?{_ABOUT}(?P<number>\b(?:{_NUMBER}))(?: |-)?"
    r"(?:fps|frames? (?:a|per|every|each) sec(?:ond)?|frames? ?/ ?s(?:ec(?:ond)?)?)\b",
    re.IGNORECASE,
)
_AMOUNT = re.compile(
    rf"\b(?:by )?{_ABOUT}(?!an? )(?:(?:{_NUMBER}){_RANGE})?(?:{_NUMBER})(?: |-)?"
    r"(?:[mck]?m|(?:milli|centi|kilo)?met(?:er|re)s?|inch(?:es)?|feet"
    r"|deg(?:ree)?s?|\u00b0|rad(?:ian)?s?|times|rounds|turns)(?!\w)"
    r"|\b(?:twice|thrice)\b",
    re.IGNORECASE,
)
_BARE_POINT = re.compile(r"(?<![\w.])\.(?=\d)")  # of ".5 seconds"
_NO_LENGTH = re.compile(r"\b(after|every|each|ago|until|the)$", re.IGNORECASE)
"""Words after which a time is not the length: "after two seconds"."""


@dataclass(frozen=True)
class Stated:
    """A length as a sentence states it."""

    words: str
    frames: int


def stated_length(sentence: str) -> tuple[str, Stated | None]:
    """A sentence without the length that it states, and that length at 30 frames a second.

    Raises:
        InputError: the sentence states more than one length.
    """
    whole = _BARE_POINT.sub("0.", sentence)
    found = [match for match in _STATED.finditer(whole) if _is_length(match)]
    if not found:
        return sentence, None
    if len(found) > 1:
        listed = " and ".join(f"'{match['words']}'" for match in found)
        raise refused(sentence, f"one length, found {listed}; keep one of them")
    (match,) = found
    each = next(
        (size for unit, size in _UNITS.items() if match["unit"].lower().startswith(unit[:3])), FPS
    )
    rest = whole[: match.start()] + whole[match.end() :]
    frames = round(each * (number_of(match["number"]) + (0.5 if match["half"] else 0)))
    return " ".join(rest.split()), Stated(match["words"], -frames if match["minus"] else frames)


def without_rate(sentence: str) -> tuple[str, tuple[str, ...]]:
    """A sentence without the frame rate that it states, and a note where that is another one."""
    match = _RATE.search(sentence)
    if match is None:
        return sentence, ()
    rest = sentence[: match.start()] + sentence[match.end() :]
    note = f"'{match[0].strip()}' is not followed: the clip has {FPS:g} frames a second"
    return " ".join(rest.split()), () if number_of(match["number"]) == FPS else (note,)


def without_amounts(sentence: str) -> tuple[str, tuple[str, ...]]:
    """A sentence without distances, angles and counts, and a note on each: "10 cm", "twice"."""
    whole = _BARE_POINT.sub("0.", sentence)
    found = [match[0].strip() for match in _AMOUNT.finditer(whole)]
    rest = " ".join(_AMOUNT.sub(" ", whole).split()) if found else sentence
    return rest, tuple(
        f"'{words}' is not followed: the networks choose how far and how often" for words in found
    )


def _is_length(match: re.Match[str]) -> bool:
    """Whether a matched time is the length; in "a second cup", "lift a frame" and "after two
    seconds" it is not."""
    named = match["unit"].lower() in ("second", "frame", "minute")
    alone = named and match["number"].lower() in ("a", "an", "one")
    before = match.string[: match.start()].rstrip()
    letter = match["unit"] in "sS" and not match["number"][0].isdecimal()
    return not (letter or (alone and not match["before"]) or _NO_LENGTH.search(before))


def number_of(text: str) -> float:
    """The number in digits or words: "2.5", "1,500", "1 1/2", "two-and-a-half", "a hundred"."""
    text = re.sub(r"\bone[ -]half\b", "half", text.lower())
    if text[0].isdecimal():
        text = re.sub(r"[ -]and[ -]a[ -]half$", " 1/2", text).replace(" and ", " ")
        text = re.sub(r"^(\d{1,3}),(?=\d{3}$)", r"\1", text)  # a comma between thousands
        return float(sum(Fraction(part) for part in text.replace(",", ".").split()))
    words = [word for word in re.split(r"[ -]", text) if word not in ("and", "of")]
    total = last = 0.0
    for word in words:
        if word == "hundred":
            total = 100 * max(total, 1)
        elif word == "quarters":  # "three quarters"
            total += last * (_VALUES[word] - 1)
        elif not (word in ("a", "an") and len(words) > 1):  # "half a", "a couple", "and a half"
            total, last = total + _VALUES[word], _VALUES[word]
    return float(total)


def length_in_frames(sentence: str, stated: Stated | None) -> int | None:
    """The stated length, if there is one; `InputError` where no clip can be so long or short."""
    if stated is None or SHORTEST_ACTION <= stated.frames <= LONGEST:
        return None if stated is None else stated.frames
    known = f"a length of {SHORTEST_ACTION} to {LONGEST} frames, {LONGEST / FPS:g} seconds at most"
    raise refused(sentence, f"{known}, found '{stated.words}'; say another one or pass --frames")
