"""Npz archives of plain arrays: read without trusting the file, written whole or not at all.

An npz is a zip of .npy members. Members are decoded here and not by `numpy.load`: nothing is ever
unpickled, and no array is allocated before its declared size was held against a limit and against
the bytes that are there.
"""

import io
import lzma
import math
import os
import secrets
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from geneoh.errors import InputError
from geneoh.files.atomic import unwritable

SIZE_LIMIT = 2**30
"""Bytes that one archive may unpack to: an hour of two hands at 120 fps takes less than 0.5 GiB."""

UNPACKING_ERRORS = (zlib.error, lzma.LZMAError, struct.error, EOFError, RuntimeError, UnicodeError)
"""What zipfile lets through of a damaged or encrypted archive, besides its own BadZipFile."""

HEADER_ERRORS = (ValueError, KeyError, SyntaxError, tokenize.TokenError)
"""What numpy lets through of a damaged array header, which it reads as Python's literals."""

OLDEST_TIME = (1980, 1, 1, 0, 0, 0)
"""Time stamp of every member, the first that zip knows: equal arrays give equal bytes."""

Arrays = dict[str, np.ndarray]


def read_archive(path: Path) -> Arrays:
    """Every array of an npz file by its name.

    Raises:
        InputError: not an npz, damaged, too large when unpacked, or with anything but plain arrays.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
            refuse_size(path, members)
            return {
                info.filename.removesuffix(".npy"): decode_array(path, info, archive.read(info))
                for info in members
            }
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    except zipfile.BadZipFile as error:
        raise InputError(refused_zip(path, error)) from None
    except UNPACKING_ERRORS as error:
        raise InputError(
            f"{path}: expected an npz as numpy.savez writes it, got an archive that cannot be "
            f"unpacked ({error}); write or copy it again"
        ) from None


def refused_zip(path: Path, error: zipfile.BadZipFile) -> str:
    """What to say of a file that is no sound zip, by its first bytes."""
    with path.open("rb") as file:
        start = file.read(6)
    if start.startswith(b"PK"):
        return f"{path}: the npz is truncated or damaged ({error}); write or copy it again"
    if start == b"\x93NUMPY":
        got, cure = "a single .npy array", "save the arrays by name with numpy.savez"
    elif start.startswith(b"\x80"):
        got, cure = "a pickle, which is never opened", "save its arrays with numpy.savez"
    else:
        got, cure = "something else", "save the arrays with numpy.savez"
    return f"{path}: expected an npz archive, got {got}; {cure}"


def refuse_size(path: Path, members: list[zipfile.ZipInfo]) -> None:
    """Refuse an archive by what it declares, before anything is unpacked."""
    total = sum(info.file_size for info in members)
    if total > SIZE_LIMIT:
        raise InputError(
            f"{path}: the arrays must unpack to at most {SIZE_LIMIT / 2**30:g} GiB, got "
            f"{total / 2**30:.1f} GiB; cut the sequence into shorter ones"
        )
    names = [info.filename for info in members]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1).removesuffix(".npy")
        raise InputError(f"{path}: expected each field once, got '{twice}' twice; write it again")


def decode_array(path: Path, info: zipfile.ZipInfo, raw: bytes) -> np.ndarray:
    """The array in one .npy member; its header must describe exactly the bytes that follow."""
    field = info.filename.removesuffix(".npy")
    stream = io.BytesIO(raw)
    try:
        version = np.lib.format.read_magic(stream)
        read_header = {
            (1, 0): np.lib.format.read_array_header_1_0,
            (2, 0): np.lib.format.read_array_header_2_0,
        }[version]
        shape, fortran, dtype = read_header(stream)
    except HEADER_ERRORS as error:
        raise InputError(
            f"{path}: '{field}' has no readable array header ({error}); write it with numpy.savez"
        ) from None
    if dtype.hasobject:
        raise InputError(
            f"{path}: '{field}' must be a plain array of numbers or text, got Python objects "
            "(a pickle), which are never opened; save it with a fixed dtype"
        )
    body = raw[stream.tell() :]
    if math.prod(shape) * dtype.itemsize != len(body):
        raise InputError(
            f"{path}: '{field}' declares shape {shape} of {dtype}, got {len(body)} bytes; "
            "the file is damaged, write or copy it again"
        )
    array = np.ndarray(shape, dtype, body, order="F" if fortran else "C")
    return array.copy()  # the view of `body` is read-only, and torch wants to own its memory


def write_archive(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an npz in one step: `path` holds the old file or the whole new one, never a part.

    The same arrays give the same bytes.

    Raises:
        InputError: the place cannot be written to.
    """
    beside = path.with_name(f".{path.name}.{secrets.token_hex(4)}.tmp")
    try:
        with beside.open("xb") as file:
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
                for name, array in arrays.items():
                    archive.writestr(member(name), encode_array(array), compresslevel=6)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(path)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        beside.unlink(missing_ok=True)


def member(name: str) -> zipfile.ZipInfo:
    """Header of one .npy member, the same at any time and for any user."""
    info = zipfile.ZipInfo(f"{name}.npy", date_time=OLDEST_TIME)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = 0o644 << 16
    return info


def encode_array(array: np.ndarray) -> bytes:
    """The .npy bytes of a plain array; arrays of Python objects raise ValueError."""
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array, order="C"), allow_pickle=False)
    return stream.getvalue()
