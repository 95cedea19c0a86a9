import pytest

from geneoh.generators.text import learned_pieces, sentence_numbers, words_of

SAID = ["lift the mug with both hands", "lifting mugs", "put down the kettle"] * 20


@pytest.fixture(scope="module")
def tokenizer():
    return learned_pieces(SAID, 100)


def pieces(tokenizer, *sentences, longest=40):
    return sentence_numbers(tokenizer, sentences, longest)


def test_words_are_lower_case_without_punctuation():
    assert words_of("Lift the MUG, with one's left-hand!") == [
        *("lift", "the", "mug", "with", "one's", "left", "hand")
    ]
    assert words_of("one\u2019s hand") == ["one's", "hand"]
    assert words_of("Füße naïve") == ["füße", "naïve"]


def test_known_words_are_one_piece_and_others_several(tokenizer):
    assert pieces(tokenizer, "Lift the mug.").shape == (1, 3)
    assert pieces(tokenizer, "lfit").shape[1] > 1
    assert pieces(tokenizer, "kettles").shape[1] == 2


def test_pieces_hold_the_letters_of_a_word_that_was_never_seen(tokenizer):
    numbers = pieces(tokenizer, "mughead")[0].tolist()
    assert "".join(tokenizer.id_to_token(n) for n in numbers) == "_mughead"


def test_short_sentences_are_filled_up_and_long_ones_cut(tokenizer):
    both = pieces(tokenizer, "lift", "lift the mug with both hands", longest=4)
    assert both.shape == (2, 4)
    assert both[0, 1:].tolist() == [0, 0, 0]
    assert 0 not in both[1]


def test_a_sentence_without_words_is_one_unknown_piece(tokenizer):
    empty, strange = pieces(tokenizer, "", "本を持ち上げる")
    assert empty[0] == tokenizer.token_to_id("?")
    assert tokenizer.token_to_id("?") in strange


def test_the_same_sentences_give_the_same_vocabulary(tokenizer):
    assert learned_pieces(SAID, 100).to_str() == tokenizer.to_str()


@pytest.mark.parametrize("count", [2, 3, 10, 100])
def test_a_vocabulary_has_no_more_pieces_than_are_asked_for(count):
    few = learned_pieces([*SAID, "na\u00efve \u53f3\u624b"], count)
    assert few.get_vocab_size() <= count
    assert int(pieces(few, *SAID[:3]).max()) < count
