"""GRAB as it is distributed: grab/s{1..10}/{object}_{action}_{k}.npz, tools/ beside it.

Convention O with personal templates and no betas, absolute pose (fullpose), 120 frames a second, z
up. The object's rotation is meant for row vectors, so that as a column-vector pose it is
transposed.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.geometry.mesh import Mesh
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clips, finite_frames
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
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, Record, read_array, read_record

CONVENTION = ManoConvention(origin=True)
FPS = 120.0
HAND_LABELS: dict[Side, tuple[int, ...]] = {
    "left": (21, *range(26, 41)),
    "right": (22, *range(41, 56)),
}
"""Numbers of the body parts that are a hand, among the labels of contact."""


def find(path: Path) -> list[SourceClip]:
    """Every sequence file; those of the tools beside them are none."""
    root = path if path.is_dir() else path.parent
    found = clips(path, "*.npz", 2)
    return [clip for clip in found if "tools" not in clip.path.relative_to(root).parts[:-1]]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Both hands and the object they use; the table is left out."""
    record = read_record(clip.path)
    root = clip.path.parents[2] if len(clip.path.parents) > 2 else clip.path.parent
    name = record.text("obj_name")
    stated = record.record("object")
    params = stated.record("params")
    shift = params.array("transl", ("T", 3))
    # v_world = v R + t in row vectors: the column-vector rotation is the transpose.
    rotation = turned(params.array("global_orient", ("T", 3))).transpose(0, 2, 1)
    motion = matrices(rotation, shift)
    fps = record.number("framerate") if "framerate" in record else FPS
    sequence = sequence_of(
        [read_hand(record, side, root, known) for side in ("right", "left")],
        object_track([read_object(stated, name, root, known)], motion[:, None]),
        known.rate(fps),
        f"GRAB {clip.name}",
    )
    present = finite_frames(motion)
    return recordings(clip.name, sequence, object_known=present, mesh_names=(f"grab_{name}",))


def touching(clip: SourceClip) -> dict[Side, Array]:
    """(T,) for each hand, the frames in which it touches the object, by the labels of contact.

    Raises:
        InputError: the file has no contact labels for the object's vertices.
    """
    contact = read_record(clip.path).record("contact")
    labels = contact.values.get("object")
    # Not through `Record.array`: as float64 the labels of a dense mesh take eight times the memory.
    if not isinstance(labels, np.ndarray) or labels.ndim != 2 or labels.dtype.kind not in "iu":
        raise contact.refuse("object", "whole numbers of shape (T, V)")
    return {side: np.any(np.isin(labels, parts), axis=1) for side, parts in HAND_LABELS.items()}


def read_object(stated: Record, name: str, root: Path, known: ReaderOptions) -> Mesh:
    """The object's mesh, by the path in the file or by its name."""
    places = [root / "tools/object_meshes/contact_meshes" / f"{name}.ply"]
    if "object_mesh" in stated:
        places.insert(0, within(root, stated.text("object_mesh")))
    if known.objects is not None:
        places.insert(0, known.objects / f"{name}.ply")
    return read_mesh(find_mesh(places, name))


def read_hand(record: Record, side: Side, root: Path, known: ReaderOptions) -> Track:
    """One hand, with its person's template and betas where they are there."""
    hand = record.record("rhand" if side == "right" else "lhand")
    params = hand.record("params")
    orient = params.array("global_orient", ("T", 3))
    pose = np.concatenate([orient, params.array("fullpose", ("T", 45))], axis=1)
    return mano_track(
        ManoParameters(side, pose, params.array("transl", ("T", 3)), betas=read_betas(hand, root)),
        CONVENTION,
        known,
        record.where,
        template=read_template(hand, root),
    )


def read_template(hand: Record, root: Path) -> Array | None:
    """(778, 3) the person's own mesh, if it is there."""
    path = within(root, hand.text("vtemp")) if "vtemp" in hand else None
    if path is None or not path.is_file():
        return None
    verts = read_mesh(path).verts.double().numpy()
    return verts if len(verts) == 778 else None


def read_betas(hand: Record, root: Path) -> Array | None:
    """(10,) betas that agree with the template approximately, if they are there."""
    path = within(root, hand.text("vtemp")) if "vtemp" in hand else None
    path = None if path is None else path.with_name(f"{path.stem}_betas.npy")
    return None if path is None or not path.is_file() else read_array(path, (10,))


def within(root: Path, relative: str) -> Path:
    """A path that a file names, which must not lead out of the data set."""
    words = [word for word in relative.replace("\\", "/").split("/") if word not in ("", ".", "..")]
    return root.joinpath(*words)
