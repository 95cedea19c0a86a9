"""Settings of every test run, and the devices that tests of devices run on."""

import gc
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import pytest
import torch
from hypothesis import settings
from pretended_device import DEVICE, PretendedDevice
from shape_checks import begin_test, check_first_call

check_first_call()

# The tests' tensors are small: more threads only wait for each other.
torch.set_num_threads(1)

# The same examples in every run, and no deadline: the first call of a function pays its imports.
settings.register_profile("geneoh", derandomize=True, deadline=None, max_examples=30)
settings.load_profile("geneoh")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[Any]:
    """Make modules and tests without a search for garbage, which they are not, then or later.

    There are half a million of their objects, and each search would look at all of them.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup() -> None:
    """Check the first call of every function in each test, fixtures included."""
    begin_test()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Give each file to one worker, so that what its tests share is made once."""
    from xdist.scheduler import LoadFileScheduling

    config.option.loadscopereorder = False  # files of few tests are not the quick ones
    return LoadFileScheduling(config, log)


@pytest.fixture(params=["pretended", pytest.param("cuda", marks=pytest.mark.gpu)])
def device(request: pytest.FixtureRequest) -> Iterator[torch.device]:
    """A device beside the CPU: a pretended one, and CUDA where there is a GPU."""
    if request.param == "cuda":
        if not torch.cuda.is_available():
            pytest.skip("needs a CUDA device")
        yield torch.device("cuda")
    else:
        with PretendedDevice() as device:
            yield device


@pytest.fixture
def training_device(device: torch.device, monkeypatch: pytest.MonkeyPatch) -> torch.device:
    """Such a device for training, whose batches are made in another thread.

    A mode of torch is of one thread, so the other one pretends too.
    """
    from geneoh.training import loop

    if device == DEVICE:
        pool = partial(ThreadPoolExecutor, initializer=lambda: PretendedDevice().__enter__())
        monkeypatch.setattr(loop, "ThreadPoolExecutor", pool)
    return device
