import pytest

from geneoh.generators.text2hoi.learning.text_training import KINDS
from geneoh.generators.text2hoi.networks.library import shipped_model
from tools.sentence_accuracy import table


@pytest.mark.slow
def test_the_shipped_encoder_finds_verbs_and_hands_of_words_that_it_knows():
    head, _, *rows = table(shipped_model(), rounds=1)
    assert head == "| 512 sentences of each kind | verb | hands |"
    cells = [[cell.strip() for cell in row.strip("|").split("|")] for row in rows]
    assert [kind for kind, _, _ in cells] == list(KINDS)
    shares = {kind: (float(verb), float(hands)) for kind, verb, hands in cells}
    assert min(shares["seen words"]) > 0.97
    # its training knew the synonyms that others are measured with
    assert min(shares["unseen synonyms"]) > 0.9
