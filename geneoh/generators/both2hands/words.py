"""English words that a sentence on hands of a body is made of."""

from functools import cache

from geneoh.generators.text2hoi import prompt
from geneoh.language.conjugation import forms
from geneoh.synthesis.gestures.one_handed import ONE_HANDED
from geneoh.synthesis.gestures.two_handed import TWO_HANDED

BODY_WORDS = """
    arm arms body chest chin clenched closed crossed curl curled ear ears elbow elbows extend
    extended extending eye eyes face facing fist forehead forearm forearms gesture gestures girl
    head high hip hips index inward joint joints knee knees knuckle knuckles lap leg legs little
    loosely lower lowered low middle move moves moving mouth nails naturally neck nose open opened
    outward palms pinky point pose position posture pressed raise raised relaxed rest resting rests
    ring separated shape shoulder shoulders sit sits sitting slightly stand standing stands still
    straight straightened stomach stretch stretched thigh thighs thumbs tip together touch touches
    touching upward waist walk walking walks wrist wrists
"""
"""Words of descriptions of hands and bodies, beside those of made gestures and objects."""


@cache
def known_words() -> frozenset[str]:
    """Words for what hands do: those of made gestures, of bodies, and of objects."""
    said = said_of_gestures()
    verbs = [form for phrase in said for part in phrase.split(" and ") for form in forms(part)]
    return prompt.known_words().union(BODY_WORDS.split(), " ".join(verbs).split())


def said_of_gestures() -> list[str]:
    """All phrases for made gestures, such as "wave hello"; each begins with its verb."""
    one = [phrase for gesture in ONE_HANDED.values() for phrase in gesture.says]
    return one + [phrase for gesture in TWO_HANDED.values() for phrase in gesture.said]
