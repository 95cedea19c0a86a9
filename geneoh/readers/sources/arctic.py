"""ARCTIC as distributed, as its own scripts process it, and the predictions of ArcticNet.

Hands: translation of MANO's origin, poses relative to MANO's mean pose, left hand as shipped, 30
frames a second. An object has a fixed bottom and a top that turns about (0, 0, -1); the bottom
comes first, the whole object moves with it.

Distributed: raw_seqs/{sid}/{seq}.mano.npy and .object.npy, meta/object_vtemplates/; world frame.
The object's translation and its templates are in millimetres.

Processed: processed(_verts)/seqs/{sid}/{seq}.npy. params holds rot_{r,l}, pose_{r,l}, trans_{r,l},
shape_{r,l}, obj_arti, obj_rot, obj_trans as the raw files do; world_coord holds joints.{right,left}
in MANO's order and, with vertices, verts.object in metres. GeneOH's own files of the same folder
name hold all of this side by side in one dict.

ArcticNet: {sid}_{seq}_{view}/ with preds/{key}.pt and meta_info/. pred.mano.pose.{r,l}
(T, 16, 3, 3), .beta, .cam_t, pred.object.rot (T, 3), .cam_t, .radian; float16, so good to a
millimetre; that view's camera frame, metres. Images are numbered at 30 a second; windows are padded
at the end.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.geometry.mesh import METRES, Mesh
from geneoh.readers import base
from geneoh.readers.dataset_reader import reads
from geneoh.readers.foreign_files import frame_number, read_array, read_json, read_record
from geneoh.readers.joint_orders import openpose_order
from geneoh.readers.meshes import find_mesh, part_of_mesh, read_mesh
from geneoh.readers.nested_lists import Shape
from geneoh.readers.records import Array, Record
from geneoh.readers.transforms import axis_angles, rigid_matrices, rotation_matrices

TEMPLATES = Path("meta/object_vtemplates")
FOLDERS = ("seqs", "processed_seqs")
HINGE = np.array([0.0, 0.0, -1.0])
"""Axis of the top in the canonical frame, through its origin."""
TOP, BOTTOM = 0, 1
"""Numbers of the parts in parts.json, as ARCTIC's code has them; its documentation swaps them."""
CONVENTION = base.ManoConvention("origin", mean_added=True)
ORTHOGONAL = 0.05
"""Largest entry of R^T R - I that half precision and a network's own projection leave."""


