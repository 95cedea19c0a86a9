"""Read frames from standard input as they arrive: JSON lines, or consecutive msgpack maps."""

import json
from collections.abc import Iterator
from typing import Any, BinaryIO

import msgpack

from geneoh.errors import InputError

LIMIT = 2**20
"""Most bytes of a frame, so that input without an end of line cannot fill the memory."""
MSGPACK_MAPS = (*range(0x80, 0x90), 0xDE, 0xDF)
"""Possible first bytes of a msgpack map; JSON text begins with none of them."""

Fields = dict[str, Any]


def frames_in(source: BinaryIO) -> tuple[bool, Iterator[tuple[str, Fields]]]:
    """Whether frames are in msgpack, and for each frame its name in messages and its fields."""
    first = source.read(1)
    packed = bool(first) and first[0] in MSGPACK_MAPS
    return packed, (packed_frames if packed else line_frames)(first, source)


def packed_frames(first: bytes, source: BinaryIO) -> Iterator[tuple[str, Fields]]:
    """Frames as msgpack maps; `first` is the byte of the input that was already read."""
    unpacker = msgpack.Unpacker(max_buffer_size=LIMIT)
    number, fed, unpacked = 0, 0, 0  # number of the next frame, from 0; bytes fed and unpacked
    while first or (first := source.read1(LIMIT // 2)):  # pyright: ignore[reportAttributeAccessIssue]
        fed += len(first)
        while True:
            where = f"standard input, frame {number}"
            try:
                unpacker.feed(first)
                first = b""
                fields = unpacker.unpack()
            except msgpack.OutOfData:
                break
            except (msgpack.UnpackException, msgpack.BufferFull, ValueError) as error:
                raise _no_map(where, type(error).__name__) from error
            if not isinstance(fields, dict):
                raise _no_map(where, f"{fields!r:.40}")
            number, unpacked = number + 1, unpacker.tell()
            yield where, fields
    if unpacked < fed:
        raise _no_map(f"standard input, frame {number}", "the beginning of one")


def _no_map(where: str, found: str) -> InputError:
    return InputError(
        f"{where}: expected a frame as a msgpack map of at most {LIMIT} bytes with names as its "
        f"keys, got {found}; correct it"
    )


def line_frames(first: bytes, source: BinaryIO) -> Iterator[tuple[str, Fields]]:
    """Frames as lines of JSON after the byte `first`, already read; blank lines are skipped."""
    number = 0
    while line := first + (b"" if first == b"\n" else source.readline(LIMIT + 1)):
        first = b""
        number += 1
        where = f"standard input, line {number}"
        if len(line) > LIMIT:
            raise InputError(
                f"{where}: expected one frame of at most {LIMIT} bytes, got a longer line; write "
                "one JSON object for each frame, with an end of line after it"
            )
        if not line.strip():
            continue
        try:
            fields = json.loads(line)
        except (ValueError, RecursionError):
            fields = None
        if not isinstance(fields, dict):
            raise InputError(
                f"{where}: expected a frame as a JSON object in one line, such as "
                f'{{"right_joints": [[x, y, z], ...]}}, got {line[:40]!r}; correct it'
            )
        yield where, fields
