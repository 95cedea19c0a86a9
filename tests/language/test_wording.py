import difflib

from draws import seeded

from geneoh.language.wording import chance, misspelt, one_of


def test_a_choice_is_one_of_the_options_and_all_of_them_come():
    generator = seeded()
    assert {one_of("abc", generator) for _ in range(50)} == set("abc")


def test_a_chance_of_none_never_comes_and_one_of_all_always_does():
    generator = seeded()
    assert not any(chance(0.0, generator) for _ in range(20))
    assert all(chance(1.0, generator) for _ in range(20))


def test_a_misspelling_changes_one_long_word_by_one_typing_error():
    said = ["the", "right", "hand", "lifts", "a", "mug"]
    for seed in range(50):
        wrong = misspelt(said, generator=seeded(seed))
        assert len(wrong) == len(said)
        changed = [(a, b) for a, b in zip(said, wrong, strict=True) if a != b]
        assert len(changed) <= 1
        for before, after in changed:
            assert len(before) >= 4
            assert abs(len(before) - len(after)) <= 1
            assert difflib.SequenceMatcher(None, before, after).ratio() >= 0.6


def test_short_words_are_never_misspelt():
    assert misspelt(["a", "mug", "is"], generator=seeded()) == ["a", "mug", "is"]
