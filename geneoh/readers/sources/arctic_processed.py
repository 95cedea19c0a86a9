"""ARCTIC as its own scripts process it: processed(_verts)/seqs/{sid}/{seq}.npy.

params holds rot_{r,l}, pose_{r,l}, trans_{r,l}, shape_{r,l}, obj_arti, obj_rot, obj_trans as the
raw files do (obj_trans still in millimetres); world_coord holds joints.{right,left} in MANO's order
and, with vertices, verts.object in metres. GeneOH's own files of the same folder name hold all of
this side by side in one dict. Conventions as in `arctic`.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.readers.base import (
    CrossChecks,
    ReaderOptions,
    Recording,
    SourceClip,
    clips,
    finite_frames,
)
from geneoh.readers.builders import (
    OPENPOSE_FROM_M,
    ManoParameters,
    Track,
    mano_track,
    object_track,
    recordings,
    sequence_of,
)
from geneoh.readers.meshes import read_mesh
from geneoh.readers.records import Array, Record, read_json, read_record
from geneoh.readers.sources.arctic import (
    BOTTOM,
    CONVENTION,
    FPS,
    MILLIMETRES,
    TOP,
    part_motion,
    read_parts,
    trust_of,
)

SIDES: tuple[Side, Side] = ("right", "left")


def find(path: Path) -> list[SourceClip]:
    """Every processed sequence."""
    found = clips(path, "*.npy", 2)
    return [clip for clip in found if clip.path.parents[1].name in ("seqs", "processed_seqs")]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands and the two parts of the object, in the world."""
    record = read_record(clip.path)
    flat = "params" not in record and "obj_rot" in record
    params, world = (record if flat else record.record(n) for n in ("params", "world_coord"))
    motion = part_motion(
        params.array("obj_arti", ("T",), ("T", 1)).reshape(-1),
        params.array("obj_rot", ("T", 3)),
        params.array("obj_trans", ("T", 3)) * MILLIMETRES,
    )
    name = clip.path.stem.split("_")[0]
    folder = known.objects or templates(clip.path)
    meshes, said = read_parts(folder, name)
    stored: dict[Side, Array | None] = {side: read_joints(world, side) for side in SIDES}
    tracks = [read_hand(params, side, stored[side], known) for side in SIDES]
    sequence = sequence_of(
        tracks, object_track(meshes, motion), known.rate(FPS), f"ARCTIC {clip.name} (processed)"
    )
    moved = None
    verts = world.array("verts.object", ("T", "V", 3)) if "verts.object" in world else None
    if verts is not None and verts.shape[1] == sum(len(mesh.verts) for mesh in meshes):
        moved = (
            verts.mean(1, keepdims=True),
            middle_of(folder / name / "mesh.obj", folder / name / "parts.json", motion),
        )
    return recordings(
        clip.name,
        sequence,
        object_known=finite_frames(motion),
        mesh_names=(f"arctic_{name}_bottom", f"arctic_{name}_top"),
        evidence=CrossChecks(
            joints={side: joints for side, joints in stored.items() if joints is not None},
            object_points=moved,
            said=said,
        ),
    )


def templates(path: Path) -> Path:
    """The object models: beside the outputs, or where ARCTIC's scripts have the raw data."""
    inside = Path("meta/object_vtemplates")
    roots = [parent for parent in list(path.parents)[2:5]]
    places = [root / inside for root in roots]
    places += [root / "data/arctic_data/data" / inside for root in roots]
    return next((place for place in places if place.is_dir()), places[0])


def read_joints(world: Record, side: Side) -> Array | None:
    """(T, 21, 3) stored keypoints."""
    key = f"joints.{side}"
    return world.array(key, ("T", 21, 3))[:, OPENPOSE_FROM_M] if key in world else None


def read_hand(params: Record, side: Side, joints: Array | None, known: ReaderOptions) -> Track:
    """One hand in the world."""
    letter = side[0]
    pose = [params.array(f"{name}_{letter}", ("T", n)) for name, n in (("rot", 3), ("pose", 45))]
    betas = params.array(f"shape_{letter}", (10,), ("T", 10)).reshape(-1, 10).mean(0)
    trans = params.array(f"trans_{letter}", ("T", 3))
    numbers = ManoParameters(
        side,
        np.concatenate(pose, axis=1),
        trans,
        betas,
        joints=joints,
        confidence=trust_of(params, f"fitting_err_{letter}"),
    )
    return mano_track(numbers, CONVENTION, known, params.where)


def middle_of(mesh: Path, parts: Path, motion: Array) -> Array:
    """(T, 1, 3) mean of the object's vertices, each moved with its part."""
    verts = read_mesh(mesh, MILLIMETRES).verts.double().numpy()
    ids = Record(str(parts), {"parts": read_json(parts)}).array("parts", ("V",))
    total = np.zeros((len(motion), 3))
    for index, part in enumerate((BOTTOM, TOP)):
        own = verts[ids == part]
        turned = motion[:, index, :3, :3] @ own.sum(0) + len(own) * motion[:, index, :3, 3]
        total += turned
    return (total / len(verts))[:, None]