@reads("*.mano.npy", name_parts=2, convention=CONVENTION, takes=("objects",))
def arctic(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the two parts of the object."""
    record = read_record(clip.path)
    stem = clip.path.name.removesuffix(".mano.npy")
    values = read_array(clip.path.with_name(f"{stem}.object.npy"), ("T", 7))
    folder = options.objects or base.ancestor(clip.path, 3) / TEMPLATES
    meshes, contradictions = read_parts(folder / stem.split("_")[0])
    yield base.ClipParts(
        f"ARCTIC {clip.name}",
        [_read_hand(record.record(side), side) for side in ("right", "left")],
        meshes,
        _stored_motion(values),
        cross_checks=base.CrossChecks(contradictions=contradictions),
    )


@reads(
    "*.npy",
    choose=lambda found, path: (file for file in found if file.parents[1].name in FOLDERS),
    name_parts=2,
    convention=CONVENTION,
    takes=("objects",),
)
def arctic_processed(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the two parts of the object, in the world."""
    record = read_record(clip.path)
    flat = "params" not in record and "obj_rot" in record
    params, world = (record if flat else record.record(n) for n in ("params", "world_coord"))
    motion = _stored_motion(params.side_by_side(obj_arti=1, obj_rot=3, obj_trans=3))
    folder = (options.objects or templates(clip.path)) / clip.path.stem.split("_")[0]
    meshes, contradictions = read_parts(folder)
    joints: dict[Side, Array] = {}
    for side in ("right", "left"):
        stored = world.optional_array(f"joints.{side}", (len(motion), 21, 3))
        if stored is not None:
            joints[side], _ = openpose_order(stored, "mano")
    verts = world.optional_array("verts.object", (len(motion), "V", 3))
    moved = None
    if verts is not None and verts.shape[1] == sum(len(m.verts) for m in meshes.values()):
        moved = verts.mean(1, keepdims=True), mean_vertex(folder, motion)
    yield base.ClipParts(
        f"ARCTIC {clip.name} (processed)",
        [_read_hand(params, side, f"_{side[0]}", joints.get(side)) for side in ("right", "left")],
        meshes,
        motion,
        cross_checks=base.CrossChecks(joints, object_points=moved, contradictions=contradictions),
    )


@reads("preds/", clip_is_folder=True, convention=CONVENTION, takes=("objects", "camera_pose"))
def arcticnet(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the two parts of the object, one frame for each image number."""
    words = clip.path.name.split("_")
    path = clip.path / "meta_info/meta_info.imgname.pt"
    names = Record(str(path), {"imgname": read_values(path)}).texts("imgname")
    numbers = [frame_number(Path(name)) for name in names]
    if not numbers or len(words) < 3:
        raise InputError(f"{clip.path}: expected a folder sid_object_..._view with images' names")
    if options.objects is None:
        raise InputError(
            f"{clip.path}: predictions come without object meshes; pass --objects with "
            "ARCTIC's folder meta/object_vtemplates"
        )
    meshes, contradictions = read_parts(options.objects / words[1])
    first = min(numbers)
    images = Images(clip.path / "preds", np.array(numbers) - first)
    motion = _part_motion(
        images.placed(images.read("object.radian", ("T",), ("T", 1)).reshape(-1)),
        images.placed(images.read("object.rot", ("T", 3))),
        images.placed(images.read("object.cam_t", ("T", 3))),
    )
    yield base.ClipParts(
        f"ArcticNet {clip.name}",
        [images.hand(side) for side in ("right", "left")],
        meshes,
        motion,
        notes=(
            "camera frame, depth from a weak-perspective scale",
            f"frame 0 is image {first}, ARCTIC's own frames are those numbers less ioi_offset",
        ),
        cross_checks=base.CrossChecks(contradictions=contradictions),
        camera=(0.0, 0.0, 0.0),
    )


@dataclass(frozen=True)
class Images:
    """The folder of predictions, and (N,) the frames of its images, counted from the first one."""

    folder: Path
    frames: Array

    def read(self, key: str, *shapes: Shape) -> Array:
        """(N, ...) one predicted quantity, without the padding of the last window."""
        path = self.folder / f"pred.{key}.pt"
        values = Record(str(path), {key: read_values(path)}).array(key, *shapes)
        if len(values) < len(self.frames):
            raise InputError(f"{path}: expected {len(self.frames)} frames, got {len(values)}")
        return values[: len(self.frames)]

    def placed(self, values: Array) -> Array:
        """(T, ...) values of the images at their frames, NaN in frames without an image."""
        result = np.full((int(self.frames.max()) + 1, *values.shape[1:]), np.nan)
        result[self.frames] = values
        return result

    def hand(self, side: Side) -> base.ManoParameters:
        """One hand in the camera's frame."""
        turns = self.read(f"mano.pose.{side[0]}", ("T", 16, 3, 3))
        error = np.abs(turns @ turns.swapaxes(-1, -2) - np.eye(3)).max((1, 2, 3))
        turns[error > ORTHOGONAL] = np.nan
        return base.ManoParameters(
            side,
            self.placed(axis_angles(turns)),
            self.placed(self.read(f"mano.cam_t.{side[0]}", ("T", 3))),
            self.read(f"mano.beta.{side[0]}", ("T", 10)).mean(0),
        )


def _read_hand(
    record: Record, side: Side, ending: str = "", joints: Array | None = None
) -> base.ManoParameters:
    """One hand in the world, with (T, 21, 3) stored keypoints; fields have an ending."""
    return base.ManoParameters(
        side,
        record.side_by_side(**{f"rot{ending}": 3, f"pose{ending}": 45}),
        record.array(f"trans{ending}", ("T", 3)),
        record.array(f"shape{ending}", (10,), ("T", 10)).reshape(-1, 10).mean(0),
        joints=joints,
        confidence=_confidence_of(record, f"fitting_err{ending}"),
    )


def _confidence_of(record: Record, name: str) -> Array | None:
    """(T, 21) confidence by the error of the fit, of unknown unit: min(1, median error / error)."""
    error = record.optional_array(name, ("T",), ("T", 1))
    if error is None:
        return None
    error = np.abs(error.reshape(-1))
    typical = np.nanmedian(error) if np.isfinite(error).any() else 0.0
    trust = np.where(error > typical, typical / np.maximum(error, 1e-12), 1.0)
    return np.tile(np.where(np.isfinite(error), trust, 0.0)[:, None], 21)


def _stored_motion(values: Array) -> Array:
    """(T, 2, 4, 4) of bottom and top, from (T, 7) angle, axis-angle, translation in millimetres."""
    return _part_motion(values[:, 0], values[:, 1:4], values[:, 4:] * METRES["mm"])


def _part_motion(angle: Array, orient: Array, shift: Array) -> Array:
    """(T, 2, 4, 4) of bottom and top: the top turns about the hinge, then both move as a whole."""
    whole = rotation_matrices(orient)
    opened = whole @ rotation_matrices(angle[:, None] * HINGE)
    return np.stack([rigid_matrices(whole, shift), rigid_matrices(opened, shift)], axis=1)


def read_parts(folder: Path) -> tuple[dict[str, Mesh], tuple[str, ...]]:
    """Bottom and top of a template in metres, and a contradiction if the two are exchanged."""
    mesh, ids = read_template(folder)
    where = str(folder / "mesh.obj")
    bottom, top = (part_of_mesh(mesh, ids == part, where) for part in (BOTTOM, TOP))
    meshes = {f"arctic_{folder.name}_bottom": bottom, f"arctic_{folder.name}_top": top}
    return meshes, _exchanged_parts(folder, bottom, top)


def read_template(folder: Path) -> tuple[Mesh, Array]:
    """The mesh of a whole object in metres, and (V,) the part of each vertex."""
    parts = folder / "parts.json"
    mesh = find_mesh([folder / "mesh.obj"], folder.name, "mm")
    ids = Record(str(parts), {"parts": read_json(parts)}).array("parts", ("V",))
    if len(ids) != len(mesh.verts):
        raise InputError(
            f"{parts}: expected one number for each of {len(mesh.verts)} vertices, got {len(ids)}; "
            "it belongs to another mesh"
        )
    return mesh, ids


def _exchanged_parts(folder: Path, bottom: Mesh, top: Mesh) -> tuple[str, ...]:
    """A contradiction if the parts' own meshes show that top and bottom are exchanged."""
    files = [folder / "bottom.obj", folder / "top.obj"]
    if not all(file.is_file() for file in files):
        return ()
    own_bottom, own_top = (read_mesh(file, "mm") for file in files)
    straight = apart(bottom, own_bottom) + apart(top, own_top)
    if apart(bottom, own_top) + apart(top, own_bottom) < straight:
        return ("parts: parts.json calls top what top.obj calls bottom; 0 must be the top",)
    return ()


def apart(one: Mesh, other: Mesh) -> float:
    """Distance between the centres of two meshes, metres."""
    return float((one.center().double() - other.center().double()).norm())


def templates(path: Path) -> Path:
    """The object models: beside the outputs, or where ARCTIC's scripts have the raw data."""
    roots = path.parents[2:5]
    places = [root / TEMPLATES for root in roots]
    places += [root / "data/arctic_data/data" / TEMPLATES for root in roots]
    return next((place for place in places if place.is_dir()), places[0])


def mean_vertex(folder: Path, motion: Array) -> Array:
    """(T, 1, 3) mean of the vertices of the object in a folder, each moved with its part."""
    mesh, ids = read_template(folder)
    verts = mesh.verts.double().numpy()
    total = np.zeros((len(motion), 3))
    for index, part in enumerate((BOTTOM, TOP)):
        own = verts[ids == part]
        total += motion[:, index, :3, :3] @ own.sum(0) + len(own) * motion[:, index, :3, 3]
    return (total / len(verts))[:, None]
