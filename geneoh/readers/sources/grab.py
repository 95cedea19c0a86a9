"""GRAB as it is distributed, and in the clips that TOCH and GeneOH Diffusion cut of it.

Distributed: grab/s{1..10}/{object}_{action}_{k}.npz, tools/ beside it. Hands: translation of MANO's
origin, personal templates instead of betas, absolute pose (fullpose). World frame with z up,
metres, 120 frames a second. The object's rotation is meant for row vectors, so that it is
transposed here.

Clips: {split}/{i}.npy, one structured array each. f0 hand vertices, f1 orientation, f2 24
coefficients of MANO's components (no mean pose), f3 points of the object, f5 its rotation vector
(for row vectors), f7 its number in the sorted listing of contact_meshes, f8 frame, and as the last
field whether it is a left hand. Every 4th frame of 120 a second. Hand and object are moved so that
the mean of the object's vertices is the origin, left ones mirrored as well, all but f1, f2 and f5.
GeneOH's {split}/{i}_subj.npy in the folder whose name ends in _wsubj adds betas and the place in
its own frame (right hands, translation of MANO's origin). f8 counts on over the frames that TOCH
left out, so that jumps hide in a clip: it is cut there.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import torch

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.mirror import MIRROR
from geneoh.hand.model import HandModel
from geneoh.readers import base, builders, foreign_files
from geneoh.readers.dataset_reader import reads
from geneoh.readers.mano import RIM, pose_of_coefficients
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, Record
from geneoh.readers.transforms import moved_points, rigid_matrices, rotation_matrices

MESHES = "tools/object_meshes/contact_meshes"
VERTS = 778
"""Number of MANO's vertices."""
HAND_LABELS: dict[Side, tuple[int, ...]] = {
    "left": (21, *range(26, 41)),
    "right": (22, *range(41, 56)),
}
"""Numbers of the body parts that belong to a hand, among the labels of contact."""
COEFFICIENTS = 24
POINTS_CHECKED = 50
"""Number of points that are checked in each frame, of the 8000 on the object."""
JUMP, JUMP_SHARE = 0.03, 6.0
"""Step in metres, and in multiples of the median step, beyond both of which a hand has jumped. In a
clip with a median step of 2.7 mm, frames are missing at steps of 49 and 105 mm."""
FIT_FRAMES = 50
"""Number of frames to which the shape of a hand is fitted."""
FIT_LIMIT = 0.01
"""Largest mean distance in metres of the fitted hand from the vertices; personal meshes leave some
3 mm."""
LISTINGS = (MESHES, "object_meshes")
"""Folders of the meshes below GRAB's root, and below GeneOH's data/grab."""
OTHER_FILES = ("_subj", "_meta_data")
"""Endings of the names of files that GeneOH puts beside the clips."""


def _sequences(found: Iterable[Path], path: Path) -> list[Path]:
    """Every sequence below a path, without the files of tools/."""
    root = path if path.is_dir() else path.parent
    return [file for file in found if "tools" not in file.relative_to(root).parts[:-1]]


