"""Files as the sources' own tools write them."""

import json
import pickle
import sys
import types
from pathlib import Path

import numpy as np
import trimesh


def write_mesh(path: Path, verts: np.ndarray, faces: np.ndarray) -> None:
    """An OBJ, or a PLY by trimesh."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".ply":
        trimesh.Trimesh(verts, faces, process=False).export(path)
        return
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in verts.tolist()]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist())]))


def dump(path: Path, value, protocol: int = 4) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(value, protocol=protocol))


def save(path: Path, array) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    np.save(path, array, allow_pickle=True)


def text_frames(folder: Path, rows: np.ndarray) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for t, row in enumerate(rows):
        (folder / f"{t:06d}.txt").write_text(" ".join(f"{x:.9f}" for x in row.ravel()))


def write_json(path: Path, value: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value))


def write_table(path: Path, head: list[str], columns: list[np.ndarray]) -> None:
    path.parent.mkdir(parents=True)
    rows = [",".join(f"{x:.12g}" for x in row) for row in np.stack(columns, axis=1)]
    path.write_text("\n".join([",".join(head), *rows]) + "\n")


class NumpyArrayWrapper:
    """Stands in for joblib's description of an array while a file is written."""


class JoblibPickler(pickle._Pickler):
    """Writes as joblib.dump does: the bytes of an array right behind its description."""

    def save(self, obj, save_persistent_id=True):
        if not isinstance(obj, np.ndarray):
            return super().save(obj, save_persistent_id)
        wrapper = NumpyArrayWrapper()
        wrapper.__dict__ = {
            "subclass": np.ndarray,
            "shape": obj.shape,
            "order": "C",
            "dtype": obj.dtype,
            "allow_mmap": True,
            "numpy_array_alignment_bytes": 16,
        }
        super().save(wrapper, save_persistent_id)
        self.framer.commit_frame(force=True)
        self.file_handle.write(b"\x03" + b"\xff" * 3 + np.ascontiguousarray(obj).tobytes())


def dump_joblib(path: Path, value) -> None:
    NumpyArrayWrapper.__module__ = "joblib.numpy_pickle"
    module = types.ModuleType("joblib.numpy_pickle")
    module.NumpyArrayWrapper = NumpyArrayWrapper
    sys.modules["joblib"], sys.modules["joblib.numpy_pickle"] = types.ModuleType("joblib"), module
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("wb") as file:
        pickler = JoblibPickler(file, protocol=4)
        pickler.file_handle = file
        pickler.dump(value)
    del sys.modules["joblib.numpy_pickle"], sys.modules["joblib"]
