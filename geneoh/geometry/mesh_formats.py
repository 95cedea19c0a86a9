"""Mesh files that trimesh would read as another mesh, or not at all."""

import io
import json
import re
from pathlib import Path


def refuse_packed(data: bytes) -> None:
    """Raise for a GLB whose points trimesh takes for zeros, or for whole numbers of metres."""
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    packed = [name for name in document.get("extensionsRequired", ()) if "compression" in name]
    primitives = [each for mesh in document.get("meshes", ()) for each in mesh["primitives"]]
    points = {each["attributes"].get("POSITION", -1) for each in primitives}
    if any(document["accessors"][at].get("normalized") for at in points - {-1}):
        packed.append("KHR_mesh_quantization")
    if packed:
        raise ValueError(f"its points are packed by {', '.join(packed)}, which must be left out")


def rewritten(path: Path) -> io.BytesIO | None:
    """What trimesh is to read instead of an OBJ, PLY, STL or OFF file; None where it is that file.

    trimesh guesses an encoding other than UTF-8 with a package that it does not install.
    """
    kind, data = path.suffix.lower(), path.read_bytes()
    text = data
    if kind == ".ply":
        text = data.partition(b"end_header")[0]
    elif kind == ".stl" and len(data) == 84 + 50 * int.from_bytes(data[80:84], "little"):
        text = b""  # a binary file
    elif kind not in (".obj", ".stl", ".off"):
        return None
    ascii_text = text if is_utf8(text) else without_foreign_signs(text)
    counted = absolute_obj(ascii_text) if kind == ".obj" else ascii_text
    return None if counted is text else io.BytesIO(counted + data[len(text) :])


def is_utf8(text: bytes) -> bool:
    """Whether a text is of that encoding."""
    try:
        text.decode()
    except UnicodeDecodeError:
        return False
    return True


def without_foreign_signs(text: bytes) -> bytes:
    """A text with _ for the bytes of signs beyond ASCII; in Shift-JIS and GBK the second byte of a
    sign may be a backslash, which would join its line to the next one."""
    return re.sub(rb"[\x80-\xff]\\?", lambda found: b"_" * len(found[0]), text)


def absolute_obj(data: bytes) -> bytes:
    """An OBJ file with numbers of points that count from the first, where some count backward.

    The same object where none does so. trimesh counts from the end of the file, and not from the
    face.
    """
    lines = data.replace(b"\r", b"").replace(b"\\\n", b" ").split(b"\n")
    if not any(line[:1] == b"f" and b"-" in line for line in lines):
        return data
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


def from_first(index: bytes, count: int) -> bytes:
    """An index of an OBJ file that may count backward from the last of so many points."""
    return b"%d" % (count + 1 + int(index)) if index[:1] == b"-" else index
