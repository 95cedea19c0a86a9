"""Data sets in their published layout, long enough for windows of 60 frames."""

from pathlib import Path

import pytest
import trees

from geneoh.evaluation.protocols import HOMES
from geneoh.evaluation.protocols.clips import recordings_of

FRAMES = 400


@pytest.fixture(scope="session")
def mano_dir(tmp_path_factory):
    return trees.write_mano(tmp_path_factory.mktemp("mano"))


@pytest.fixture(scope="session")
def known_scene(mano_dir):
    """The interaction of the small trees, over 400 frames and at a slower pace."""
    short, trees.FRAMES = trees.FRAMES, FRAMES
    try:
        return trees.scene.__wrapped__(mano_dir)
    finally:
        trees.FRAMES = short


@pytest.fixture
def tree(tmp_path, known_scene, monkeypatch):
    """Write a data set by its name in `trees`; returns its root."""
    monkeypatch.setattr(trees, "FRAMES", FRAMES)
    recordings_of.cache_clear()

    def build(name: str) -> Path:
        getattr(trees, name)(tmp_path / name, known_scene, False)
        return tmp_path / name

    return build


@pytest.fixture(autouse=True)
def no_data_sets_of_the_machine(monkeypatch):
    for home in HOMES.values():
        monkeypatch.delenv(home.variable, raising=False)