@reads(
    "*.npz", choose=_sequences, name_parts=2, fps=120.0, convention=base.ORIGIN, takes=("objects",)
)
def grab(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the object they use; the table is left out."""
    record = foreign_files.read_record(clip.path)
    root = base.ancestor(clip.path, 3)
    name = record.text("obj_name")
    stated = record.record("object")
    motion = stated.record("params")
    # v_world = v R + t in row vectors: the rotation of column vectors is the transpose.
    turn = rotation_matrices(motion.array("global_orient", ("T", 3))).transpose(0, 2, 1)
    shift = motion.array("transl", ("T", 3))
    motion.refuse_lengths("global_orient", "transl")
    hands = [_hand_of(record, side, root) for side in ("right", "left")]
    meshes = {f"grab_{name}": _object_of(stated, name, root, options)}
    fps = record.finite("framerate") if "framerate" in record else None
    yield base.ClipParts(f"GRAB {clip.name}", hands, meshes, rigid_matrices(turn, shift), fps=fps)


def frames_of_touch(clip: base.SourceClip) -> dict[Side, Array]:
    """(T,) mask for each hand of the frames in which it touches the object, by contact labels."""
    labels = contact_labels(foreign_files.read_record(clip.path))
    return {side: np.any(np.isin(labels, parts), axis=1) for side, parts in HAND_LABELS.items()}


def contact_labels(record: Record) -> Array:
    """(T, V) label of the body part that touches each vertex of the object; 0 for none."""
    contact = record.record("contact")
    labels = contact.values.get("object")
    # Not through `Record.array`: as float64 the labels of a dense mesh take eight times the memory.
    if not isinstance(labels, np.ndarray) or labels.ndim != 2 or labels.dtype.kind not in "iu":
        raise contact.refuse("object", "whole numbers of shape (T, V)")
    return labels


def _object_of(stated: Record, name: str, root: Path, options: base.ReaderOptions) -> Mesh:
    """The object's mesh, by the path in the file or by its name."""
    places = [root / MESHES / f"{name}.ply"]
    if "object_mesh" in stated:
        places.insert(0, inside(root, stated.text("object_mesh")))
    if options.objects is not None:
        places.insert(0, options.objects / f"{name}.ply")
    return find_mesh(places, name)


def _hand_of(record: Record, side: Side, root: Path) -> base.ManoParameters:
    """One hand, with its person's template and the betas that agree with it approximately."""
    hand = record.record("rhand" if side == "right" else "lhand")
    params = hand.record("params")
    mesh = inside(root, hand.text("vtemp")) if "vtemp" in hand else root / "no such file"
    betas = mesh.with_name(f"{mesh.stem}_betas.npy")
    template = read_mesh(mesh).verts.double().numpy() if mesh.is_file() else None
    template = template if template is not None and len(template) == VERTS else None
    pose = params.side_by_side(global_orient=3, fullpose=45)
    places = params.array("transl", ("T", 3))
    shape = foreign_files.read_array(betas, (10,)) if betas.is_file() else None
    return base.ManoParameters(side, pose, places, shape, template=template)


def inside(root: Path, relative: str) -> Path:
    """A path that a file names, without parts that would lead out of the data set."""
    words = [word for word in relative.replace("\\", "/").split("/") if word not in ("", ".", "..")]
    return root.joinpath(*words)


@reads(
    "*.npy",
    choose=lambda found, path: (file for file in found if not file.stem.endswith(OTHER_FILES)),
    name_parts=2,
    takes=("objects",),
)
def grab_clips(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """One hand and the object; each run of frames without a jump becomes a recording."""
    record = _read_fields(clip.path)
    side = _side_of(record)
    mano = builders.mano_of_coefficients(options, side, str(clip.path))
    mirror = np.array(MIRROR) if side == "left" else np.ones(3)
    verts = record.array("f0", ("T", 3 * VERTS)).reshape(-1, VERTS, 3) * mirror
    coefficients = record.array("f2", ("T", COEFFICIENTS))
    fingers = pose_of_coefficients(record, "f2", coefficients, mano, add_mean=False)
    orient = record.array("f1", ("T", 3))
    pose = np.concatenate([orient, fingers], axis=1).reshape(-1, 16, 3)
    subject = read_subject(clip.path, side, len(verts))
    notes: tuple[str, ...] = ()
    if subject is None:
        betas, wrist = shape_and_wrist(mano.model, pose, verts, record)
        offset = np.zeros((len(verts), 3))
        notes = ("centred on the object in each frame: its path is not in the file",)
    else:
        betas, places, moved_verts = subject
        wrist, offset = places + mano.wrist_offset(betas), (moved_verts - verts).mean(1)
    name, mesh = _read_object(record, clip.path, options)
    # The mean of the moved vertices is the origin; f6 agrees, except for left hands.
    rotation = rotation_matrices(record.array("f5", ("T", 3))).transpose(0, 2, 1)
    middle = mesh.verts.double().numpy().mean(0)
    motion = rigid_matrices(rotation, offset - rotation @ middle)
    joints = mano.keypoints(pose, wrist, betas)
    rim = verts[:, RIM].mean(1)
    points = stored_points(record) * mirror + offset[:, None]
    moved = points, _nearest_points(points, mesh, motion)
    yield base.ClipParts(
        f"GRAB clip {clip.name}",
        [builders.hand_track(side, joints, pose=pose, wrist=wrist, betas=betas)],
        {f"grab_{name}": mesh},
        motion,
        notes=notes,
        after_jump=jumps(record, rim, rotation),
        cross_checks=base.CrossChecks(rim={side: rim + offset}, object_points=moved),
    )


def _read_fields(path: Path) -> Record:
    """The fields of the structured array by name."""
    value = read_values(path)
    names = value.dtype.names if isinstance(value, np.ndarray) else None
    if names is None or value.ndim != 1 or not {f"f{k}" for k in range(10)} <= set(names):
        raise InputError(
            f"{path}: expected a structured array with the fields f0 to f9 of TOCH's clips, got "
            f"{'none' if names is None else ', '.join(names)}; choose another source"
        )
    return Record(str(path), {name: value[name] for name in names})


def _side_of(record: Record) -> Side:
    """Which hand: the last field, f9 before TOCH's correspondences are added and f12 after."""
    name = "f12" if "f12" in record else "f9"
    left = record.array(name, ("T",))
    if left.any() != left.all():
        raise record.refuse(name, "the same hand in all frames")
    return "left" if left.any() else "right"


def read_subject(path: Path, side: Side, frames: int) -> tuple[Array, Array, Array] | None:
    """GeneOH's betas, translations and (T, 778, 3) vertices of a right hand, if there are any."""
    split = path.parent
    folders = (split, split.parent.with_name(f"{split.parent.name}_wsubj") / split.name)
    files = [folder / f"{path.stem}_subj.npy" for folder in folders]
    found = next((file for file in files if file.is_file()), None)
    if found is None or side == "left":
        return None
    record = foreign_files.read_record(found)
    places = record.array("rhand_transl", (frames, 3), remedy="it belongs to another clip")
    verts = record.array("rhand_verts", (frames, VERTS, 3), remedy="it belongs to another clip")
    return record.array("rhand_betas", (10,)), places, verts


def shape_and_wrist(
    model: HandModel, pose: Array, verts: Array, record: Record
) -> tuple[Array, Array]:
    """(10,) betas and (T, 3) wrist of the hand nearest to the vertices, by linear least squares."""
    chosen = np.unique(np.linspace(0, len(pose) - 1, FIT_FRAMES).astype(int))
    trial = torch.cat([torch.zeros(1, 10), torch.eye(10)])
    poses, nowhere = torch.from_numpy(pose[chosen]).float(), torch.zeros(len(chosen), 3)
    made = torch.stack([model.shaped(b).posed(poses, nowhere).verts for b in trial])
    basis = made.double().numpy()
    basis[1:] -= basis[0]
    centred = basis - basis.mean(2, keepdims=True)
    wanted = verts[chosen] - verts[chosen].mean(1, keepdims=True) - centred[0]
    if not np.isfinite(wanted).all() or not np.isfinite(centred).all():
        raise record.refuse("f0", "finite vertices of a hand in a finite pose")
    betas = np.linalg.lstsq(centred[1:].reshape(10, -1).T, wanted.reshape(-1), rcond=None)[0]
    shaped = model.shaped(torch.from_numpy(betas).float())
    posed = shaped.posed(torch.from_numpy(pose).float(), torch.zeros(len(pose), 3)).verts
    wrist = (verts - posed.double().numpy()).mean(1)
    missed = np.linalg.norm(posed.double().numpy() + wrist[:, None] - verts, axis=-1).mean()
    if missed > FIT_LIMIT:
        raise InputError(
            f"{record.where}: expected vertices that f1 and f2 pose, got ones {1000 * missed:.0f} "
            "mm from the nearest hand; f1 is of the other hand, or the clip is no longer as TOCH "
            "wrote it"
        )
    return betas, wrist


def _read_object(record: Record, path: Path, options: base.ReaderOptions) -> tuple[str, Mesh]:
    """Name and mesh of the object, by its number in the sorted listing of all meshes."""
    if options.meshes:
        return path.stem, options.meshes[0]
    places = [root / listing for root in path.parents for listing in LISTINGS]
    folder = options.objects or next((place for place in places if place.is_dir()), None)
    if folder is None or not folder.is_dir():
        raise InputError(
            f"{path}: expected GRAB's meshes in {MESHES} of a folder above, got none; pass "
            "--objects with the folder, or --obj with the object's mesh"
        )
    # files such as .DS_Store are not of the data set, and would shift the numbers
    listing = sorted(file.name for file in folder.iterdir() if file.name[0] != ".")
    numbers = set(record.integers("f7"))
    if len(numbers) != 1:
        raise record.refuse("f7", "one object in all frames: a clip, not a whole split")
    number = numbers.pop()
    if not 0 <= number < len(listing):
        raise record.refuse("f7", f"the number of one of {len(listing)} files in {folder}")
    file = folder / listing[number]
    return file.stem, read_mesh(file)


def jumps(record: Record, rim: Array, rotation: Array) -> Array:
    """(T,) mask of the frames that do not directly follow the previous one in time.

    Steps are measured in the file's frame, which shows jumps that the object shares, and in the
    object's frame, which shows jumps during a fast motion.
    """
    after = np.concatenate([[False], np.diff(record.array("f8", ("T",))) != 1])
    for seen in (rim, np.einsum("tji,tj->ti", rotation, rim)):
        steps = np.linalg.norm(np.diff(seen, axis=0), axis=1)
        typical = np.median(steps) if len(steps) else 0.0
        after[1:] |= steps > max(JUMP, JUMP_SHARE * typical)
    return after


def stored_points(record: Record) -> Array:
    """(T, P, 3) some of the file's points on the object."""
    points = record.array("f3", ("T", "P"))
    if points.shape[1] % 3:
        raise record.refuse("f3", "three numbers for each point")
    return points.reshape(len(points), -1, 3)[:, :POINTS_CHECKED]


def _nearest_points(points: Array, mesh: Mesh, motion: Array) -> Array:
    """(T, P, 3) the nearest points on the moved mesh."""
    local = torch.from_numpy((points - motion[:, None, :3, 3]) @ motion[:, :3, :3])
    return moved_points(SurfaceDistance(mesh).query(local).closest.numpy(), motion)
