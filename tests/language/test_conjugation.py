import pytest

from geneoh.language.conjugation import all_forms, forms


@pytest.mark.parametrize(
    "said",
    [
        "open, opens, opening, opened",  # "openning" in the tables of Text2HOI
        "take out, takes out, taking out, taken out",  # "takes take"
        "hand over, hands over, handing over, handed over",
        "carry, carries, carrying, carried",
        "chop, chops, chopping, chopped",
        "drain, drains, draining, drained",
        "empty, empties, emptying, emptied",
        "fly, flies, flying, flown",
        "pour from, pours from, pouring from, poured from",
        "press, presses, pressing, pressed",
        "put in, puts in, putting in, put in",
        "see, sees, seeing, seen",
        "catch, catches, catching, caught",
        "hit, hits, hitting, hit",
        "rise, rises, rising, risen",
        "set down, sets down, setting down, set down",
        "shake, shakes, shaking, shaken",
        "shoo, shoos, shooing, shooed",
        "squeeze, squeezes, squeezing, squeezed",
        "stand up, stands up, standing up, stood up",
        "strike, strikes, striking, struck",
        "throw, throws, throwing, thrown",
        "tie, ties, tying, tied",
        "tip, tips, tipping, tipped",
        "transfer, transfers, transferring, transferred",
        "type, types, typing, typed",
        "unwrap, unwraps, unwrapping, unwrapped",
        "wear, wears, wearing, worn",
    ],
)
def test_forms_of_a_verb(said):
    verb, *_ = said.split(", ")
    assert ", ".join(forms(verb)) == said


@pytest.mark.parametrize(
    ("verb", "past"),
    [("shake", "shook"), ("take out", "took out"), ("hold", "held"), ("pour from", "poured from")],
)
def test_the_simple_past_may_be_another_word_than_the_participle(verb, past):
    assert all_forms(verb) == (*forms(verb), past)
