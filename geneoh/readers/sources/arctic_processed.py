"""ARCTIC as its own scripts process it: processed(_verts)/seqs/{sid}/{seq}.npy.

params holds rot_{r,l}, pose_{r,l}, trans_{r,l}, shape_{r,l}, obj_arti, obj_rot, obj_trans as the
raw files do (obj_trans still in millimetres); world_coord holds joints.{right,left} in MANO's order
and, with vertices, verts.object in metres. GeneOH's own files of the same folder name hold all of
this side by side in one dict. Conventions as in `arctic`.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.readers.base import CrossChecks, ReaderOptions, SourceClip
from geneoh.readers.builders import OPENPOSE_FROM_MANO
from geneoh.readers.dataset_reader import ClipParts, DatasetReader
from geneoh.readers.foreign_files import read_record
from geneoh.readers.records import Array, Record
from geneoh.readers.sources.arctic import (
    BOTTOM,
    CONVENTION,
    MILLIMETRES,
    TEMPLATES,
    TOP,
    part_motion,
    read_hand,
    read_parts,
    read_template,
)

FOLDERS = ("seqs", "processed_seqs")


class ArcticProcessedReader(DatasetReader):
    """Both hands and the two parts of the object, in the world."""

    patterns = ("*.npy",)
    name_parts = 2
    convention = CONVENTION

    def accepts(self, match: Path) -> bool:
        """Files of processed sequences."""
        return match.parents[1].name in FOLDERS

    def parts(self, clip: SourceClip, options: ReaderOptions) -> Iterator[ClipParts]:
        """The one interaction of a sequence."""
        record = read_record(clip.path)
        flat = "params" not in record and "obj_rot" in record
        params, world = (record if flat else record.record(n) for n in ("params", "world_coord"))
        values = params.side_by_side(obj_arti=1, obj_rot=3, obj_trans=3)
        motion = part_motion(values[:, 0], values[:, 1:4], values[:, 4:] * MILLIMETRES)
        name = clip.path.stem.split("_")[0]
        folder = options.objects or templates(clip.path)
        meshes, contradictions = read_parts(folder, name)
        joints: dict[Side, Array | None] = {
            side: read_joints(world, side, len(motion)) for side in ("right", "left")
        }
        verts = world.optional_array("verts.object", (len(motion), "V", 3))
        moved = None
        if verts is not None and verts.shape[1] == sum(len(m.verts) for m in meshes.values()):
            moved = verts.mean(1, keepdims=True), mean_vertex(folder, name, motion)
        yield ClipParts(
            f"ARCTIC {clip.name} (processed)",
            [read_hand(params, side, f"_{side[0]}", joints[side]) for side in joints],
            meshes,
            motion,
            cross_checks=CrossChecks(
                joints={side: there for side, there in joints.items() if there is not None},
                object_points=moved,
                contradictions=contradictions,
            ),
        )


def templates(path: Path) -> Path:
    """The object models: beside the outputs, or where ARCTIC's scripts have the raw data."""
    roots = path.parents[2:5]
    places = [root / TEMPLATES for root in roots]
    places += [root / "data/arctic_data/data" / TEMPLATES for root in roots]
    return next((place for place in places if place.is_dir()), places[0])


def read_joints(world: Record, side: Side, frames: int) -> Array | None:
    """(T, 21, 3) stored keypoints."""
    joints = world.optional_array(f"joints.{side}", (frames, 21, 3))
    return None if joints is None else joints[:, OPENPOSE_FROM_MANO]


def mean_vertex(folder: Path, name: str, motion: Array) -> Array:
    """(T, 1, 3) mean of the object's vertices, each moved with its part."""
    _, mesh, ids = read_template(folder, name)
    verts = mesh.verts.double().numpy()
    total = np.zeros((len(motion), 3))
    for index, part in enumerate((BOTTOM, TOP)):
        own = verts[ids == part]
        total += motion[:, index, :3, :3] @ own.sum(0) + len(own) * motion[:, index, :3, 3]
    return (total / len(verts))[:, None]


READER = ArcticProcessedReader()
