import io
import os
import subprocess
import sys

import click
import pytest
import torch

from geneoh.errors import CheckpointError, InputError, MissingAssetError

HEAVY = ("torch", "numpy", "scipy", "trimesh", "tqdm")


@pytest.fixture
def failing(command, monkeypatch):
    """Let `geneoh info` raise something."""

    def fail(error: BaseException) -> None:
        @click.command()
        def info() -> None:
            raise error

        monkeypatch.setattr(type(command), "get_command", lambda *_: info)

    return fail


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (InputError("a.npz: 'joints' must be\n  finite"), 2),
        (MissingAssetError("no file"), 2),
        (CheckpointError("other weights"), 2),
        (PermissionError(13, "Permission denied", "a.npz"), 1),
        (ZeroDivisionError("division by zero"), 1),
        (KeyboardInterrupt(), 130),
    ],
)
def test_an_error_is_one_line_and_an_exit_code(geneoh, failing, error, code):
    failing(error)
    result = geneoh("info", code=code)
    assert result.stdout == ""
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1
    assert " ".join(str(error).split()) in result.stderr


def test_an_error_that_ctrl_c_caused_in_a_library_is_a_stop(geneoh, failing):
    error = ImportError("initialization failed")  # as pybind11 says it
    error.__cause__ = KeyboardInterrupt()
    failing(error)
    assert geneoh("info", code=130).stderr == "Error: stopped; nothing half-written was left\n"


def test_a_programming_error_says_how_to_report_it(geneoh, failing):
    failing(ZeroDivisionError("division by zero"))
    assert (
        "ZeroDivisionError: division by zero; run `geneoh --debug" in geneoh("info", code=1).stderr
    )


@pytest.mark.parametrize(
    "error",
    [
        MemoryError("Unable to allocate 9 TiB"),
        torch.OutOfMemoryError("CUDA out of memory"),
        RuntimeError("[enforce fail at alloc_cpu.cpp:127] can't allocate memory"),
    ],
)
def test_a_lack_of_memory_is_no_programming_error(geneoh, failing, error):
    failing(error)
    assert "Error: there is not enough memory; " in geneoh("info", code=2).stderr


def test_letters_that_the_output_cannot_encode_are_replaced(command, monkeypatch):
    @click.command()
    def info() -> None:
        click.echo("inconsistency in mm²")

    monkeypatch.setattr(type(command), "get_command", lambda *_: info)
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, encoding="cp932"))
    command.main(["info"], standalone_mode=False)
    sys.stdout.flush()
    assert written.getvalue().decode("cp932") == "inconsistency in mm?\n"


def test_a_deleted_current_folder_is_named(geneoh, tmp_path, monkeypatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert "the current folder was deleted" in geneoh("info", code=2).stderr


def test_it_also_runs_as_a_module():
    ran = subprocess.run(
        [sys.executable, "-m", "geneoh", "--help"], capture_output=True, text=True, check=True
    )
    assert ran.stdout.startswith("Usage: geneoh [OPTIONS]")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="there is no file that is full")
@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["denoise", "--help"]])
def test_a_full_disk_is_told_when_help_is_written_to_it(arguments):
    command = [sys.executable, "-m", "geneoh", *arguments]
    with open("/dev/full", "w") as full:
        ran = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert ran.stderr == "Error: standard output: No space left on device; make room\n"
    assert ran.returncode == 2


def test_debug_lets_the_traceback_through(geneoh, failing):
    failing(InputError("a.npz: bad"))
    assert isinstance(geneoh("--debug", "info", code=1).exception, InputError)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["denois"], "No such command 'denois'"),
        (["corrupt", "a.npz"], "Missing option '--noise'"),
        (["train"], "Missing option '--stage'"),
        (["eval"], "Missing option '--dataset'"),
        (["batch", "a.npz"], "Missing option '-o'"),
        (["corrupt", "a.npz", "--noise", "pink"], "'gauss'"),
        (["corrupt", "a.npz", "--noise", "gauss", "--seed", "-1"], "--seed"),
        (["corrupt"], "Missing argument 'CLEAN'"),
        (["corrupt", "a.npz", "--noise", "gauss", "--noise", "drop"], "--noise takes one value"),
        (["corrupt", "a.npz", "."], "a mesh goes after --obj, and `geneoh batch` cleans many"),
        (["bench", "--plot", "a.png", "--plot", "b.png"], "--plot takes one value, got it 2 times"),
        (["convert", "--from", "hot3d", "."], "name the source first"),
    ],
)
def test_wrong_usage_is_one_line_that_points_to_help(geneoh, arguments, words):
    result = geneoh(*arguments, code=2)
    assert words in result.stderr
    assert result.stderr.rstrip().endswith("--help`")
    assert result.stderr.count("\n") == 1


def test_an_option_of_several_values_and_a_flag_may_be_repeated(geneoh):
    twice = ("--frame", "1", "--frame", "2", "--overwrite", "--overwrite")
    assert "--frame needs a filmstrip" in geneoh("view", "a.npz", *twice, code=2).stderr


def test_every_command_is_listed_and_has_help(command, geneoh):
    listing = geneoh("--help").stdout
    for name in command.list_commands(click.Context(command)):
        assert f"\n  {name} " in listing
        result = geneoh(name, "--help")
        assert f"Usage: geneoh {name}" in result.stdout.replace("Usage: cli", "Usage: geneoh")


@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["corrupt", "--help"]])
def test_help_comes_at_once_and_without_torch(arguments):
    code = (
        "import sys, time; from importlib.metadata import entry_points\n"
        "(script,) = entry_points(group='console_scripts', name='geneoh')\n"
        f"sys.argv = ['geneoh', *{arguments!r}]\n"
        "try:\n    script.load()()\n"
        f"finally:\n    loaded = [name for name in {HEAVY!r} if name in sys.modules]\n"
        "    print(time.process_time(), *loaded, file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    seconds, *loaded = done.stderr.split()
    assert loaded == []
    assert float(seconds) < 1  # 0.15 s of work; torch alone takes 2


def test_the_version_is_that_of_the_package(geneoh):
    assert geneoh("--version").stdout.rstrip().endswith("0.1.0")


def test_what_is_typed_is_quoted_in_part_only(geneoh):
    name = "x" * 10000
    for arguments in (("denoise", name), ("denoise", "a.npz", "--preset", name)):
        result = geneoh(*arguments, code=2)
        assert result.output.startswith("Error: ")
        assert len(result.output) < 2100


@pytest.mark.parametrize(
    ("said", "expected"), [({}, "PASSIVE 5000"), ({"OMP_WAIT_POLICY": "ACTIVE"}, "ACTIVE None")]
)
def test_waiting_threads_sleep_unless_the_user_says_how_they_wait(said, expected):
    names = ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")
    script = f"import cli.main, os; print(*map(os.environ.get, {names}))"
    environment = {name: value for name, value in os.environ.items() if name not in names} | said
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == expected
