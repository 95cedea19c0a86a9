"""Short clips of the example recording as cases."""

from dataclasses import replace
from pathlib import Path

import pytest

import geneoh
from geneoh.evaluation.cases import Case
from geneoh.evaluation.protocols.clips import Clip
from geneoh.sequence.sequence import Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="session")
def recording() -> Sequence:
    """146 frames of a left hand that uses a tool."""
    return geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")


@pytest.fixture(scope="session")
def short(recording) -> Sequence:
    """Ten frames in which the tool is held and moved."""
    span = slice(60, 70)
    hand, moving = recording.hands[0], recording.object
    names = ("valid", "joints", "pose", "wrist")
    cut = replace(hand, **{name: getattr(hand, name)[span] for name in names})
    moved = replace(moving, rotation=moving.rotation[span], translation=moving.translation[span])
    return replace(recording, hands=(cut,), object=moved)


@pytest.fixture(scope="session")
def clean_case(short) -> Case:
    """The clip as its own noisy input."""
    return Case("taco", Clip("short", lambda: short), "clean", 11)


@pytest.fixture(scope="session")
def noisy_case(short) -> Case:
    """The clip under the papers' Gaussian noise."""
    return Case("taco", Clip("short", lambda: short), "gauss", 11)
