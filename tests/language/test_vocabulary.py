from pathlib import Path

import pytest

from geneoh.language.vocabulary import VERB_WORDS, noun_of
from geneoh.synthesis.shapes.families import FAMILIES

SCANS = Path(__file__).parents[2] / "examples" / "objects"


def test_every_verb_of_the_engine_has_words_that_name_no_other_verb():
    words = [word for several in VERB_WORDS.values() for word in several]
    assert len(words) == len(set(words))


def test_every_object_has_a_noun_of_plain_words():
    scans = [path.stem for path in SCANS.glob("*.ply")]
    assert len(scans) > 90
    for name in [*FAMILIES, *scans]:
        noun = noun_of(name)
        assert noun
        assert noun.replace(" ", "").isalpha(), (name, noun)


@pytest.mark.parametrize(
    ("name", "noun"),
    [
        ("gso_black_razer_mouse", "mouse"),
        ("ycb_065-a_cups", "cup"),
        ("ycb_058_golf_ball", "ball"),
        ("gso_porcelain_salad_plate", "plate"),
        ("loop_tool", "shears"),
        ("wine_glass", "wine glass"),
        ("gso_nintendo_3ds", "game console"),
        ("wine_glass_02", "wine glass"),
        ("kettle_", "kettle"),
        ("000003", "object"),
    ],
)
def test_noun_of_names(name, noun):
    assert noun_of(name) == noun
