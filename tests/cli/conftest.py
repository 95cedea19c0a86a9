"""How the command's tests run the command: as its users do, by the installed entry point."""

from importlib.metadata import entry_points

import pytest
from click.testing import CliRunner, Result

from geneoh.viz import camera


@pytest.fixture(scope="session")
def command():
    """The click command behind the name `geneoh`."""
    (script,) = entry_points(group="console_scripts", name="geneoh")
    return script.load()


@pytest.fixture
def geneoh(command, tmp_path, monkeypatch):
    """Run `geneoh ARGUMENTS` in an empty folder, with --set for each of the settings.

    It must end with the exit code `code`. The camera of pages and pictures tries few directions.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(camera, "TURNS", 2)

    def run(*arguments: object, settings: tuple[str, ...] = (), code: int = 0) -> Result:
        words = [*arguments, *(word for setting in settings for word in ("--set", setting))]
        result = CliRunner().invoke(command, [str(word) for word in words])
        assert result.exit_code == code, result.output
        return result

    return run
