"""The `geneoh` command: finds its subcommands, and turns errors into one line and an exit code.

Exit codes: 0 done, 1 the program failed, 2 the input, a setting or a missing file is at fault,
130 stopped with Ctrl-C.
"""

import errno
import importlib
import logging
import os
import sys
from collections import Counter
from io import TextIOWrapper
from typing import Any

import click

from geneoh.errors import EndedElsewhereError, GeneOHError
from geneoh.interrupts import INTERRUPTED

# Threads that wait for work spin shortly, then sleep. Our steps are small: threads that only spin
# made a command six times as slow where cores are shared, threads that only sleep make it a tenth
# slower where they are free. GNU's OpenMP knows both variables, others only the first, and both are
# read when torch is imported.
if "OMP_WAIT_POLICY" not in os.environ:
    os.environ |= {"OMP_WAIT_POLICY": "PASSIVE"}
    os.environ.setdefault("GOMP_SPINCOUNT", "5000")

COMMANDS = (
    *("denoise", "batch", "generate", "eval", "train", "synthesize", "realism", "corrupt"),
    *("convert", "view", "bench", "info"),
)
"""Subcommands in the order of `--help`. Each is a function of that name in commands/NAME.py, which
imports torch and geneoh inside the function only, so that help is shown at once."""

LONGEST_MESSAGE = 2000
"""Most characters of a message; a longer one, which may quote user input, loses its middle."""


def failed(message: str, exit_code: int) -> click.exceptions.Exit:
    """Print one line on standard error; raise the return value to end the program."""
    line, half = " ".join(message.split()), LONGEST_MESSAGE // 2
    line = line if len(line) <= LONGEST_MESSAGE else f"{line[:half]}...{line[-half:]}"
    click.echo(f"Error: {line}", err=True)
    return click.exceptions.Exit(exit_code)


def stopped() -> click.exceptions.Exit:
    """Say that Ctrl-C ended the command; raise the return value to end the program."""
    return failed("stopped; nothing half-written was left", INTERRUPTED)


def is_of_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C caused an error, as of a library that was being imported."""
    return error is not None and (
        isinstance(error, KeyboardInterrupt)
        or is_of_interrupt(error.__cause__ or error.__context__)
    )


def no_room(error: OSError) -> click.exceptions.Exit:
    """Say that a disk is full; raise the return value to end the program."""
    return failed(f"{error.filename or 'standard output'}: {error.strerror}; make room", 2)


def is_of_memory(error: Exception) -> bool:
    """Whether memory ran out, of the machine or of a GPU, as numpy or torch say it."""
    kinds = {kind.__name__ for kind in type(error).__mro__} & {"MemoryError", "OutOfMemoryError"}
    return bool(kinds) or "can't allocate memory" in str(error)


def refuse_repeated(ctx: click.Context, args: list[str]) -> None:
    """Refuse an option with one value that is given several times: all but one would be ignored."""
    _, _, given = ctx.command.make_parser(ctx).parse_args(list(args))
    for parameter, times in Counter(given).items():
        if not isinstance(parameter, click.Option) or parameter.multiple or parameter.is_flag:
            continue
        if times > 1:
            name = max(parameter.opts, key=len)
            raise click.UsageError(
                f"{name} takes one value, got it {times} times; leave all but one out", ctx
            )


def about_extra(message: str) -> str:
    """Advice about extra arguments, which click lists in brackets at the end of its message."""
    if any(map(os.path.exists, message.partition("(")[2].rstrip(")").split())):
        return "a mesh goes after --obj, and `geneoh batch` cleans many files"
    return "put a text with spaces in quotes"


class LazyGroup(click.Group):
    """A group that imports a subcommand only to run it, and turns exceptions into one line."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the subcommands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The subcommand of this name, or None for click to refuse it."""
        if cmd_name not in COMMANDS:
            return None
        return getattr(importlib.import_module(f".commands.{cmd_name}", __package__), cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """The subcommand and its arguments; refuses repeated options, of which click keeps one."""
        name, command, rest = super().resolve_command(ctx, args)
        if command is not None and not ctx.resilient_parsing:
            refuse_repeated(click.Context(command, parent=ctx, info_name=name), rest)
        return name, command, rest

    def make_context(self, *args: Any, **extra: Any) -> click.Context:
        """Read the options; --help and --version are written here already."""
        try:
            return super().make_context(*args, **extra)
        except OSError as error:
            if error.errno == errno.ENOSPC:
                raise no_room(error) from None
            raise

    def invoke(self, ctx: click.Context) -> Any:
        """Run the subcommand; with --debug every error keeps its traceback."""
        if ctx.params["debug"]:
            return super().invoke(ctx)
        try:
            return super().invoke(ctx)
        except click.UsageError as error:
            command = error.ctx.command_path if error.ctx else ctx.command_path
            message = error.format_message().rstrip(".")
            if "extra argument" in message:
                message += f"; {about_extra(message)}"
            if command.endswith("convert") and "'--from'" in message:
                message = "No such option '--from'; name the source first, then the paths"
            raise failed(f"{message}; see `{command} --help`", error.exit_code) from None
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except KeyboardInterrupt:
            raise stopped() from None
        except EndedElsewhereError as error:
            raise click.exceptions.Exit(error.exit_code) from None
        except GeneOHError as error:
            raise failed(str(error), 2) from None
        except Exception as error:
            if is_of_interrupt(error):
                raise stopped() from None
            if isinstance(error, OSError) and error.errno == errno.EPIPE:
                raise  # the reader of our output left: click ends quietly
            if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
                raise failed(f"{error.filename}: {error.strerror}; check the path", 2) from None
            if isinstance(error, OSError) and error.errno == errno.ENOSPC:
                raise no_room(error) from None
            if is_of_memory(error):
                words = "fewer samples, a smaller batch, a shorter clip or --device cpu need less"
                raise failed(f"there is not enough memory; {words}", 2) from None
            reason = f"{type(error).__name__}: {error}"
            hint = "run `geneoh --debug ...` for the traceback and report it"
            raise failed(f"unexpected {reason}; {hint}", 1) from None


@click.group(
    cls=LazyGroup, context_settings={"help_option_names": ["-h", "--help"], "show_default": True}
)
@click.option("--debug", is_flag=True, help="Show tracebacks and debug messages.")
@click.version_option(package_name="geneoh")
def cli(debug: bool) -> None:
    """Clean 3D hand-object interaction tracks."""
    if isinstance(sys.stdout, TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="replace")  # some encodings lack ² or letters of a path
    try:
        os.getcwd()
    except FileNotFoundError:  # the libraries that torch loads then fail without a reason
        raise failed("the current folder was deleted; change to another one", 2) from None
    level = logging.DEBUG if debug else logging.WARNING
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s: %(message)s")
    logging.getLogger("geneoh").setLevel(level)
    # trimesh logs a traceback for every optional package that is missing
    logging.getLogger("trimesh").setLevel(logging.DEBUG if debug else logging.ERROR)
