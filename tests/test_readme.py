"""What the README tells people to type works."""

import re
import shlex
from importlib.metadata import entry_points
from pathlib import Path

import pytest
from click.testing import CliRunner

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / "README.md").read_text("utf-8")


def blocks(language: str) -> list[str]:
    """The fenced blocks of one language."""
    return re.findall(rf"```{language}\n(.*?)```", TEXT, re.DOTALL)


@pytest.fixture
def in_copy(tmp_path, monkeypatch):
    """A folder that holds the examples as a clone does."""
    (tmp_path / "examples").mkdir()
    for file in (ROOT / "examples").iterdir():
        (tmp_path / "examples" / file.name).write_bytes(file.read_bytes())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_first_command_cleans_the_example(in_copy):
    install, run = blocks("bash")[0].strip().split(" && ")
    assert install == "pip install ."
    name, *arguments = shlex.split(run)
    (script,) = entry_points(group="console_scripts", name=name)
    result = CliRunner().invoke(script.load(), arguments)
    assert result.exit_code == 0, result.output
    assert (in_copy / "examples" / "taco_noisy_clean.npz").exists()


def test_second_command_is_what_continuous_integration_runs():
    install, run = blocks("bash")[1].strip().split(" && ")
    script = (ROOT / ".ci" / "run").read_text("utf-8")
    assert install.removeprefix("pip install") in script
    assert f"\n{run}\n" in script


def test_python_snippet_runs(in_copy):
    (snippet,) = blocks("python")
    exec(compile(snippet, "README.md", "exec"), {})
    assert (in_copy / "clean.npz").exists()


def test_files_that_are_linked_are_there():
    for target in re.findall(r"\]\(([^)#:]+)\)", TEXT):
        assert (ROOT / target).exists(), target
