"""Which sentences on the hands of a body count as English."""

import pytest

from geneoh.errors import InputError
from geneoh.generators.both2hands.sentences import (
    check_sentence,
    known_gesture_words,
    said_of_gestures,
    unknown_words,
)
from geneoh.generators.text import words_of


@pytest.mark.parametrize(
    "sentence",
    [
        "the right hand waves, the left rests",
        "She claps.",
        "clapping",
        "conducting an orchestra",
        "picks his nose",
        "thmubs up wtih the right hnad",
        "Both hands naturally open, fingers slightly bent, palms facing inward",
        "his left hand forms a fist with the thumb extended, the right one is curled",
        "the right hand grips the mug",
        "kung fu punches the air",
    ],
)
def test_an_english_sentence_on_hands_is_taken(sentence):
    check_sentence(sentence)


@pytest.mark.parametrize(
    "sentence",
    [
        "die rechte Hand winkt, die linke ruht",
        "beide H\u00e4nde klatschen",
        "la main droite salue, la gauche repose",
        "la mano derecha saluda y la izquierda descansa",
        "\u53f3\u624b\u6325\u624b",
        "123",
        "asdf qwer",
        "ella aplaude",
        "elle applaudit",
        "il saute",
    ],
)
def test_a_sentence_in_another_language_is_refused(sentence):
    with pytest.raises(InputError, match="expected an English sentence on what hands do"):
        check_sentence(sentence)


@pytest.mark.parametrize(
    ("sentence", "found"),
    [
        ("the left hand waves and does not wave", "the left one is to wave and is not to wave"),
        ("Both hands clap; the right doesn't clap.", "the right one is to clap and is not"),
        ("Both hands clap; the right doesn\u2019t clap.", "the right one is to clap and is not"),
        ("waves without waving", "is to wave and is not to wave"),
    ],
)
def test_a_sentence_that_contradicts_itself_is_refused(sentence, found):
    with pytest.raises(InputError, match=found):
        check_sentence(sentence)


@pytest.mark.parametrize(
    "sentence",
    [
        "the left hand waves, the right does not wave",
        "waves with the left hand and does not wave with the right",
        "the left hand points up and does not point down",
        "the right hand waves, and then it does not wave",
        "the right hand does not wave",
        "the right hand waves without moving the fingers",
        "the left hand not only waves but waves to someone",
    ],
)
def test_what_one_hand_does_and_the_other_does_not_is_no_contradiction(sentence):
    check_sentence(sentence)


def test_all_words_of_made_gestures_are_known():
    assert {
        word for phrase in said_of_gestures() for word in words_of(phrase)
    } <= known_gesture_words()


def test_all_words_of_synthetic_gestures_are_known():
    for phrase in said_of_gestures():
        assert unknown_words(f"the left hand is to {phrase}") == ""
    assert unknown_words("the speaker does nothing with the left hand, the right stays loose") == ""


def test_of_many_unknown_words_the_first_are_named():
    note = unknown_words("the hand waves " + " ".join(f"qq{letter}xyz" for letter in "abcdefghij"))
    assert note.startswith("'qqaxyz', 'qqbxyz', ")
    assert note.endswith("... are not known and may be ignored")
