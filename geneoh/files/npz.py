"""Npz archives of plain arrays: read without trusting the file, written whole or not at all.

An npz is a zip of .npy members. Members are decoded here and not by `numpy.load`: nothing is ever
unpickled, and no array is allocated before its declared size was compared with a limit and with
the number of bytes in the file.
"""

import io
import math
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np

from geneoh.errors import InputError, shortened
from geneoh.files.atomic import in_one_step
from geneoh.files.reading import BUDGET_VARIABLE, DAMAGE, byte_budget, read_bytes, reason

OLDEST_TIME = (1980, 1, 1, 0, 0, 0)
"""Time stamp of every member, the first that zip knows: equal arrays give equal bytes."""
OWN_ATTRIBUTES = 0o644 << 16
"""File attributes of archive members that geneoh writes; numpy writes other ones."""

Arrays = dict[str, np.ndarray]
ObjectReader = Callable[[bytes, str], Any]
"""Decodes an array of Python objects from the bytes after its header; the text is for messages."""


OF_PROGRAMS = (
    "save its arrays with numpy.savez, or say with --from whose it is, such as --from hamer"
)
"""Remedy for files of other programs, which only readers of their sources open."""


def read_archive(path: Path) -> Arrays:
    """Every array of an npz file by its name; `InputError` for anything but sound, plain arrays."""
    data = read_bytes(path, byte_budget())
    if not data.startswith(b"PK"):
        raise InputError(f"{path}: expected an npz archive, got {got_instead(data)}")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = archive.namelist()
            if any(name.endswith("/data.pkl") for name in names):
                raise InputError(
                    f"{path}: expected an npz archive, got a file of torch.save; {OF_PROGRAMS}"
                )
            if names and not any(name.endswith(".npy") for name in names):
                raise InputError(
                    f"{path}: expected an npz archive, got a zip of '{shortened(names[0], 40)}'; "
                    "unpack it"
                )
            return decode_archive(archive, str(path))
    except InputError:
        raise
    except DAMAGE as error:
        raise InputError(
            f"{path}: the npz is truncated or damaged ({reason(error)}); write or copy it again"
        ) from None


def got_instead(data: bytes) -> str:
    """For a message: the kind of a file that is no zip, by its first bytes, and what to do."""
    if not data:
        return "an empty file; write or copy it again"
    if data.startswith(b"\x93NUMPY"):
        return "a single .npy array; save the arrays by name with numpy.savez"
    if data.startswith(b"\x80"):
        return f"a pickle, which is never run; {OF_PROGRAMS}"
    if data.startswith(b"\x1f\x8b"):
        return "a gzip file; unpack it with gunzip"
    if data.startswith((b"\x89PNG", b"\xff\xd8\xff", b"%PDF", b"GIF8")) or data[4:8] == b"ftyp":
        return "a picture, film or document; give the 3D hands that a tracker found in it"
    if data.startswith((b"HIERARCHY", b"Kaydara FBX", b"glTF")):
        return (
            "an animated skeleton; export the places of the hand's joints in the world, frame by "
            "frame, as CSV or JSON with their names"
        )
    return "something else; save the arrays with numpy.savez"


def decode_archive(
    archive: zipfile.ZipFile, file: str, objects: ObjectReader | None = None
) -> dict[str, Any]:
    """Every array of an open archive, after its declared size was compared with the budget."""
    members = [info for info in archive.infolist() if info.filename.endswith(".npy")]
    budget, needed = byte_budget(), sum(info.file_size for info in members)
    if needed <= budget:
        needed += sum(as_float64(archive, info, file) for info in members)
    if needed > budget:
        raise InputError(
            f"{file}: reading must take at most {budget / 1e9:.3g} GB of memory, got arrays that "
            f"declare {needed / 1e9:.3g} GB; cut the sequence into shorter ones or raise "
            f"{BUDGET_VARIABLE}"
        )
    names = [info.filename.removesuffix(".npy") for info in members]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{file}: expected each field once, got '{twice}' twice; write it again")
    named = zip(names, members, strict=True)
    return {n: decode_array(archive.read(m), f"{file}: '{n}'", objects) for n, m in named}


def as_float64(archive: zipfile.ZipFile, info: zipfile.ZipInfo, file: str) -> int:
    """Bytes that a member takes as float64, to which readers convert its numbers."""
    with archive.open(info) as stream:
        shape, _, dtype = read_header(stream, f"{file}: '{info.filename.removesuffix('.npy')}'")
    count = math.prod(shape)
    held = 0 <= count * dtype.itemsize <= info.file_size  # else `decode_array` refuses it
    return 8 * count if held and dtype.kind in "biuf" else 0


def read_header(
    stream: io.BufferedIOBase | IO[bytes], what: str
) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order (True: Fortran's) and dtype that a .npy declares; `InputError` without them."""
    try:
        form = np.lib.format
        headers = {(1, 0): form.read_array_header_1_0, (2, 0): form.read_array_header_2_0}
        return headers[form.read_magic(stream)](stream)
    except zipfile.BadZipFile:  # of the archive, not of the header
        raise
    except DAMAGE as error:
        raise InputError(
            f"{what} has no readable array header ({reason(error)}); write it with numpy.savez"
        ) from None


def decode_array(raw: bytes, what: str, objects: ObjectReader | None = None) -> Any:
    """The array in the bytes of a .npy; its header must describe exactly the bytes that follow.

    `what` names file and field in errors; `objects` reads the pickle of an array of Python objects,
    which is refused without it.
    """
    stream = io.BytesIO(raw)
    shape, fortran, dtype = read_header(stream, what)
    body = raw[stream.tell() :]
    if dtype.hasobject and objects is not None:
        return objects(body, what)
    if dtype.hasobject:
        raise InputError(
            f"{what} must be a plain array of numbers or text, got Python objects "
            "(a pickle), which are never opened; save it with a fixed dtype"
        )
    if math.prod(shape) * dtype.itemsize != len(body) or dtype.itemsize == 0:
        raise InputError(
            f"{what} declares shape {shape} of {dtype}, got {len(body)} bytes; "
            "the file is damaged, write or copy it again"
        )
    array = np.ndarray(shape, dtype, body, order="F" if fortran else "C")
    return array.copy()  # the view of `body` is read-only, and torch wants to own its memory


def write_archive(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an npz in one step; the same arrays give the same bytes."""
    with in_one_step(path) as beside, zipfile.ZipFile(beside, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, array in arrays.items():
            archive.writestr(member(name), encode_array(array), compresslevel=6)


def member(name: str) -> zipfile.ZipInfo:
    """Header of one .npy member, the same at any time and for any user."""
    info = zipfile.ZipInfo(f"{name}.npy", date_time=OLDEST_TIME)
    info.compress_type = zipfile.ZIP_DEFLATED
    info.external_attr = OWN_ATTRIBUTES
    return info


def encode_array(array: np.ndarray) -> bytes:
    """The .npy bytes of a plain array; arrays of Python objects raise ValueError."""
    stream = io.BytesIO()
    np.lib.format.write_array(stream, np.asarray(array, order="C"), allow_pickle=False)
    return stream.getvalue()
