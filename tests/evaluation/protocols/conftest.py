"""Data sets in their published layout, long enough for several windows."""

from pathlib import Path

import pytest
import trees

from geneoh.evaluation.protocols.clips import recordings_of
from geneoh.evaluation.protocols.datasets import PROTOCOLS

FRAMES = 40


@pytest.fixture(scope="session")
def mano_dir(tmp_path_factory):
    return trees.write_mano(tmp_path_factory.mktemp("mano"))


@pytest.fixture
def known_scene():
    """The interaction of the small trees, over some frames."""

    def of(frames: int = FRAMES) -> trees.Scene:
        return trees.scene(frames=frames)

    return of


@pytest.fixture
def tree(tmp_path, known_scene):
    """Write a data set by its name in `trees`, of some length; returns its root."""
    recordings_of.cache_clear()

    def build(name: str, frames: int = FRAMES) -> Path:
        getattr(trees, name)(tmp_path / name, known_scene(frames), False)
        return tmp_path / name

    return build


@pytest.fixture(autouse=True)
def no_data_sets_of_the_machine(monkeypatch):
    for protocol in PROTOCOLS.values():
        monkeypatch.delenv(protocol.variable, raising=False)
