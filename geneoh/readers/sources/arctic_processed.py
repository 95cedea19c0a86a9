"""ARCTIC as its own scripts process it: processed(_verts)/seqs/{sid}/{seq}.npy.

params holds rot_{r,l}, pose_{r,l}, trans_{r,l}, shape_{r,l}, obj_arti, obj_rot, obj_trans as the
raw files do (obj_trans still in millimetres); world_coord holds joints.{right,left} in MANO's order
and, with vertices, verts.object in metres. GeneOH's own files of the same folder name hold all of
this side by side in one dict. Conventions as in `arctic`.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.readers import base
from geneoh.readers.builders import OPENPOSE_FROM_MANO
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import read_record
from geneoh.readers.records import Array
from geneoh.readers.sources import arctic

FOLDERS = ("seqs", "processed_seqs")


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the two parts of the object, in the world."""
    record = read_record(clip.path)
    flat = "params" not in record and "obj_rot" in record
    params, world = (record if flat else record.record(n) for n in ("params", "world_coord"))
    values = params.side_by_side(obj_arti=1, obj_rot=3, obj_trans=3)
    shift = values[:, 4:] * arctic.MILLIMETRES
    motion = arctic.part_motion(values[:, 0], values[:, 1:4], shift)
    name = clip.path.stem.split("_")[0]
    folder = options.objects or templates(clip.path)
    meshes, contradictions = arctic.read_parts(folder, name)
    joints: dict[Side, Array] = {}
    for side in ("right", "left"):
        stored = world.optional_array(f"joints.{side}", (len(motion), 21, 3))
        if stored is not None:
            joints[side] = stored[:, OPENPOSE_FROM_MANO]
    verts = world.optional_array("verts.object", (len(motion), "V", 3))
    moved = None
    if verts is not None and verts.shape[1] == sum(len(m.verts) for m in meshes.values()):
        moved = verts.mean(1, keepdims=True), mean_vertex(folder, name, motion)
    yield base.ClipParts(
        f"ARCTIC {clip.name} (processed)",
        [arctic.read_hand(params, s, f"_{s[0]}", joints.get(s)) for s in ("right", "left")],
        meshes,
        motion,
        cross_checks=base.CrossChecks(joints, object_points=moved, contradictions=contradictions),
    )


def templates(path: Path) -> Path:
    """The object models: beside the outputs, or where ARCTIC's scripts have the raw data."""
    roots = path.parents[2:5]
    places = [root / arctic.TEMPLATES for root in roots]
    places += [root / "data/arctic_data/data" / arctic.TEMPLATES for root in roots]
    return next((place for place in places if place.is_dir()), places[0])


def mean_vertex(folder: Path, name: str, motion: Array) -> Array:
    """(T, 1, 3) mean of the object's vertices, each moved with its part."""
    _, mesh, ids = arctic.read_template(folder, name)
    verts = mesh.verts.double().numpy()
    total = np.zeros((len(motion), 3))
    for index, part in enumerate((arctic.BOTTOM, arctic.TOP)):
        own = verts[ids == part]
        total += motion[:, index, :3, :3] @ own.sum(0) + len(own) * motion[:, index, :3, 3]
    return (total / len(verts))[:, None]


READER = DatasetReader(
    parts,
    ("*.npy",),
    choose=lambda found, path: (file for file in found if file.parents[1].name in FOLDERS),
    name_parts=2,
    convention=arctic.CONVENTION,
)
