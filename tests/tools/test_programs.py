"""The programs of tools/, which nothing that ships imports."""

import importlib
import pkgutil

import pytest

import tools
from tools.noisy_objects.clips import RECORDING, clip_of, symmetry_of, with_noisy_object
from tools.noisy_objects.limits import limits_of

MODULES = [module.name for module in pkgutil.walk_packages(tools.__path__, "tools.")]


@pytest.mark.parametrize("name", [name for name in MODULES if not name.endswith("__main__")])
def test_every_program_finds_what_it_imports(name):
    importlib.import_module(name)


def test_solvers_that_know_more_of_the_object_leave_less_of_its_noise():
    clean, symmetry = clip_of(RECORDING)[30:70], symmetry_of(RECORDING)
    noisy = with_noisy_object(clean, "shaky_2", 0, symmetry)
    given, _, _, filtered, informed, moved = limits_of(clean, noisy.object, "shaky_2", symmetry)
    assert moved < informed < filtered < given
