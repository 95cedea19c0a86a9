from draws import seeded

from geneoh.synthesis.gestures import sentences
from geneoh.synthesis.gestures.one_handed import ONE_HANDED
from geneoh.synthesis.gestures.repertoire import REST_SAYS
from geneoh.synthesis.gestures.sentences import (
    JOINED,
    Doing,
    gerund_phrase,
    hand_sentence,
    joined_sentences,
    third_person_phrase,
)
from geneoh.synthesis.gestures.two_handed import TWO_HANDED

REST, WAVE = Doing(REST_SAYS, rests=True), Doing(("wave",))


def test_the_first_sentence_names_both_hands_plainly():
    said = joined_sentences(REST, WAVE, generator=seeded())
    assert said[0] == "the right hand waves, the left hand rests"
    assert len(said) == JOINED
    clap = Doing(TWO_HANDED["clap"].says)
    assert joined_sentences(clap, clap, generator=seeded())[0] == "both hands clap"


def test_every_free_sentence_tells_which_hand_waves(monkeypatch):
    monkeypatch.setattr(sentences, "MISSPELT", 0.0)
    for seed in range(40):
        for sentence in joined_sentences(REST, WAVE, generator=seeded(seed))[1:]:
            assert "right" in sentence.lower()
            assert "wav" in sentence.lower()


def test_a_sentence_of_one_hand_names_it():
    for seed in range(20):
        said = hand_sentence("left", WAVE, generator=seeded(seed)).lower()
        assert "left hand" in said
        assert "wav" in said


def test_both_verbs_of_a_phrase_are_inflected():
    assert third_person_phrase("open and close") == "opens and closes"
    assert gerund_phrase("grasp and release") == "grasping and releasing"


def test_no_two_gestures_are_said_alike():
    plain = [each.says[0] for each in (*ONE_HANDED.values(), *TWO_HANDED.values())]
    assert len(set(plain)) == len(plain)
