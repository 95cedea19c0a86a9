"""What README.md, CONTRIBUTING.md and the pages of docs/ say is true: snippets run, names exist.

A snippet that needs what a test cannot have stands below a comment `<!-- not run: reason -->`. Its
commands are still parsed, so that a renamed option is found. What snippets clean and generate is
made in few steps: how good it is is tested elsewhere.
"""

import re
import shlex
import shutil
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path

import bodies
import click
import numpy as np
import pytest
import quick_generation
import two_parts
from click.testing import CliRunner
from trimesh import Trimesh

import geneoh
from geneoh.choices import CASE_NOISES, METHODS
from geneoh.evaluation.scores import MEASURES

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")],
    key=lambda page: page.relative_to(ROOT).parts,
)
FENCE = re.compile(r"(<!-- not run: .+? -->\n)?```(\w+)\n(.*?)```", re.DOTALL)
FRAMES = 12
"""Length of the track that the pages call noisy.npz."""


@dataclass(frozen=True)
class Snippet:
    """A fenced block of a page."""

    page: str
    language: str
    text: str
    runs: bool


SNIPPETS = [
    Snippet(str(page.relative_to(ROOT)), language, text, not reason)
    for page in PAGES
    for reason, language, text in FENCE.findall(page.read_text("utf-8"))
]


def commands_of(snippet: Snippet) -> list[list[str]]:
    """The `geneoh` commands in a block of shell, as lists of words."""
    lines = re.split(r"\n| && ", snippet.text.replace("\\\n", " "))
    words = [shlex.split(line, comments=True) for line in lines]
    return [line[1:] for line in words if line[:1] == ["geneoh"]]


def of_pages(language: str, *, runs: bool) -> list:
    """The blocks of one language by page, for a test that takes a page at a time."""
    chosen = [s for s in SNIPPETS if s.language == language and s.runs == runs]
    if language == "bash":
        chosen = [s for s in chosen if commands_of(s)]
    pages = dict.fromkeys(s.page for s in chosen)
    return [pytest.param([s for s in chosen if s.page == page], id=page) for page in pages]


@pytest.fixture(scope="session")
def short_track(tmp_path_factory):
    """The first frames of the example, and bodies, under the names that the pages use."""
    folder = tmp_path_factory.mktemp("pages")
    noisy = dict(np.load(ROOT / "examples" / "taco_noisy.npz"))
    frames = len(noisy["object_rotation"])
    np.savez(
        folder / "noisy.npz",
        **{name: v[:FRAMES] if v.shape[:1] == (frames,) else v for name, v in noisy.items()},
    )
    shutil.copy(ROOT / "examples" / "taco_object.obj", folder / "mesh.obj")
    for name, part in zip(("base.obj", "lid.obj"), two_parts.box_with_lid(), strict=True):
        Trimesh(part.verts.numpy(), part.faces.numpy()).export(folder / name)
    for name in ("walk.npz", "lift.npz"):
        bodies.smplx_names(folder / name, bodies.swaying(FRAMES))
    bodies.held_cylinder(folder, bodies.swaying(FRAMES))
    return folder


@pytest.fixture
def folder(short_track, tmp_path, monkeypatch):
    """A folder with the short track, and with the examples as a clone has them."""
    shutil.copytree(short_track, tmp_path, dirs_exist_ok=True)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    quick_generation.use(monkeypatch)
    return tmp_path


@pytest.fixture(scope="session")
def command():
    (script,) = entry_points(group="console_scripts", name="geneoh")
    return script.load()


@pytest.mark.slow
@pytest.mark.parametrize("snippets", of_pages("python", runs=True))
def test_python_of_a_page_runs(snippets, folder):
    names: dict = {}
    for snippet in snippets:
        exec(compile(snippet.text, snippet.page, "exec"), names)


