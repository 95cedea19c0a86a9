"""Read arrays that other programs wrote: pickle, npy, npz, torch checkpoint or joblib.

The first bytes of a file decide its kind, not its ending. Every problem of a file is an
`InputError`; no code in it is run.
"""

import bz2
import io
import lzma
import zipfile
import zlib
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from geneoh.errors import InputError
from geneoh.files.checkpoints import KNOWN, is_stream, read_stream, read_zip
from geneoh.files.npz import decode_archive, decode_array
from geneoh.files.pickles import Loader
from geneoh.files.reading import DAMAGE, SIZE_LIMIT, read_bytes, reason

DECOMPRESSORS = (
    ((b"\x78\x01", b"\x78\x5e", b"\x78\x9c", b"\x78\xda"), zlib.decompressobj),
    ((b"\x1f\x8b",), partial(zlib.decompressobj, wbits=31)),
    ((b"BZh",), bz2.BZ2Decompressor),
    ((b"\xfd7zXZ", b"\x5d\x00\x00"), partial(lzma.LZMADecompressor, memlimit=2**28)),
)
"""First bytes of compressed files, and their decompressors."""


def read_values(path: Path) -> Any:
    """The content of a file of any of these kinds, with arrays and tensors as numpy arrays.

    An npz becomes a dict by name; a zero-dimensional array of one object becomes that object.
    `InputError` for files that are damaged, too large, or name a class that is no array or tensor.
    """
    data = read_bytes(path)
    if not data:
        raise InputError(f"{path}: expected data, got an empty file; write or copy it again")
    try:
        return decode(data, str(path))
    except InputError:
        raise
    except DAMAGE as error:
        raise InputError(
            f"{path}: expected a file of arrays, got one that cannot be decoded "
            f"({reason(error)}); it is damaged, copy it again"
        ) from None


def decode(data: bytes, file: str) -> Any:
    """As `read_values`, from bytes."""
    if data.startswith(b"PK"):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if any(name.endswith(".npy") for name in archive.namelist()):
                return decode_archive(archive, file, decode_objects)
            return read_zip(archive, file)
    if data.startswith(b"\x93NUMPY"):
        return decode_array(data, f"{file}: the array", decode_objects)
    if is_stream(data):
        return read_stream(data, file)
    return decode_pickle(_unpacked(data, file), file)


def decode_pickle(data: bytes, file: str) -> Any:
    """The value of one pickle, also of joblib."""
    loader = Loader(data, file, KNOWN)
    return loader.value(loader.tree())


def decode_objects(data: bytes, file: str) -> Any:
    """The array of objects after an npy header; the object itself where it has no axes."""
    value = decode_pickle(data, file)
    only = isinstance(value, np.ndarray) and value.dtype.hasobject and value.ndim == 0
    return value.item() if only else value


def _unpacked(data: bytes, file: str) -> bytes:
    """A pickle, decompressed where joblib or another program compressed it."""
    made: Any = next((made for starts, made in DECOMPRESSORS if data.startswith(starts)), None)
    if made is None:
        return data
    plain = made().decompress(data, SIZE_LIMIT + 1)
    if len(plain) > SIZE_LIMIT:
        raise InputError(
            f"{file}: must unpack to at most {SIZE_LIMIT / 2**30:g} GiB, got more; "
            "cut it into shorter ones"
        )
    return plain
