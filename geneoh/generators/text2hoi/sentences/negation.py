"""Hands and verbs that a sentence rules out: "without the left hand", "the left hand rests"."""

import re

from geneoh.choices import SIDES, Side

_OWN = "the|my|your|his|her|one's|their"
_NOT = (
    r"(?:without|not|never|no|avoid(?:ing)?|instead of|rather than|except|anything but|\w+n't|dont)"
)
_USE = rf"(?: (?:to|ever|using|use|with|by|for|help|of|moving|either|any|{_OWN}))*"
_ONE_OF = rf"(?P<side>left|right)(?: hand)?(?: (?:or|nor|and){_USE} (?P<other>left|right))? hand"
_HAND = re.compile(rf"\b(?:but |and )?{_NOT}{_USE} {_ONE_OF}\b")
_BARE = re.compile(
    rf"\b(?:but |and )?{_NOT}(?: (?:with|using|by|{_OWN}))* (?P<side>left|right)(?: one)?$"
)
_AT_REST = "idle|resting|at rest|motionless|unused"
_STILL = rf"(?:{_AT_REST}|still|away|free|down|empty|out(?: of (?:it|the way))?)"
_NO_ACT = r"(?:move|help|act|touch)\b(?! (?:the|a|an|his|her|my|your) )"
_NOTHING = rf"(?! (?:up|it|them|an?|this|that|(?:{_OWN}) (?!left|right))\b)"
"""After a verb: no object, as in "the left hand hangs the coat", but perhaps another hand."""
_RESTING = re.compile(
    rf"\b(?:(?:and|while|but|as|with) )?(?:(?:{_OWN}) )?(?P<side>left|right)(?: (?:hand|one))? "
    rf"(?:rests|does nothing|hangs(?: down)?{_NOTHING}|{_AT_REST}|(?:is|stays|remains) {_STILL}"
    rf"|(?:isn't|is not) (?:used|needed|moving)|(?:does|should|must)(?:n't| not) {_NO_ACT})"
    r"\b(?! (?:on|in)\b)"
)
_KEPT = re.compile(
    rf"\b(?:(?:and|while|but|by) )?(?:keep|keeps|keeping|leave|leaves|leaving) (?:(?:{_OWN}) )?"
    rf"(?P<side>left|right)(?: (?:hand|one))? {_STILL}\b(?! (?:on|in)\b)"
)
_NO_HAND = re.compile(rf"\bneither{_USE} hands?\b|\b{_NOT}(?:{_USE}| both)* (?:hands?|fingers)\b")
NEGATIONS = frozenset(("not", "no", "never", "without", "avoid", "avoiding", "dont", "cannot"))
"""Words that rule out the verb that follows, beside those that end in n't."""
BETWEEN = frozenset(("to", "be", "being", "ever", "even", "just", "actually", "really", "please"))
"""Words that may stand between such a word and its verb."""


def without_ruled_out(sentence: str) -> tuple[str, frozenset[Side]]:
    """The sentence without phrases that rule out a hand or let it rest, and the hands' sides."""
    sides: set[Side] = set()
    for pattern in (_HAND, _BARE, _KEPT, _RESTING):
        for match in pattern.finditer(sentence):
            found = match.groupdict().values()
            if pattern is not _BARE or "hand" in sentence.split():
                sides.update(side for side in SIDES if side in found)
                sentence = " ".join(sentence.replace(match[0], " ", 1).split())
    return sentence, frozenset(sides)


def no_hand_in(sentence: str) -> str:
    """The words that rule out every hand; empty if there are none."""
    match = _NO_HAND.search(sentence)
    return match[0] if match else ""


def rules_out(words: list[str], index: int) -> int:
    """The number of words from `index` on that rule out the verb after them; 0 for none."""
    word, after = words[index], words[index + 1 : index + 2]
    if (word, *after) in (("instead", "of"), ("rather", "than")):
        return 2
    if not (word in NEGATIONS or word.endswith("n't")) or after == ["only"]:
        return 0
    stop = index + 1
    while stop < len(words) and words[stop] in BETWEEN:
        stop += 1
    return stop - index
