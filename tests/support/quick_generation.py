"""`geneoh.generate` in as few steps as still take every way through the code."""

from dataclasses import replace
from typing import Any

import pytest
import quick_presets

from geneoh.generators.text2hoi import generate
from geneoh.generators.text2hoi.physics import held_hands, settling
from geneoh.generators.text2hoi.sampling import Text2HoiSampling

STEPS = 2


def use(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have every clip drawn once, and its hands hold and cleaned, in two steps each."""
    monkeypatch.setattr(generate, "Text2HoiSampling", drawn_once)
    monkeypatch.setattr(held_hands, "GRASPS", replace(held_hands.GRASPS, steps=STEPS))
    monkeypatch.setattr(settling, "SETTLING", replace(settling.SETTLING, steps=STEPS))
    quick_presets.use(monkeypatch)


def drawn_once(**given: Any) -> Text2HoiSampling:
    """The settings of the sampler, with one motion in two steps."""
    return Text2HoiSampling(**given | {"steps": STEPS, "draws": 1})
