"""Files of pickles, by what they are: pickle, numpy array or archive of objects, checkpoint,
joblib.

The kind is told by the first bytes, not by the file's ending. Every problem of a file is an
`InputError`; nothing in it is run.
"""

import bz2
import csv
import io
import lzma
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from geneoh.errors import InputError
from geneoh.pickles.checkpoints import decode_stream, decode_zip, is_stream
from geneoh.pickles.decode import (
    BYTES_LIMIT,
    DECODERS,
    Decoder,
    nothing_stored,
    read_raw_array,
)
from geneoh.pickles.machine import Machine

DAMAGE = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    NotImplementedError,
    RecursionError,
    RuntimeError,
    SyntaxError,  # numpy reads the header of an array as Python's literals
    TypeError,
    ValueError,
    csv.Error,
    lzma.LZMAError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zlib.error,
)
"""What a damaged file makes the readers of Python and numpy raise."""


def read_values(path: Path) -> Any:
    """What a file of any of these kinds holds, with numpy arrays for all arrays and tensors.

    An npz comes as a dict by name; arrays without axes that hold one object come as that object.

    Raises:
        InputError: no such file, not one of these kinds, damaged, too large, or naming what is
            neither an array nor a tensor.
    """
    data = read_bytes(path)
    try:
        return decode(data, str(path))
    except InputError:
        raise
    except DAMAGE as error:
        reason = " ".join(str(error).split())[:100]
        raise InputError(
            f"{path}: expected a file of arrays, got one that cannot be decoded "
            f"({type(error).__name__}: {reason}); it is damaged, copy it again"
        ) from None


def read_bytes(path: Path, limit: int = BYTES_LIMIT) -> bytes:
    """The bytes of a file that is not too large.

    Raises:
        InputError: it cannot be read, or is larger than `limit`.
    """
    refuse_large(path, limit)
    try:
        return path.read_bytes()
    except OSError as error:
        raise unreadable(path, error) from None


def open_text(path: Path, limit: int) -> TextIO:
    """A text file that is not too large, to be read line by line.

    Raises:
        InputError: as `read_bytes`.
    """
    refuse_large(path, limit)
    try:
        return path.open(encoding="utf-8", errors="replace", newline="")
    except OSError as error:
        raise unreadable(path, error) from None


def refuse_large(path: Path, limit: int) -> None:
    """Raise where a file is larger than `limit` bytes, or not there."""
    try:
        size = path.stat().st_size
    except OSError as error:
        raise unreadable(path, error) from None
    if size > limit:
        raise InputError(
            f"{path}: must have at most {limit / 2**20:g} MiB, got {size / 2**20:.0f}; "
            "cut it into shorter ones"
        )


def unreadable(path: Path, error: OSError) -> InputError:
    """The error for a file that the system does not give."""
    if isinstance(error, FileNotFoundError):
        return InputError(f"{path}: no such file; check the path")
    return InputError(f"{path}: cannot be read ({error.strerror}); check the path")


def decode(data: bytes, file: str) -> Any:
    """As `read_values`, from bytes."""
    if data.startswith(b"PK"):
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return decode_npz(archive, file) if is_npz(archive) else decode_zip(archive, file)
    if data.startswith(b"\x93NUMPY"):
        return decode_npy(data, file)
    if is_stream(data):
        return decode_stream(data, file)
    return decode_pickle(unpacked(data, file), file)


def decode_pickle(data: bytes, file: str) -> Any:
    """One pickle, also one of joblib, in which arrays follow their descriptions."""
    tree = Machine(data, file, DECODERS, read_raw_array).run()
    return Decoder(file, nothing_stored).value(tree)


def decode_npy(data: bytes, file: str) -> Any:
    """One array; one of objects is a pickle behind the header."""
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    read_header: Callable[..., Any] = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }[version]
    shape, fortran, dtype = read_header(stream)
    body = data[stream.tell() :]
    if dtype.hasobject:
        value = decode_pickle(body, file)
        only = isinstance(value, np.ndarray) and value.dtype.hasobject and value.ndim == 0
        return value.item() if only else value
    count = int(np.prod(shape, dtype=object)) * dtype.itemsize
    if count != len(body) or dtype.itemsize == 0:
        raise InputError(
            f"{file}: declares shape {shape} of {dtype}, got {len(body)} bytes; "
            "it is damaged, copy it again"
        )
    return np.ndarray(shape, dtype, body, order="F" if fortran else "C").copy()


def is_npz(archive: zipfile.ZipFile) -> bool:
    """Whether a zip holds numpy arrays (and is no checkpoint)."""
    return any(name.endswith(".npy") for name in archive.namelist())


def decode_npz(archive: zipfile.ZipFile, file: str) -> dict[str, Any]:
    """Every array of an npz by its name, objects included."""
    members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
    if sum(info.file_size for info in members) > BYTES_LIMIT:
        raise InputError(
            f"{file}: the arrays must unpack to at most {BYTES_LIMIT / 2**30:g} GiB; "
            "cut it into shorter ones"
        )
    return {
        info.filename.removesuffix(".npy"): decode_npy(
            archive.read(info), f"{file} ({info.filename})"
        )
        for info in members
    }


def unpacked(data: bytes, file: str) -> bytes:
    """A pickle out of its compression, as joblib and others write it."""
    if data[:2] in (b"\x78\x01", b"\x78\x5e", b"\x78\x9c", b"\x78\xda"):
        decompressor: Any = zlib.decompressobj()
    elif data.startswith(b"\x1f\x8b"):
        decompressor = zlib.decompressobj(wbits=31)
    elif data.startswith(b"BZh"):
        decompressor = bz2.BZ2Decompressor()
    elif data.startswith((b"\xfd7zXZ", b"\x5d\x00\x00")):
        decompressor = lzma.LZMADecompressor(memlimit=2**28)
    else:
        return data
    plain = decompressor.decompress(data, BYTES_LIMIT + 1)
    if len(plain) > BYTES_LIMIT:
        raise InputError(
            f"{file}: must unpack to at most {BYTES_LIMIT / 2**30:g} GiB, got more; "
            "cut it into shorter ones"
        )
    return plain
