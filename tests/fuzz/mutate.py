"""Changes to files that keep enough of their structure to get past the first check."""

import io
import json
import pickle
import random
import re
import struct
import zipfile
from collections.abc import Callable

import numpy as np
import torch
from bad_inputs import Hostile
from damage import ODD_VALUES, changed_array, changed_value, damaged

from geneoh.files.values import decode

NUMBERS = (
    *("0", "-0.0", "1", "-1", "1e-40", "1e-7", "1e5", "3e38", "1e39", "1e300", "-1e300", "nan"),
    *("inf", "-inf", "99999999999999999999", "0x10", "1/2", "1/2/3", "1//3", "2147483648", "", "x"),
    *("-2147483649", "1_000", "٣", "1e", "1.2.3", "9" * 5000, "-", ",", '"', "\x00", "\ud7ff"),
)
"""Words that stand where a number is expected."""
LINES = (
    *(
        "mtllib ../../../../etc/passwd",
        "mtllib /dev/zero",
        "usemtl x",
        "o \udcff",
        "g",
        "s 1",
        "l 1",
    ),
    *(
        "f 1 1 1",
        "f -1 -2 -3",
        "f 1 2 99999999",
        "f 0 0 0",
        "f 1",
        "v",
        "v 1 2",
        "v 1e5 0 0",
        "vn 0",
    ),
    *("# " + "x" * 100_000, "\\", "curv 0 1 1 2", "p 1", "f " + " ".join(map(str, range(1, 2000)))),
)
"""Lines for files that are read line by line."""
BVH_LINES = (
    *("}", "{", "End Site", "JOINT LeftArm", "ROOT Hips", "JOINT", "MOTION", "OFFSET 1e30 0 0"),
    *("CHANNELS 3 Zrotation Zrotation Zrotation", "CHANNELS 1 Xscale", "CHANNELS 9999999999"),
    *("CHANNELS 3 Zrotation Yrotation Xrotation", "CHANNELS 0", "Frames: 0", "Frames: 99999999"),
    *("Frame Time: 0", "Frame Time: -1", "Frame Time: 1e-300", "Frame Time: 1e300", "OFFSET 0 0"),
)
"""Lines for a BVH."""
PLACES = (
    "/etc/passwd",
    "../../../../etc/passwd",
    "file:///etc/passwd",
    "http://127.0.0.1:9/x",
    ".",
)
"""Where a file may point to."""
COUNTS = (0, 1, 2, 255, 2**16, 2**31 - 1, 2**31, 2**32 - 1)
JSON_VALUES = (
    *[
        v
        for v in ODD_VALUES
        if v is None or (isinstance(v, bool | int | float | str) and v != 10**400)
    ],
    *([], {}, [1, 2, [3]], {"a": 1}, "x" * 10_000, [[[[[[[[[0]]]]]]]]], -(2**63), 10**30, *PLACES),
)

Change = Callable[[bytes, random.Random], bytes]


def mutated(data: bytes, ending: str, draw: random.Random) -> bytes:
    """A sound file with a change, mostly in terms of its format, and some bytes damaged at times.

    Only the sound file is decoded, never one that was changed before: that may hold hostile code.
    """
    if draw.random() < 0.2:
        return damaged(data, draw)
    try:
        changed = CHANGES.get(ending, change_words)(data, draw)
    except Exception:  # a change that this content does not allow, such as words to numbers
        return damaged(data, draw)
    return damaged(changed, draw) if changed and draw.random() < 0.2 else changed


def change_words(data: bytes, draw: random.Random) -> bytes:
    """A text with words or lines exchanged, doubled, or taken out."""
    lines = data.decode("utf-8", "surrogateescape").split("\n")
    at = draw.randrange(len(lines))
    match draw.randrange(5):
        case 0:
            lines[at] = draw.choice((*LINES, *PLACES))
        case 1:
            lines.insert(at, lines[draw.randrange(len(lines))])
        case 2:
            del lines[at : at + draw.choice((1, 1, 5, 1000))]
        case _:
            for at in draw.choices(range(len(lines)), k=draw.choice((1, 1, 4, 200))):
                lines[at] = change_word(lines[at], draw)
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def change_word(line: str, draw: random.Random) -> str:
    """A line with another word in the place of one."""
    words = re.split(r"([\s,]+)", line)
    words[draw.randrange(0, len(words), 2)] = draw.choice(NUMBERS)
    return "".join(words)


