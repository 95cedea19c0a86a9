from dataclasses import replace

import pytest
import torch

from geneoh.errors import ConfigError
from geneoh.generators.text import PAD, TextConfig, TextNetwork

SMALL = TextConfig(pieces=30, piece_width=8, width=16, heads=2, verbs=5, hands=4, nouns=3)


def network():
    torch.manual_seed(0)
    return TextNetwork(SMALL).eval()


def test_padding_changes_nothing():
    model = network()
    plain = model(torch.tensor([[3, 7, 9]]))
    padded = model(torch.tensor([[3, 7, 9, PAD, PAD], [1, 2, 3, 4, 5]]))
    torch.testing.assert_close(plain[0], padded[0])


def test_the_order_of_words_counts():
    model = network()
    there, back = model(torch.tensor([[3, 7, 9], [9, 7, 3]]))
    assert not torch.allclose(there, back, atol=1e-3)


def test_vectors_are_centred_and_of_unit_variance():
    vector = network()(torch.tensor([[3, 7, 9]]))[0]
    torch.testing.assert_close(vector.mean(), torch.tensor(0.0), atol=1e-5, rtol=0)
    torch.testing.assert_close(vector.var(unbiased=False), torch.tensor(1.0), atol=1e-3, rtol=0)


def test_what_comes_after_the_longest_sentence_is_not_read():
    model = network()
    long = torch.randint(1, 30, (1, 60), generator=torch.Generator().manual_seed(0))
    torch.testing.assert_close(model(long), model(long[:, : SMALL.longest]))


def test_heads_have_a_score_for_every_class():
    model = network()
    reading = model.read(model(torch.tensor([[3, 7]])))
    assert [scores.shape[1] for scores in reading] == [5, 4, 3]


def test_a_width_that_its_heads_cannot_share_is_refused():
    with pytest.raises(ConfigError, match="got 16 for 3 heads; change one"):
        TextNetwork(replace(SMALL, heads=3))
