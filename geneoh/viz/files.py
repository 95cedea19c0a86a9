"""Files of this package appear whole or not at all."""

from pathlib import Path

from geneoh.errors import InputError


def write_whole(path: Path, data: bytes) -> None:
    """Write a file in one step: `path` holds the old file or the whole new one, never a part.

    Raises:
        InputError: the place cannot be written to.
    """
    beside = path.with_name(f".{path.name}.tmp")
    try:
        beside.write_bytes(data)
        beside.replace(path)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        beside.unlink(missing_ok=True)


def unwritable(path: Path, error: OSError) -> InputError:
    """The error for a place that cannot be written to."""
    return InputError(f"{path}: cannot be written ({error.strerror}); choose another place")
