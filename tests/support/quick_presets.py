"""The presets in as few steps as still take every way through the code."""

from dataclasses import replace
from functools import partial

import pytest

from geneoh.fitting import subject
from geneoh.fitting.adam import AdamFitConfig
from geneoh.fitting.fit import fit_keypoints
from geneoh.fitting.fit_config import FitConfig
from geneoh.pipeline import options
from geneoh.pipeline.presets import Preset, preset


def use(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have every run take two steps wherever a preset takes more, and the fit to a track that has
    keypoints alone."""
    monkeypatch.setattr(options, "preset", quick)
    monkeypatch.setattr(subject, "fit_keypoints", partial(fit_keypoints, iterations=2))


def quick(name: str) -> Preset:
    """The preset of that name."""
    chosen = preset(name)
    fit = FitConfig(iterations=2, contact_rounds=1)
    if isinstance(chosen.fit, AdamFitConfig):
        fit = AdamFitConfig(rigid_steps=2, steps=2)
    return replace(chosen.with_steps(2), fit=fit)
