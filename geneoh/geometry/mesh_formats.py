"""Repairs of mesh files that trimesh would misread, or not read at all."""

import codecs
import json
import re
import struct
from pathlib import Path
from typing import TYPE_CHECKING, Any

from geneoh.errors import InputError

if TYPE_CHECKING:
    import trimesh

ZERO = re.compile(rb"^[ \t]*f[ \t](?:[^\n#]*[ \t])?0(?=[/\s]|\Z)", re.MULTILINE)
"""A face of an OBJ file with vertex index 0; OBJ indices start at 1."""
BACKWARD = re.compile(rb"^[ \t]*f\b.*-", re.MULTILINE)
UNUSUAL = re.compile(rb"^[ \t]*[vf][^\n\t#]*[\t#][^\n]*|^[ \t]+[vf][^\n]*|\r(?!\n)", re.MULTILINE)
"""A vertex or face line with indentation, tabs or a comment, or a bare carriage return."""

PLY_NUMBERS = {
    **dict.fromkeys((b"char", b"int8"), "b"),
    **dict.fromkeys((b"uchar", b"uint8"), "B"),
    **dict.fromkeys((b"short", b"int16"), "h"),
    **dict.fromkeys((b"ushort", b"uint16"), "H"),
    **dict.fromkeys((b"int", b"int32"), "i"),
    **dict.fromkeys((b"uint", b"uint32"), "I"),
    **dict.fromkeys((b"float", b"float32"), "f"),
    **dict.fromkeys((b"double", b"float64"), "d"),
}
"""Types of a PLY file as `struct` names them."""


def refuse_packed(data: bytes) -> None:
    """Raise for a compressed or quantised GLB, as trimesh would read zeros or integers from it."""
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    packed = [name for name in document.get("extensionsRequired", ()) if "compression" in name]
    primitives = [each for mesh in document.get("meshes", ()) for each in mesh["primitives"]]
    points = {each["attributes"].get("POSITION", -1) for each in primitives}
    if any(document["accessors"][at].get("normalized") for at in points - {-1}):
        packed.append("KHR_mesh_quantization")
    if packed:
        raise ValueError(f"its points are packed by {', '.join(packed)}, which must be left out")


def rewritten(path: Path) -> bytes | None:
    """The bytes that trimesh should read instead of a file; None where it reads the file correctly.

    For encodings other than UTF-8, trimesh needs a package that it does not install.
    """
    kind, data = path.suffix.lower(), path.read_bytes()
    text = data
    if kind == ".ply":
        text = data.partition(b"end_header")[0]
    elif kind == ".stl" and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        text = b""  # a binary file
    elif kind not in (".obj", ".stl", ".off"):
        return None
    plain = as_utf8(text)
    plain = obj_for_trimesh(path, plain) if kind == ".obj" else plain
    return None if plain is text else plain + data[len(text) :]


def as_utf8(text: bytes) -> bytes:
    """UTF-8 text as it is; text of another encoding with _ for all bytes that are not ASCII."""
    try:
        text.decode()
    except UnicodeDecodeError:
        # the second byte of a character in Shift-JIS or GBK may be a backslash, which joins lines
        return re.sub(rb"[\x80-\xff]\\?", lambda found: b"_" * len(found[0]), text)
    return text


def obj_for_trimesh(path: Path, data: bytes) -> bytes:
    """An OBJ file rewritten where trimesh would misread it or fail.

    Removes a byte order mark, indentation, tabs and trailing comments, and unifies line ends.
    Negative indices become positive: they count back from the face, but trimesh counts from the
    end of the file. Raises `InputError` for index 0, which trimesh takes for the last vertex.
    """
    plain = data
    if data.startswith(codecs.BOM_UTF8) or is_unusual(data) or BACKWARD.search(data):
        text = data.removeprefix(codecs.BOM_UTF8).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        plain = UNUSUAL.sub(plain_line, text.replace(b"\\\n", b" "))
    if ZERO.search(plain):
        raise InputError(
            f"{path}: faces of an OBJ must count points from 1, got a point 0; add 1 to each"
        )
    if not BACKWARD.search(plain):
        return plain
    lines = plain.split(b"\n")
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    for at, line in enumerate(lines):
        kind, *words = line.split() or [b""]
        if kind in counts:
            counts[kind] += 1
        elif kind == b"f":
            corners = ([word.split(b"/"), list(counts.values())] for word in words)
            each = (b"/".join(map(from_first, *corner)) for corner in corners)
            lines[at] = b"f " + b" ".join(each)
    return b"\n".join(lines)


