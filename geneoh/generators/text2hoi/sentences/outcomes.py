"""Verbs that open or close by their outcome, as in "flip the lid open" and "twist the cap off"."""

import re
from collections.abc import Sequence

from geneoh.language.conjugation import forms
from geneoh.language.vocabulary import VERB_WORDS

DETERMINERS = ("a", "an", "the", "this", "that", "my", "your", "his", "her", "its", "our", "their")
"""Words after which "open" and "closed" are adjectives and no outcome: "pull the open drawer"."""
_REMOVE, _ATTACH = ("remove", "unscrew", "detach"), ("put", "set", "place", "screw", "snap", "pop")
_TURN = ("turn", "twist")
_MOVE = (
    *("push", "pull", "slide", "drag", "draw", "shove", "swing", "flip", "flick", "spin", "rotate"),
    *("roll", "tip", "tilt", "lift", "raise", "lower", "press", "tap", "poke", "hit", "knock"),
    *("kick", "slam", "bang", "pry", "prise", "crank", "nudge", "ease", "yank", "tug", "take"),
    *("get", "move", "fold", *_REMOVE, *_ATTACH, *_TURN),
)
_FORMS = {form: number for verb in _MOVE for number, form in enumerate(forms(verb))}


def _any_of(verbs: Sequence[str]) -> str:
    """A pattern for all forms of some verbs, as the group `verb`."""
    return rf"\b(?P<verb>{'|'.join(form for verb in verbs for form in forms(verb))})\b"


_STOP = "with|using|by|and|or|then|while|which|is|are|was|to|until|so|without|not|before|after"
_THE = "|".join(DETERMINERS)
_WORD = rf" (?!(?:{_STOP}|half)\b)[\w']+"
_THING = rf"(?P<thing>(?:{_WORD}){{0,6}} (?!(?:{_STOP}|{_THE}|half)\b)[\w']+)"
_ENDS = rf"(?=$| (?:{_STOP}|{_THE}|for|from|in|on|at|all|again|fully|\w+ly)\b)"
_LID = r"(?P<thing>(?: [\w']+){0,3}? (?:lid|cap|cover|cork|stopper|plug))"
_IN_PLACE = r"\b(?! (?:the|a|my|your|this) (?:table|desk|shelf|floor|ground|counter)\b)"
_PATTERNS = (
    (rf"{_any_of(_MOVE)}{_THING}?? (?P<outcome>open|shut|closed){_ENDS}", ""),
    (rf"{_any_of(_MOVE)}{_LID} off{_IN_PLACE}", "open"),
    (rf"{_any_of(_MOVE)} off{_LID}\b", "open"),
    (rf"{_any_of(_REMOVE)}{_LID}\b", "open"),
    (rf"{_any_of((*_ATTACH, *_TURN))}{_LID}(?: back)? on{_IN_PLACE}", "close"),
    (rf"{_any_of((*_ATTACH, *_TURN))}(?: back)? on{_LID}\b", "close"),
)
"""Patterns and the verbs that they mean ("": by the outcome); all but the first need two parts."""


def outcomes_as_verbs(words: Sequence[str], *, jointed: bool) -> list[str]:
    """Words of a sentence with "open" and "close" in place of verbs that have this outcome.

    "Flip the lid open" becomes "open the lid". Verbs that take a lid off or put it on are replaced
    only if the object is `jointed`: a separate lid is lifted or put down. Phrases that `VERB_WORDS`
    lists, such as "push shut", stay.
    """
    said = " ".join(words)
    for pattern, verb in _PATTERNS if jointed else _PATTERNS[:1]:
        said = re.sub(pattern, lambda match, verb=verb: _with_outcome(match, verb), said)
    return said.split()


def _with_outcome(match: re.Match[str], verb: str) -> str:
    """The words of a match with the verb of its outcome, in the same inflected form."""
    moves, outcome = match["verb"], match.groupdict().get("outcome")
    if outcome:
        verb = "open" if outcome == "open" else "close"
        listed = (phrase.split() for phrase in VERB_WORDS[verb])
        if any(moves in forms(first) and rest == [outcome] for first, *rest in listed):
            return match[0]
    return forms(verb)[_FORMS[moves]] + (match["thing"] or "")
