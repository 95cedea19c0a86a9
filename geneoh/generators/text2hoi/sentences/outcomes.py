"""Verbs that open or close by their outcome, as in "flip the lid open" and "twist the cap off"."""

import re
from collections.abc import Sequence

from geneoh.language.conjugation import all_forms, participle
from geneoh.language.vocabulary import VERB_WORDS

DETERMINERS = ("a", "an", "the", "this", "that", "my", "your", "his", "her", "its", "our", "their")
"""Words after which "open" and "closed" are adjectives and no outcome: "pull the open drawer"."""
_REMOVE, _ATTACH = ("remove", "unscrew", "detach"), ("put", "set", "place", "screw", "snap", "pop")
_TURN = ("turn", "twist")
_PULL, _PUSH = ("pull", "slide", "draw", "drag", "yank"), ("push", "slide", "shove", "press")
_MOVE = (
    *("push", "pull", "slide", "drag", "draw", "shove", "swing", "flip", "flick", "spin", "rotate"),
    *("roll", "tip", "tilt", "lift", "raise", "lower", "press", "tap", "poke", "hit", "knock"),
    *("kick", "slam", "bang", "pry", "prise", "crank", "nudge", "ease", "yank", "tug", "take"),
    *("get", "move", "bring", "fold", *_REMOVE, *_ATTACH, *_TURN),
)
_FORMS = {
    form: number for verb in _MOVE for number, form in reversed([*enumerate(all_forms(verb))])
}
"""The inflected form that a word is; of those that look alike ("put") the first."""


def _any_of(verbs: Sequence[str]) -> str:
    """A pattern for all forms of some verbs, as the group `verb`."""
    return rf"\b(?P<verb>{'|'.join(form for verb in verbs for form in all_forms(verb))})\b"


def _done_to_lid(verbs: Sequence[str]) -> str:
    """A pattern for a lid and some verbs in the passive: "the lid of the jar is being taken"."""
    past = "|".join(map(participle, verbs))
    return rf"(?P<before>\b{_LIDS}(?: (?:of|on)(?: [\w']+){{1,3}}?)?{_BE}) (?P<verb>{past})\b"


_STOP = "with|using|by|and|or|then|while|which|is|are|was|to|until|so|without|not|before|after"
_THE = "|".join(DETERMINERS)
_WORD = rf" (?!(?:{_STOP}|half)\b)[\w']+"
_THING = rf"(?P<thing>(?:{_WORD}){{0,6}} (?!(?:{_STOP}|{_THE}|half)\b)[\w']+)"
_ENDS = rf"(?=$| (?:{_STOP}|{_THE}|for|from|in|on|at|all|again|fully|\w+ly)\b)"
_LIDS = "(?:lid|cap|cover|cork|stopper|plug)"
_LID = rf"(?P<thing>(?: [\w']+){{0,3}}? {_LIDS})"
_DRAWER = r"(?P<thing>(?: [\w']+){0,3}? (?:drawer|tray))"
_IT = r"(?P<thing> (?:it|them))"
_BE = "(?: (?:is|are|was|were|be|being|been|gets|then|slowly|carefully))+"
_LAST = rf"(?=$| (?:{_STOP}|again|fully|\w+ly)\b)"
_IN_PLACE = r"\b(?! (?:the|a|my|your|this) (?:table|desk|shelf|floor|ground|counter)\b)"
_WAY = r"(?: all the way)?(?: (?:down|up|in|out|back|over|around|forward))?"
_HAND = r"(?P<hand>(?: (?:with|using)(?: \w+){1,2} hands?)?)"
_MOVED = rf"{_any_of(_MOVE)}(?P<thing>(?:{_WORD}){{1,6}}?){_WAY}{_HAND}"
_TO = "(?:in order |so as )?to (?P<aim>open|close|shut)"
_UNTIL = r"(?:until|till)(?: (?!with\b|and\b)[\w']+){0,4}? (?P<aim>open(?:ed|s)?|shuts?|close[ds])"
_PATTERNS = (
    (rf"{_any_of(_MOVE)}{_THING}?? (?P<outcome>open|shut|closed){_ENDS}", ""),
    (rf"{_any_of(_MOVE)}{_LID} off{_IN_PLACE}", "open"),
    (rf"{_any_of(_MOVE)} off{_LID}\b", "open"),
    (rf"{_any_of(_MOVE)}{_IT} off{_LAST}", "open"),
    (rf"{_done_to_lid(_MOVE)} off{_IN_PLACE}", "open"),
    (rf"{_any_of(_REMOVE)}{_LID}\b", "open"),
    (rf"{_any_of(_REMOVE)}{_IT}{_LAST}", "open"),
    (_done_to_lid(_REMOVE), "open"),
    (rf"{_any_of((*_ATTACH, *_TURN))}{_LID}(?: back)? on{_IN_PLACE}", "close"),
    (rf"{_any_of((*_ATTACH, *_TURN))}(?: back)? on{_LID}\b", "close"),
    (rf"{_any_of((*_ATTACH, *_TURN))}{_IT}(?: back)? on{_LAST}", "close"),
    (rf"{_done_to_lid((*_ATTACH, *_TURN))}(?: back)? on{_IN_PLACE}", "close"),
    (rf"{_any_of(_PULL)}{_DRAWER} out\b", "open"),
    (rf"{_any_of(_PULL)} out{_DRAWER}\b", "open"),
    (rf"{_any_of(_PUSH)}{_DRAWER}(?: back)? in{_LAST}", "close"),
    (rf"{_any_of(_PUSH)}(?: back)? in{_DRAWER}\b", "close"),
    (rf"{_MOVED} {_TO}(?: it| them)?{_LAST}", ""),
    (rf"{_MOVED} {_TO}(?= (?:{_THE}) )", "aim"),
    (rf"{_MOVED} {_UNTIL}{_LAST}", ""),
)
"""Patterns and the verbs that they mean ("": by the outcome; "aim": by the outcome, for the object
that follows, as in "lower the lid to close the box"); all but the first need two parts."""


def outcomes_as_verbs(words: Sequence[str], *, jointed: bool) -> list[str]:
    """Words of a sentence with "open" and "close" in place of verbs that have this outcome.

    "Flip the lid open" becomes "open the lid". Only if the object is `jointed`, verbs that take a
    lid off or put it on, or pull a drawer out or push it in, are replaced, and those that say what
    they are for ("to close it", "until it is shut"): a separate lid is lifted or put down. Phrases
    that `VERB_WORDS` lists, such as "push shut", stay.
    """
    sentence = " ".join(words)
    for pattern, verb in _PATTERNS if jointed else _PATTERNS[:1]:
        sentence = re.sub(pattern, lambda match, verb=verb: _with_outcome(match, verb), sentence)
    return sentence.split()


def _with_outcome(match: re.Match[str], verb: str) -> str:
    """The words of a match with the verb of its outcome, in the same inflected form."""
    said = match.groupdict("")
    moves, outcome = said["verb"], said.get("outcome") or said.get("aim")
    follows = verb == "aim"
    if outcome:
        verb = "open" if outcome.startswith("open") else "close"
        listed = (phrase.split() for phrase in VERB_WORDS[verb])
        if "outcome" in said and any(
            moves in all_forms(first) and rest == [outcome] for first, *rest in listed
        ):
            return match[0]
    if "before" in said:
        return f"{said['before']} {participle(verb)}"
    form, hand = all_forms(verb)[_FORMS[moves]], said.get("hand", "")
    return f"{hand} {form}".strip() if follows else f"{form}{said['thing']}{hand}"
