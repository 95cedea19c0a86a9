"""Small clips, and batches of them that are cleaned by a fake."""

import fake_cleaning
import pytest

from geneoh.batch import run
from geneoh.batch.cleaning import BatchOptions
from geneoh.batch.clips import find_batch_clips
from geneoh.pipeline.options import Options


@pytest.fixture
def faked(monkeypatch):
    """Have every clip cleaned by the fake, in workers too."""
    monkeypatch.setattr(run, "clean_clip", fake_cleaning.clean_clip)
    monkeypatch.setattr("geneoh.batch.cleaning.denoise", fake_cleaning.denoise)


@pytest.fixture
def clips(tmp_path):
    """A folder of four clips with their meshes."""
    fake_cleaning.write_clips(tmp_path / "in", 4)
    return tmp_path / "in"


@pytest.fixture
def clean(tmp_path, faked):
    """Clean what is in a folder into the folder out."""

    def cleaned(folder, out="out", options=None, reading=None, meshes=(), **how):
        batch = BatchOptions(tmp_path / out, options or Options(), reading or {})
        return run.clean_batch(find_batch_clips([folder], None, batch.folder, meshes), batch, **how)

    return cleaned