def change_bvh(data: bytes, draw: random.Random) -> bytes:
    """A BVH with another line in its hierarchy, a number of its motion, or as any text."""
    lines = data.decode().split("\n")
    motion = lines.index("MOTION")
    chance = draw.random()
    if chance < 0.3:
        return change_words(data, draw)
    at = draw.randrange(motion + 3) if chance < 0.8 else draw.randrange(motion, len(lines))
    if chance < 0.6:
        lines[at] = draw.choice(BVH_LINES)
    else:
        lines[at] = change_word(lines[at], draw)
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def change_numbers(data: bytes, draw: random.Random, start: int, kind: str = "<f4") -> bytes:
    """Odd numbers among the binary ones from some byte on."""
    values = np.frombuffer(data, kind, (len(data) - start) // np.dtype(kind).itemsize, start).copy()
    count = draw.choice((1, 3, 100))
    odd = draw.choice((0.0, np.nan, np.inf, 1e-40, 3e38, 1e5, -1e9, 4e9))
    with np.errstate(all="ignore"):
        values[draw.choices(range(len(values)), k=count)] = np.float64(odd).astype(values.dtype)
    return data[:start] + values.tobytes() + data[start + values.nbytes :]


def change_ply(data: bytes, draw: random.Random) -> bytes:
    """A PLY with another heading, or other numbers behind it."""
    end = data.index(b"end_header") + 11
    if b"format ascii" in data[:end] and draw.random() < 0.5:
        return data[:end] + change_words(data[end:], draw)
    if draw.random() < 0.5:
        return change_numbers(data, draw, end + draw.randrange(4), draw.choice(("<f4", "<i4")))
    return change_words(data[:end], draw) + data[end:]


def change_stl(data: bytes, draw: random.Random) -> bytes:
    """An STL with another count of faces, or other numbers."""
    if data.startswith(b"solid "):
        return change_words(data, draw)
    if draw.random() < 0.4:
        return data[:80] + struct.pack("<I", draw.choice(COUNTS)) + data[84:]
    return change_numbers(data, draw, 84 + draw.randrange(2))


def change_glb(data: bytes, draw: random.Random) -> bytes:
    """A GLB with another description of its scene, or other numbers behind it."""
    size = struct.unpack("<I", data[12:16])[0]
    text, rest = data[20 : 20 + size], data[20 + size :]
    if draw.random() < 0.3:
        return change_numbers(data, draw, 28 + size, draw.choice(("<f4", "<u4", "<u2")))
    text = change_json(text, draw)
    text += b" " * (-len(text) % 4)
    total = 20 + len(text) + len(rest) if draw.random() < 0.9 else draw.choice(COUNTS)
    length = len(text) if draw.random() < 0.9 else draw.choice(COUNTS)
    return data[:8] + struct.pack("<II", total, length) + data[16:20] + text + rest


def change_json(data: bytes, draw: random.Random) -> bytes:
    """JSON with one value exchanged, or nested too deep."""
    chance = draw.random()
    if chance < 0.05:
        return b"[" * 100_000
    if chance < 0.1:
        return data.replace(b":", b":" + b"9" * 5000, 1)
    return json.dumps(change_json_value(json.loads(data), draw)).encode()


def change_json_value(value: object, draw: random.Random) -> object:
    """One thing in the tree of a JSON file exchanged."""
    if draw.random() < 0.1 or not isinstance(value, dict | list) or not value:
        return draw.choice(JSON_VALUES)
    if isinstance(value, list):
        at = draw.randrange(len(value))
        if draw.random() < 0.1:
            return value * 2 if draw.random() < 0.5 else value[:at]
        return [*value[:at], change_json_value(value[at], draw), *value[at + 1 :]]
    key = draw.choice(list(value))
    if draw.random() < 0.1:
        return {name: item for name, item in value.items() if name != key}
    return {**value, key: change_json_value(value[key], draw)}


def change_npy(data: bytes, draw: random.Random) -> bytes:
    """A single array that is another one, or says that it is."""
    if draw.random() < 0.3:
        head = 10 + struct.unpack("<H", data[8:10])[0]
        return data[:10] + change_header(data[10:head], draw) + data[head:]
    return npy(odd_array(np.load(io.BytesIO(data), allow_pickle=True), draw))


def change_header(header: bytes, draw: random.Random) -> bytes:
    """The description of an array with another shape or type, of the same length."""
    old, new = draw.choice(
        (
            (rb"\(.*\)", b"(%d,)" % draw.choice((0, 5, 2**38, 10**30))),
            (rb"\(.*\)", b"(-1, 3)"),
            (
                rb"'[<|>].*?'",
                draw.choice((b"'<f8'", b"'|O'", b"'>f4'", b"'<U9'", b"'<M8'", b"'|V0'")),
            ),
            (rb"False", b"True "),
            (rb"\{", b"{" * draw.choice((1, 60))),
        )
    )
    return (
        re.sub(old, new, header, count=1).rstrip().ljust(len(header) - 1)[: len(header) - 1] + b"\n"
    )


def odd_array(array: np.ndarray, draw: random.Random) -> object:
    """An array that no such file should hold."""
    match draw.randrange(7):
        case 0:
            return draw.choice(ODD_VALUES)
        case 1:
            return np.asarray(Hostile(), dtype=object)
        case 2 if array.ndim:
            return np.moveaxis(array, draw.randrange(array.ndim), draw.randrange(array.ndim))
        case 3:
            kind = draw.choice(("f2", "f8", "i4", "u1", "c16", "U8", "S4", "?", "M8[s]", ">f4"))
            with np.errstate(all="ignore"):
                return array.astype(kind)
        case 4 if array.dtype.kind == "f":
            return array * draw.choice((0, -1, 0.001, 1000, 1e5, 1e-7, 3e38))
        case 5 if array.dtype.kind == "f":
            return array + draw.choice((0.1, 1, 100, 1e4, 3e38))
        case _:
            return changed_array(array, draw)


def npy(array: object) -> bytes:
    """The bytes of a npy."""
    stream = io.BytesIO()
    np.save(stream, np.asarray(array), allow_pickle=True)
    return stream.getvalue()


def change_npz(data: bytes, draw: random.Random) -> bytes:
    """An npz with one array exchanged, renamed, doubled or taken out."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(info.filename, archive.read(info)) for info in archive.infolist()]
    at = draw.randrange(len(members))
    name, raw = members[at]
    match draw.randrange(10):
        case 0:
            del members[at]
        case 1:
            members[at] = draw.choice(members)[0], raw
        case 2:
            odd = ("evil", "../evil.npy", "/tmp/evil.npy", "x" * 500, "", "format.npy", "ä.npy")
            members.append((draw.choice(odd), npy(draw.choice(ODD_VALUES))))
        case 3:
            members = cut_frames(members, draw.randrange(13))
        case _:
            members[at] = name, change_npy(raw, draw)
    stream = io.BytesIO()
    with zipfile.ZipFile(
        stream, "w", draw.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED))
    ) as new:
        for name, raw in members:
            new.writestr(zipfile.ZipInfo(name), raw)
    return stream.getvalue()


def cut_frames(members: list[tuple[str, bytes]], frames: int) -> list[tuple[str, bytes]]:
    """All arrays with fewer frames."""
    arrays = [(name, np.load(io.BytesIO(raw))) for name, raw in members]
    return [(name, npy(array[:frames] if array.ndim else array)) for name, array in arrays]


def change_pickle(data: bytes, draw: random.Random) -> bytes:
    """A pickle of something else; one in ten would make a folder if it were run."""
    value = decode(data, "a sound file")
    changed = Hostile() if draw.random() < 0.1 else changed_value(value, draw)
    return pickle.dumps(changed, protocol=draw.choice((0, 2, 4, 5)))


def change_checkpoint(data: bytes, draw: random.Random) -> bytes:
    """A file of torch.save with another value."""
    value, stream = decode(data, "a sound file"), io.BytesIO()
    new, hostile = bool(draw.randrange(2)), draw.random() < 0.1
    changed = as_tensors(Hostile() if hostile else changed_value(value, draw))
    torch.save(changed, stream, _use_new_zipfile_serialization=new)
    return stream.getvalue()


def as_tensors(value: object) -> object:
    """Nested arrays as tensors, where torch has their type."""
    if isinstance(value, dict):
        return {name: as_tensors(item) for name, item in value.items()}
    plain = isinstance(value, np.ndarray) and value.dtype.kind in "fib"
    return torch.from_numpy(value) if plain else value


def change_safetensors(data: bytes, draw: random.Random) -> bytes:
    """A safetensors file with another description, or other numbers behind it."""
    size = struct.unpack("<Q", data[:8])[0]
    text, rest = data[8 : 8 + size], data[8 + size :]
    chance = draw.random()
    if chance < 0.3:
        return change_numbers(data, draw, 8 + size)
    described = json.loads(text)
    record = described.get("__metadata__", {}).get("record")
    if record is not None and chance < 0.7:
        described["__metadata__"]["record"] = change_json(record.encode(), draw).decode()
        text = json.dumps(described).encode()
    else:
        text = change_json(text, draw)
    length = len(text) if draw.random() < 0.9 else draw.choice((0, 2**40, 2**64 - 1))
    return struct.pack("<Q", length) + text + rest


CHANGES: dict[str, Change] = {
    **{".npz": change_npz, ".npy": change_npy, ".json": change_json, ".glb": change_glb},
    **{".ply": change_ply, ".stl": change_stl, ".safetensors": change_safetensors},
    **{".bvh": change_bvh},
    **{".pkl": change_pickle, ".pickle": change_pickle, ".p": change_pickle},
    **{".pt": change_checkpoint, ".pth": change_checkpoint},
}
"""The change of each format; all others are texts."""
