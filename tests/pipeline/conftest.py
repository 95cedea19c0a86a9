"""The example recording and short pieces of it, shared by the pipeline's tests."""

from pathlib import Path

import pytest
import torch
import trees

import geneoh
from geneoh.readers.base import ReaderOptions
from geneoh.readers.recordings import read_one
from geneoh.sequence.sequence import Sequence

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="session")
def noisy() -> Sequence:
    """The recording's noisy twin, a left hand, 146 frames."""
    return geneoh.load(EXAMPLES / "taco_noisy.npz", obj=EXAMPLES / "taco_object.obj")


@pytest.fixture(scope="session")
def clean() -> Sequence:
    """The recording itself."""
    return geneoh.load(EXAMPLES / "taco_clean.npz", obj=EXAMPLES / "taco_object.obj")


@pytest.fixture(scope="session")
def arctic(tmp_path_factory) -> Sequence:
    """A box whose lid opens, with a hand at the seam of the two."""
    root = tmp_path_factory.mktemp("arctic")
    trees.arctic(root, trees.scene(), False)
    mano_dir = trees.write_mano(tmp_path_factory.mktemp("mano"))
    return read_one("arctic", root / "raw_seqs", ReaderOptions(mano_dir=mano_dir)).sequence


@pytest.fixture(autouse=True, scope="module")
def _one_thread():
    """Results that do not depend on how many cores share the sums."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)
