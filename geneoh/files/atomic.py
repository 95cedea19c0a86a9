"""Files appear whole or not at all."""

import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from geneoh.errors import GeneOHError, InputError


def write_whole(path: Path, data: bytes | str, *, parents: bool = False) -> None:
    """Write a file in one step: `path` holds the old file or the whole new one, never a part.

    Args:
        path: where.
        data: what; text as UTF-8.
        parents: make the folders above it where they are missing.

    Raises:
        InputError: the place cannot be written to.
    """
    with in_one_step(path) as beside:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_bytes(data.encode() if isinstance(data, str) else data)


@contextmanager
def in_one_step(path: Path) -> Iterator[Path]:
    """A place beside `path` to write a file or a folder to, which becomes `path` at the end.

    Where the block raises, `path` keeps what it holds, and what was written is removed.

    Raises:
        InputError: the place cannot be written to.
    """
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        yield beside
        beside.replace(path)
    except GeneOHError:
        raise  # some are an OSError too, and say more
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        if beside.is_dir():
            shutil.rmtree(beside, ignore_errors=True)
        else:
            beside.unlink(missing_ok=True)


def unwritable(path: Path, error: OSError) -> InputError:
    """The error for a place that cannot be written to."""
    return InputError(f"{path}: cannot be written ({error.strerror}); choose another place")