@pytest.mark.slow
def test_the_loop_over_clips_skips_what_cannot_be_read_and_its_own_results(folder, capsys):
    (loop,) = (s for s in SNIPPETS if s.page == "docs/datasets.md" and s.language == "python")
    (folder / "noisy_broken.npz").write_text("no archive")
    for _ in range(2):
        exec(compile(loop.text, loop.page, "exec"), {})
        assert "skipped: noisy_broken.npz: " in capsys.readouterr().out
    assert [path.name for path in folder.rglob("*.npz") if path.parent.name == "clean"] == [
        "noisy.npz"
    ]


@pytest.mark.slow
@pytest.mark.parametrize("snippets", of_pages("bash", runs=True))
def test_commands_of_a_page_run(snippets, folder, command):
    for arguments in (words for snippet in snippets for words in commands_of(snippet)):
        result = CliRunner().invoke(command, arguments)
        assert result.exit_code == 0, f"geneoh {shlex.join(arguments)}\n{result.output}"
        for written in re.findall(r"wrote (\S+)", result.output):
            assert (folder / written).exists(), written


@pytest.mark.parametrize("snippets", of_pages("bash", runs=False))
def test_commands_that_are_not_run_have_options_that_exist(snippets, command):
    for name, *arguments in (words for snippet in snippets for words in commands_of(snippet)):
        chosen = command.get_command(click.Context(command), name)
        chosen.make_context(name, arguments)


def test_first_command_of_the_readme_installs_and_cleans_the_example():
    first = next(s for s in SNIPPETS if s.page == "README.md" and s.language == "bash")
    install, _ = first.text.strip().split(" && ")
    assert install == "pip install ."
    assert [words[:2] for words in commands_of(first)] == [["denoise", "examples/taco_noisy.npz"]]


def test_second_command_of_the_readme_is_what_continuous_integration_runs():
    second = [s for s in SNIPPETS if s.page == "README.md" and s.language == "bash"][1]
    install, run = second.text.strip().split(" && ")
    script = (ROOT / ".ci" / "run").read_text("utf-8")
    assert install.removeprefix("pip install") in script
    assert f"\n{run}\n" in script


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_a_page_links_to_are_there(page):
    for target in re.findall(r"\]\(([^)#:]+)[^):]*\)", page.read_text("utf-8")):
        assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_names_and_files_that_a_page_mentions_exist(page):
    text = page.read_text("utf-8")
    for name in re.findall(r"[`\[ ](geneoh(?:\.\w+)+)\b(?![/(]?\w)", text):
        assert resolved(name), name
    for path in re.findall(r"`((?:geneoh|cli|tests|tools|configs|docs)/[a-z0-9_./]*)`", text):
        assert (ROOT / path).exists(), path


def resolved(dotted: str) -> bool:
    """Whether a dotted name is a module, or an attribute of one."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        try:
            found = import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for part in parts[count:]:
            fields = getattr(found, "__dataclass_fields__", {})
            if not hasattr(found, part) and part not in fields:
                return False
            found = getattr(found, part, None)
        return True
    return False


def test_every_public_name_is_on_the_page_of_public_names():
    page = (ROOT / "docs" / "api" / "index.md").read_text("utf-8")
    missing = [name for name in geneoh.__all__ if f"::: geneoh.{name}\n" not in page]
    assert missing == []


def test_every_folder_and_module_of_the_library_is_in_the_tree():
    page = (ROOT / "docs" / "tree.md").read_text("utf-8")
    library = ROOT / "geneoh"
    names = {f"{path.parent.name}/" for path in library.glob("*/__init__.py")}
    names |= {path.name for path in library.glob("*.py")}
    assert {name for name in names if f"\n  {name} " not in page} == set()
    inner = {path.parent.relative_to(library) for path in library.glob("*/*/**/__init__.py")}
    lacking = {path for path in inner if f"\n{'  ' * len(path.parts)}{path.name}/ " not in page}
    assert lacking == set(), "the folders in folders stand there further to the right"


def test_the_page_on_evaluation_names_every_noise_method_and_measure():
    page = (ROOT / "docs/evaluation.md").read_text()
    keys = [measure.key for measure in MEASURES]
    assert not {name for name in (*CASE_NOISES, *METHODS, *keys) if f"`{name}`" not in page}
