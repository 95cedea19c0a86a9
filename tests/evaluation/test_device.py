"""Evaluation of a case whose tensors are on another device: pretended, and CUDA with a GPU."""

import pytest
import quick_presets
import torch
from pretended_device import DEVICE

from geneoh.evaluation import methods
from geneoh.evaluation.cases import Case
from geneoh.evaluation.options import EvaluationOptions
from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.scores import CaseScorer
from geneoh.fitting.fit_config import FitConfig
from geneoh.pipeline.options import Options

METHODS = {
    "input": lambda case, device: methods.unchanged(case),
    "filter": lambda case, device: methods.filtered_hand(case, "one-euro", "parameters"),
    "optimisation": lambda case, device: methods.optimised_hand(case),
    "toch": lambda case, device: methods.predicted_hand(case, "toch"),
    "regression": lambda case, device: methods.predicted_hand(case, "regression"),
    "geneoh": lambda case, device: methods.denoised_hand(
        case, Options(preset="default", device=str(device))
    ),
}
ONE = EvaluationOptions("taco", close_frames=1)
QUICK = FitConfig(iterations=2, contact_rounds=1)


@pytest.fixture
def on_both(short, device):
    """The places of a case of four frames, and the case there."""
    places = (torch.device("cpu"), device)
    return [
        (place, Case("taco", Clip("short", lambda to=place: short[:4].to(to)), "gauss", 11))
        for place in places
    ]


@pytest.mark.parametrize("name", METHODS)
def test_a_method_cleans_alike_on_every_device(name, on_both, monkeypatch):
    quick_presets.use(monkeypatch)
    monkeypatch.setattr(methods, "FitConfig", lambda: QUICK)
    here, there = (METHODS[name](case, place).joints for place, case in on_both)
    assert (here.device.type, there.device.type) == tuple(place.type for place, _ in on_both)
    apart = (there.cpu() - here).norm(dim=-1)
    if there.device == DEVICE:
        assert float(apart.max()) == 0
    assert float(apart.mean()) < 1e-4


def test_a_case_is_scored_alike_on_every_device(on_both, device):
    here, there = (
        CaseScorer(case, ONE).score("input", methods.unchanged(case), 0.0) for _, case in on_both
    )
    if device == DEVICE:
        assert there == here
    assert there.values["mpjpe_mm"] == pytest.approx(here.values["mpjpe_mm"], abs=0.1)
