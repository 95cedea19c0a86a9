import pytest
import torch
from draws import seeded

from geneoh.choices import HANDS
from geneoh.generators.text2hoi.sentences.captions import caption, captions
from geneoh.language.conjugation import forms
from geneoh.language.vocabulary import NOUN_WORDS, VERB_WORDS
from geneoh.synthesis.actions.action import VERBS


def test_four_phrasings_are_those_of_the_papers_example():
    assert captions("place", "book", "both hands") == [
        "Place a book with both hands.",
        "Placing a book with both hands.",
        "Both hands place a book.",
        "A book is placed by both hands.",
    ]


def test_one_hand_takes_the_verb_in_the_singular():
    assert captions("put down", "apple", "left hand") == [
        "Put down an apple with the left hand.",
        "Putting down an apple with the left hand.",
        "The left hand puts down an apple.",
        "An apple is put down by the left hand.",
    ]


def test_plural_nouns_take_no_article_and_are():
    assert captions("lift", "scissors", "right hand")[3] == "Scissors are lifted by the right hand."


def test_pouring_names_what_is_poured_from():
    assert captions("pour", "kettle", "right hand")[0] == "Pour from a kettle with the right hand."


def test_words_in_place_of_a_verbs_own_are_in_all_phrasings():
    said = (
        caption("pour", "milk", "right hand", generator=seeded(seed), synonyms=("pour",))
        for seed in range(60)
    )
    assert not any(" from milk" in sentence for sentence in said)


@pytest.mark.parametrize("hands", HANDS)
@pytest.mark.parametrize("verb", VERBS)
def test_free_captions_name_the_hands_and_a_word_of_the_verb(verb, hands):
    generator = torch.Generator().manual_seed(0)
    expected = {form.split()[0] for word in VERB_WORDS[verb] for form in forms(word)}
    nouns = {word.split()[-1] for word in NOUN_WORDS["mug"]}
    for _ in range(40):
        words = caption(verb, "mug", hands, generator=generator).lower().replace(",", "").split()
        words = [word.strip(".") for word in words]
        assert expected & set(words)
        assert nouns & set(words)
        if hands == "both hands":
            assert {"both", "two"} & set(words)
        else:
            assert hands.split()[0] in words


def test_one_generator_state_gives_one_caption_and_many_give_many():
    drawn = [
        caption("lift", "mug", "left hand", generator=torch.Generator().manual_seed(seed))
        for seed in (*range(30), *range(30))
    ]
    assert drawn[:30] == drawn[30:]
    assert len(set(drawn)) > 10


def test_hands_that_are_not_asked_for_are_not_named():
    generator = torch.Generator().manual_seed(0)
    for _ in range(40):
        said = caption("open", "laptop", None, generator=generator).lower()
        assert "hand" not in said
