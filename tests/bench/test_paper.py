"""Networks of the paper's sizes."""

import pytest
import torch
from torch import nn

from geneoh.bench import paper

PUBLISHED = {"motion": 34.2e6, "spatial": 35.1e6}
"""Active parameters of the released networks."""


@pytest.fixture(scope="module")
def networks():
    return paper.paper_networks()


@pytest.mark.parametrize("stage", PUBLISHED)
def test_networks_have_the_published_number_of_parameters(networks, stage):
    assert paper.parameter_count(networks[stage]) == pytest.approx(PUBLISHED[stage], rel=0.01)


def test_without_its_embedding_of_the_noise_level_motiondiff_has_the_papers_number(networks):
    level = paper.parameter_count(networks["motion"].level)
    assert paper.parameter_count(networks["motion"]) - level == pytest.approx(33.7e6, rel=0.01)


def test_each_network_answers_in_the_shape_of_its_question(networks):
    with torch.no_grad():
        for stage, width in (("motion", 63), ("spatial", 63), ("temporal", 256)):
            answer = networks[stage](torch.zeros(2, 5, width), torch.zeros(2))
            assert answer.shape == (2, 5, width)
        made = networks["autoencoder"](torch.zeros(5, 7, 69), torch.zeros(5, 7, 6))
    assert made.shape == (5, 7, 63)


def test_a_step_is_extrapolated_to_all_steps_and_points(monkeypatch):
    tiny = dict.fromkeys(("motion", "spatial", "temporal", "autoencoder"), nn.Linear(1, 1))
    monkeypatch.setattr(paper, "paper_networks", lambda: tiny)
    monkeypatch.setattr(paper, "times", lambda *_: {"seconds": 2.0, "processor": 1.0})
    told = []
    found = paper.measured_networks("cpu", lambda *now: told.append(now), points=4)
    assert found["motion"]["seconds"] == 400 * 2
    assert found["spatial"]["step"] == {"seconds": 1000.0, "processor": 500.0}
    assert found["spatial"]["processor"] == 200 * 500
    assert found["temporal"]["seconds"] == 100 * 2 + 2  # and one call of the autoencoder
    assert found["whole"]["seconds"] == 800 + 200_000 + 202
    assert found["whole"]["parameters"] == 4 * 2
    assert found["whole"]["points_timed"] == 4
    assert [done for _, done, _ in told] == [1, 2, 3]


def test_the_middle_of_several_times_counts_and_the_first_call_does_not():
    calls = []
    spent = paper.times(lambda: calls.append(0), "cpu")
    assert len(calls) == 1 + paper.TIMES
    assert 0 <= spent["seconds"] < 1
