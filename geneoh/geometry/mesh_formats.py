"""GLB and OBJ files that trimesh would read as another mesh."""

import io
import json
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


def absolute_obj(path: Path) -> io.BytesIO | None:
    """An OBJ file whose faces count their points backward, with numbers that count from the first.

    None where none does so. trimesh counts from the end of the file, and not from the face.
    """
    lines = path.read_bytes().replace(b"\r", b"").replace(b"\\\n", b" ").split(b"\n")
    if not any(line[:1] == b"f" and b"-" in line for line in lines):
        return None
    counts = {b"v": 0, b"vt": 0, b"vn": 0}
    for at, line in enumerate(lines):
        kind, *words = line.split() or [b""]
        if kind in counts:
            counts[kind] += 1
        elif kind == b"f":
            corners = ([word.split(b"/"), list(counts.values())] for word in words)
            each = (b"/".join(map(from_first, *corner)) for corner in corners)
            lines[at] = b"f " + b" ".join(each)
    return io.BytesIO(b"\n".join(lines))


def from_first(index: bytes, count: int) -> bytes:
    """An index of an OBJ file that may count backward from the last of so many points."""
    return b"%d" % (count + 1 + int(index)) if index[:1] == b"-" else index
