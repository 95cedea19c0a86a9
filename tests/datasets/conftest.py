"""One stand-in for MANO's files, for all tests of a run."""

import pytest
from trees import Scene, scene, write_mano


@pytest.fixture(scope="session")
def mano_dir(tmp_path_factory):
    return write_mano(tmp_path_factory.mktemp("mano"))


@pytest.fixture
def known_scene(mano_dir):
    def of(left: str = "as shipped") -> Scene:
        return scene(mano_dir, left)

    return of