def is_unusual(data: bytes) -> bool:
    """Whether an OBJ file has a line as `UNUSUAL`; the costly search covers only the heading where
    the rest has no character of such a line."""
    heading, _, rest = data.partition(b"\nv ")
    marked = any(mark in rest for mark in (b"#", b"\t", b"\r", b"\n "))
    return bool(UNUSUAL.search(data if marked else heading + b"\n"))


def plain_line(line: re.Match[bytes]) -> bytes:
    """A line without comment, tabs and indentation, which trimesh does not read."""
    return line[0].partition(b"#")[0].replace(b"\t", b" ").lstrip()


def binary_ply_as_text(data: bytes) -> bytes | None:
    """A binary PLY file as ASCII PLY; None for other files, and for damaged ones.

    trimesh reads binary PLY only where all faces have the same number of corners.
    """
    head = re.match(rb"ply\b.*?end_header\r?\n", data, re.DOTALL)
    order = re.search(rb"format binary_(little|big)_endian", head[0]) if head else None
    if head is None or order is None:
        return None
    at, found = len(head[0]), {}
    try:
        for element in head[0].split(b"\nelement ")[1:]:
            name, count, *_ = element.split()
            kinds = [line.split()[1:] for line in element.split(b"\n") if line[:9] == b"property "]
            rows = []
            for _ in range(int(count) if kinds else 0):
                row, at = ply_row(data, at, kinds, "<" if order[1] == b"little" else ">")
                rows.append(row)
            found[name] = rows
        places = [[row[axis] for axis in (b"x", b"y", b"z")] for row in found[b"vertex"]]
        faces = [row.get(b"vertex_indices", row.get(b"vertex_index")) for row in found[b"face"]]
        lines = [" ".join(map(repr, row)) for row in places]
        lines += [" ".join(map(repr, (len(face), *face))) for face in faces]
    except (struct.error, LookupError, TypeError, ValueError):
        return None
    heading = ["ply", "format ascii 1.0", f"element vertex {len(places)}"]
    heading += [f"property double {axis}" for axis in "xyz"]
    heading += [f"element face {len(faces)}", "property list uint int vertex_indices", "end_header"]
    return "\n".join([*heading, *lines, ""]).encode()


def ply_row(
    data: bytes, at: int, kinds: list[list[bytes]], order: str
) -> tuple[dict[bytes, Any], int]:
    """Properties of one element of a binary PLY file by name, and the offset of the next one."""
    row: dict[bytes, Any] = {}
    for *kind, name in kinds:
        codes = [PLY_NUMBERS[each] for each in kind if each != b"list"]
        count = 1
        if len(codes) > 1:
            (count,) = struct.unpack_from(order + codes[0], data, at)
            at += struct.calcsize(order + codes[0])
        found = f"{order}{count}{codes[-1]}"
        values = struct.unpack_from(found, data, at)
        row[name] = values if len(codes) > 1 else values[0]
        at += struct.calcsize(found)
    return row, at


def refuse_cut_off(path: Path, scene: "trimesh.Scene") -> None:
    """Refuse a truncated ASCII PLY or OFF file, with fewer lines than its header declares.

    trimesh would read the part that is there; it refuses truncated binary files by itself.
    """
    for shape in scene.geometry.values():
        elements = shape.metadata.get("_ply_raw", {})
        for name in {"vertex", "face"} & elements.keys():
            data = elements[name].get("data")
            if isinstance(data, dict):  # of an ASCII file
                refuse_fewer(path, len(next(iter(data.values()))), elements[name]["length"], name)
    if path.suffix.lower() == ".off":
        text = re.sub(rb"#.*", b"", path.read_bytes()).partition(b"OFF")[2]
        counts, *lines = [line.split() for line in text.splitlines() if line.strip()]
        refuse_fewer(path, len(lines), sum(map(int, counts[:2])), "line")


def refuse_fewer(path: Path, found: int, declared: int, name: str) -> None:
    """Refuse a file that holds fewer elements of a kind than it declares."""
    if found < declared:
        raise InputError(
            f"{path}: the file breaks off, it says {declared} as its number of '{name}', got "
            f"{found}; copy or export it again"
        )


def from_first(index: bytes, count: int) -> bytes:
    """An OBJ index as a positive one; negative indices count back from the last of `count`."""
    return b"%d" % (count + 1 + int(index)) if index[:1] == b"-" else index
