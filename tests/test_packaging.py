"""The package list in pyproject.toml, the wheel and the tree say the same."""

import subprocess
import sys
from pathlib import Path

import pytest

import geneoh

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[1]
SETUPTOOLS = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
INSTALLED_AS = {
    "geneoh": "geneoh",
    "examples": "geneoh.examples",
    "cli": "geneoh_cli",
    "configs": "geneoh_cli.configs",
}


def packages_of(folder: str) -> set[str]:
    """Dotted installed names of a top folder and of every folder with Python files below it."""
    found = {path.parent.relative_to(ROOT / folder) for path in (ROOT / folder).rglob("*.py")}
    return {".".join((INSTALLED_AS[folder], *path.parts)) for path in found}


def test_every_folder_with_code_is_a_listed_package():
    tree = set().union(*(packages_of(folder) for folder in INSTALLED_AS))
    assert tree == set(SETUPTOOLS["packages"])


def test_every_listed_package_has_an_init_file():
    folders = {installed: folder for folder, installed in INSTALLED_AS.items()}
    assert SETUPTOOLS["package-dir"] == folders
    for folder in INSTALLED_AS:
        for code in (ROOT / folder).rglob("*.py"):
            assert (code.parent / "__init__.py").exists(), code.parent


def test_data_files_belong_to_listed_packages():
    assert set(SETUPTOOLS["package-data"]) <= set(SETUPTOOLS["packages"])


def test_the_source_distribution_has_every_folder_with_code():
    """Without a line in MANIFEST.in it would have some of the tests, and not what these import."""
    lines = (ROOT / "MANIFEST.in").read_text().splitlines()
    grafted = {line.removeprefix("graft ") for line in lines if line.startswith("graft ")}
    folders = {path.name for path in ROOT.iterdir() if any(path.glob("*.py"))}
    assert folders - INSTALLED_AS.keys() <= grafted


def test_torch_comes_when_a_name_is_used_and_cleaning_imports_nothing_slow_besides():
    slow = ["trimesh", "networkx", "scipy.optimize", "scipy.signal", "scipy.stats"]
    slow += ["matplotlib", "smplx", "ray"]
    code = (
        "import sys, geneoh\n"
        "assert 'torch' not in sys.modules\n"
        "assert geneoh.__version__\n"
        "geneoh.denoise, geneoh.save\n"
        f"geneoh.load({str(ROOT / 'examples/taco_noisy.npz')!r}, "
        f"obj={str(ROOT / 'examples/taco_object.obj')!r})\n"
        f"found = [name for name in {slow} if name in sys.modules]\n"
        "assert not found, found\n"
        "assert all(getattr(geneoh, name).__doc__ for name in geneoh.__all__)\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["denoise", "--help"],
        ["denoise", "a.npz", "--steps", "no"],
        ["denoise", "a.npz", "-o", "a.txt"],
    ],
)
def test_help_and_refused_arguments_come_without_torch(arguments):
    code = (
        "import sys\n"
        "from geneoh_cli.main import cli\n"
        "try:\n"
        f"    cli({arguments})\n"
        "except SystemExit:\n"
        "    assert 'torch' not in sys.modules\n"
        "else:\n"
        "    raise AssertionError('the command must end')\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_dir_lists_every_public_name_and_no_private_one():
    listed = dir(geneoh)
    assert set(geneoh.__all__) <= set(listed)
    assert not [name for name in listed if name.startswith("_") and not name.startswith("__")]


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        geneoh.nothing  # noqa: B018
