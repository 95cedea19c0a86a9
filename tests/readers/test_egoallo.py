"""EgoAllo's results beyond one sample in its published layout."""

import numpy as np
import pytest
from trees import written

import geneoh
from geneoh.errors import InputError
from geneoh.readers.base import ReaderOptions
from geneoh.readers.recordings import find_clips, read_clip, source_named


@pytest.fixture
def result(tmp_path):
    """A file of one sample, and the model of its body."""
    written("egoallo", tmp_path)
    return next(tmp_path.rglob("*.npz")), tmp_path / "SMPLH_NEUTRAL.pkl"


def change(path, **fields):
    with np.load(path) as file:
        np.savez(path, **{**file, **fields})


def test_each_sample_is_a_recording(result):
    path, body = result
    with np.load(path) as file:
        several = {name: file[name].repeat(2, 0) for name in file if len(file[name]) == 1}
    several["Ts_world_root"][1, :, 4:] += 1.0
    change(path, **several)
    source = source_named("egoallo")
    (clip,) = find_clips(source, [path.parent.parent])
    first, second = read_clip(source, clip, ReaderOptions(body=body))
    assert (first.name[-4:], second.name[-4:]) == ("_000", "_001")
    for one, other in zip(first.sequence.hands, second.sequence.hands, strict=True):
        np.testing.assert_allclose(other.wrist - one.wrist, 1.0, atol=1e-5)


def test_samples_of_other_lengths_and_a_file_without_a_body_are_refused(result):
    path, body = result
    with pytest.raises(InputError, match="pass --body with your neutral SMPL-H model"):
        geneoh.read("egoallo", path)
    with np.load(path) as file:
        change(path, betas=file["betas"][:, 1:])
    with pytest.raises(InputError, match="'body_quats' must be of as many samples and frames"):
        geneoh.read("egoallo", path, body=body)
