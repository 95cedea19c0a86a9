"""Files appear whole or not at all."""

import secrets
from pathlib import Path

from geneoh.errors import InputError


def write_whole(path: Path, data: bytes | str, *, parents: bool = False) -> None:
    """Write a file in one step: `path` holds the old file or the whole new one, never a part.

    Args:
        path: where.
        data: what; text as UTF-8.
        parents: make the folders above it where they are missing.

    Raises:
        InputError: the place cannot be written to.
    """
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        if parents:
            path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_bytes(data.encode() if isinstance(data, str) else data)
        beside.replace(path)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        beside.unlink(missing_ok=True)


def unwritable(path: Path, error: OSError) -> InputError:
    """The error for a place that cannot be written to."""
    return InputError(f"{path}: cannot be written ({error.strerror}); choose another place")
