"""ARCTIC as it is distributed: raw_seqs/{sid}/{seq}.mano.npy and .object.npy,
meta/object_vtemplates/.

Convention O, poses relative to MANO's mean pose, MANO_LEFT as shipped, world frame, 30 frames a
second. The object's translation and its templates are in millimetres. An object has a fixed bottom
and a top that turns about (0, 0, -1); the bottom comes first, the whole object moves with it.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.geometry.mesh import Mesh
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clips,
    finite_frames,
)
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    Track,
    mano_track,
    matrices,
    object_track,
    recordings,
    sequence_of,
    turned,
)
from geneoh.readers.meshes import find_mesh, part_of_mesh, read_mesh
from geneoh.readers.records import Array, Record, read_array, read_json, read_record

CONVENTION = ManoConvention(origin=True, mean_added=True)
FPS = 30.0
MILLIMETRES = 0.001
HINGE = np.array([0.0, 0.0, -1.0])
"""Axis of the top in the canonical frame, through its origin."""
TOP, BOTTOM = 0, 1
"""In parts.json, by the code behind the published numbers; its documentation says the opposite."""


def find(path: Path) -> list[SourceClip]:
    """Every sequence that has hands."""
    return clips(path, "*.mano.npy", 2)


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands and the two parts of the object."""
    record = read_record(clip.path)
    stem = clip.path.name.removesuffix(".mano.npy")
    values = read_array(clip.path.with_name(f"{stem}.object.npy"), ("T", 7))
    motion = part_motion(values[:, 0], values[:, 1:4], values[:, 4:] * MILLIMETRES)
    name = stem.split("_")[0]
    root = clip.path.parents[2] if len(clip.path.parents) > 2 else clip.path.parent
    meshes, said = read_parts(known.objects or root / "meta/object_vtemplates", name)
    tracks = [read_hand(record.record(side), side, known) for side in ("right", "left")]
    sequence = sequence_of(
        tracks, object_track(meshes, motion), known.rate(FPS), f"ARCTIC {clip.name}"
    )
    return recordings(
        clip.name,
        sequence,
        object_known=finite_frames(motion),
        mesh_names=(f"arctic_{name}_bottom", f"arctic_{name}_top"),
        evidence=CrossChecks(said=said),
    )


def read_hand(record: Record, side: Side, known: ReaderOptions) -> Track:
    """One hand in the world."""
    pose = np.concatenate([record.array("rot", ("T", 3)), record.array("pose", ("T", 45))], axis=1)
    betas = record.array("shape", (10,), ("T", 10)).reshape(-1, 10).mean(0)
    trans = record.array("trans", ("T", 3))
    trust = trust_of(record, "fitting_err")
    numbers = ManoParameters(side, pose, trans, betas, confidence=trust)
    return mano_track(numbers, CONVENTION, known, record.where)


def trust_of(record: Record, name: str) -> Array | None:
    """(T, 21) confidence from the error of ARCTIC's fit, whose unit is not documented.

    1 up to the median of the sequence, beyond it the median's share of the error.
    """
    if name not in record:
        return None
    error = np.abs(record.array(name, ("T",), ("T", 1)).reshape(-1))
    typical = np.nanmedian(error) if np.isfinite(error).any() else 0.0
    trust = np.where(error > typical, typical / np.maximum(error, 1e-12), 1.0)
    return np.tile(np.where(np.isfinite(error), trust, 0.0)[:, None], 21)


def part_motion(angle: Array, orient: Array, shift: Array) -> Array:
    """(T, 2, 4, 4) of bottom and top: the top is turned about the hinge, then moved as a whole."""
    whole = turned(orient)
    opened = whole @ turned(angle[:, None] * HINGE)
    return np.stack([matrices(whole, shift), matrices(opened, shift)], axis=1)


def read_parts(folder: Path, name: str) -> tuple[list[Mesh], tuple[str, ...]]:
    """Bottom and top in metres, and what speaks against the sense of the parts' file."""
    path = find_mesh([folder / name / "mesh.obj"], name)
    mesh = read_mesh(path, MILLIMETRES)
    parts = Record(
        str(path.with_name("parts.json")), {"parts": read_json(path.parent / "parts.json")}
    )
    ids = parts.array("parts", ("V",))
    if len(ids) != len(mesh.verts):
        raise InputError(
            f"{parts.where}: expected one number for each of {len(mesh.verts)} vertices, "
            f"got {len(ids)}; it belongs to another mesh"
        )
    bottom, top = (part_of_mesh(mesh, ids == part, parts.where) for part in (BOTTOM, TOP))
    return [bottom, top], wrong_parts(path.parent, bottom, top)


def wrong_parts(folder: Path, bottom: Mesh, top: Mesh) -> tuple[str, ...]:
    """Whether the parts' own meshes say that top and bottom are exchanged."""
    files = [folder / "bottom.obj", folder / "top.obj"]
    if not all(file.is_file() for file in files):
        return ()
    true_bottom, true_top = (middle(read_mesh(file, MILLIMETRES)) for file in files)
    straight = np.linalg.norm(middle(bottom) - true_bottom) + np.linalg.norm(middle(top) - true_top)
    crossed = np.linalg.norm(middle(bottom) - true_top) + np.linalg.norm(middle(top) - true_bottom)
    if crossed < straight:
        return ("parts: parts.json calls top what top.obj calls bottom; 0 must be the top",)
    return ()


def middle(mesh: Mesh) -> Array:
    """Middle of the bounding box."""
    return ((mesh.verts.amax(0) + mesh.verts.amin(0)) / 2).double().numpy()
