import pytest
import torch
from draws import seeded

from geneoh.generators.text2hoi.sentences import captions
from geneoh.generators.text2hoi.sentences.captions import (
    HANDS_CLASSES,
    NOUN_CLASSES,
    VERB_CLASSES,
    disturbed,
    draw_sentences,
    vocabulary,
)
from geneoh.generators.text2hoi.sentences.english import OTHER_VERBS
from geneoh.language.vocabulary import VERB_WORDS
from geneoh.synthesis.actions.action import VERBS


def test_every_verb_of_the_engine_has_a_withheld_synonym_and_others_to_learn_from():
    for verb in VERBS:
        assert len(captions.UNSEEN[verb]) == 1
        assert len(captions.SEEN_WORDS[verb]) >= 5
    listed = {word for words in VERB_WORDS.values() for word in words}
    assert listed >= captions.WITHHELD


def test_no_word_belongs_to_two_verbs():
    words = [word for several in captions.WORDS.values() for word in several]
    assert sorted(words) == sorted(set(words))


def test_other_verbs_name_a_verb_of_the_engine_as_the_nearest():
    assert {words[0] for words in OTHER_VERBS.values()} <= set(VERBS)


def test_disturbed_sentences_lose_small_words_but_none_that_names_hands():
    said = "the cup is by the two or the left or on both"
    lost = set()
    for seed in range(80):
        words = disturbed(said, generator=seeded(seed)).replace(" ", "").replace("_", " ").split()
        lost |= set(said.split()) - set(words)
        assert {"cup", "two"} <= set(words)
    assert {"the", "or", "by"} & lost


@pytest.fixture(scope="module")
def tokenizer():
    return vocabulary(600, generator=seeded())


def test_drawn_sentences_hold_two_phrasings_of_each_meaning(tokenizer):
    drawn = draw_sentences(tokenizer, 40, 30, captions.SEEN_WORDS, generator=seeded(1))
    assert drawn.pieces.shape[:2] == (40, 2)
    assert drawn.pieces.shape[2] <= 30
    assert bool((drawn.pieces[:, :, 0] > 0).all())
    assert int(drawn.verb.max()) < len(VERB_CLASSES)
    assert int(drawn.hands.max()) < len(HANDS_CLASSES)
    assert int(drawn.noun.max()) < len(NOUN_CLASSES)
    assert bool((drawn.pieces[:, 0] != drawn.pieces[:, 1]).any(-1).float().mean() > 0.7)
    again = draw_sentences(tokenizer, 40, 30, captions.SEEN_WORDS, generator=seeded(1))
    assert torch.equal(drawn.pieces, again.pieces)


def test_the_vocabulary_is_that_of_its_seed(tokenizer):
    assert vocabulary(600, generator=seeded()).to_str() == tokenizer.to_str()
    assert tokenizer.get_vocab_size() == 600
