"""Evaluation of a case whose tensors are on another device: pretended, and CUDA with a GPU."""

import pytest
import quick_presets
import torch
from pretended_device import DEVICE

from geneoh.evaluation import methods
from geneoh.evaluation.cases import Case
from geneoh.evaluation.protocols.clips import Clip
from geneoh.evaluation.scores import CaseScorer, ScoringConfig
from geneoh.fitting.fit import FitConfig
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
QUICK = FitConfig(iterations=2, contact_rounds=1)


@pytest.mark.parametrize("name", METHODS)
def test_a_case_is_scored_alike_on_every_device(name, short, device, monkeypatch):
    quick_presets.use(monkeypatch)
    monkeypatch.setattr(methods, "FitConfig", lambda: QUICK)
    few = short[:4]
    found = []
    for place in (torch.device("cpu"), device):
        case = Case("taco", Clip("short", lambda place=place: few.to(place)), "gauss", 11)
        cleaned = METHODS[name](case, place)
        assert cleaned.joints.device.type == place.type
        found.append(CaseScorer(case, ScoringConfig(close_frames=1)).score(name, cleaned, 0.0))
    here, there = found
    if device == DEVICE:
        assert there == here
    assert there.values["mpjpe_mm"] == pytest.approx(here.values["mpjpe_mm"], abs=0.1)
