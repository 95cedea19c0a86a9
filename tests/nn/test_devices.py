import pytest

from geneoh.errors import ConfigError
from geneoh.nn.devices import named_device


def test_the_processor_is_a_device():
    assert named_device("cpu").type == "cpu"


@pytest.mark.parametrize("name", ["meta", "hpu", "cuda:99", "CPU", ""])
def test_what_cannot_compute_here_is_refused(name):
    with pytest.raises(ConfigError, match=f"--device {name}: expected a device of this machine"):
        named_device(name)


def test_a_kind_of_device_that_does_not_exist_is_told_without_the_kinds_that_torch_knows():
    with pytest.raises(ConfigError, match="this machine, got an unknown kind; `geneoh info` lists"):
        named_device("gpu")
