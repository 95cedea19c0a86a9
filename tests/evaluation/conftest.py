"""Short clips of the example recording as cases."""

import pytest
from short_clips import example, short_clip

from geneoh.evaluation.cases import Case
from geneoh.evaluation.protocols.clips import Clip
from geneoh.sequence.sequence import Sequence


@pytest.fixture(scope="session")
def recording() -> Sequence:
    """146 frames of a left hand that uses a tool."""
    return example()


@pytest.fixture(scope="session")
def short() -> Sequence:
    """Ten frames in which the tool is held and moved."""
    return short_clip()


@pytest.fixture(scope="session")
def clean_case(short) -> Case:
    """The clip as its own noisy input."""
    return Case("taco", Clip("short", lambda: short), "clean", 11)


@pytest.fixture(scope="session")
def noisy_case(short) -> Case:
    """The clip under the papers' Gaussian noise."""
    return Case("taco", Clip("short", lambda: short), "gauss", 11)
