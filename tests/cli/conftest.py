"""How the command's tests run the command: as its users do, by the installed entry point."""

from importlib.metadata import entry_points

import pytest
from click.testing import CliRunner, Result


@pytest.fixture(scope="session")
def command():
    """The click command behind the name `geneoh`."""
    (script,) = entry_points(group="console_scripts", name="geneoh")
    return script.load()


@pytest.fixture
def geneoh(command, tmp_path, monkeypatch):
    """Run `geneoh ARGUMENTS` in an empty folder; it must end with the exit code `code`."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: object, code: int = 0) -> Result:
        result = CliRunner().invoke(command, [str(argument) for argument in arguments])
        assert result.exit_code == code, result.output
        return result

    return run
