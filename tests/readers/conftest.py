"""One stand-in for MANO's files, for all tests of a run."""

import pytest
from trees import write_mano


@pytest.fixture(scope="session")
def mano_dir(tmp_path_factory):
    return write_mano(tmp_path_factory.mktemp("mano"))
