"""GRAB as it is distributed: grab/s{1..10}/{object}_{action}_{k}.npz, tools/ beside it.

Hands: translation of MANO's origin, personal templates instead of betas, absolute pose (fullpose).
World frame with z up, metres, 120 frames a second. The object's rotation is meant for row vectors,
so that it is transposed here.
"""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.geometry.mesh import Mesh
from geneoh.readers import base
from geneoh.readers.dataset_reader import DatasetReader
from geneoh.readers.foreign_files import read_array, read_record
from geneoh.readers.meshes import find_mesh, read_mesh
from geneoh.readers.records import Array, Record
from geneoh.readers.transforms import rigid_matrices, rotation_matrices

MESHES = "tools/object_meshes/contact_meshes"
MANO_VERTICES = 778
HAND_LABELS: dict[Side, tuple[int, ...]] = {
    "left": (21, *range(26, 41)),
    "right": (22, *range(41, 56)),
}
"""Numbers of the body parts that belong to a hand, among the labels of contact."""


def sequences(found: Iterable[Path], path: Path) -> list[Path]:
    """Every sequence below a path, without the files of tools/."""
    root = path if path.is_dir() else path.parent
    return [file for file in found if "tools" not in file.relative_to(root).parts[:-1]]


def parts(clip: base.SourceClip, options: base.ReaderOptions) -> base.Parts:
    """Both hands and the object they use; the table is left out."""
    record = read_record(clip.path)
    root = base.ancestor(clip.path, 3)
    name = record.text("obj_name")
    stated = record.record("object")
    motion = stated.record("params")
    # v_world = v R + t in row vectors: the rotation of column vectors is the transpose.
    turn = rotation_matrices(motion.array("global_orient", ("T", 3))).transpose(0, 2, 1)
    shift = motion.array("transl", ("T", 3))
    motion.refuse_lengths("global_orient", "transl")
    yield base.ClipParts(
        f"GRAB {clip.name}",
        [read_hand(record, side, root) for side in ("right", "left")],
        {f"grab_{name}": read_object(stated, name, root, options)},
        rigid_matrices(turn, shift),
        fps=record.finite("framerate") if "framerate" in record else None,
    )


def touching(clip: base.SourceClip) -> dict[Side, Array]:
    """(T,) for each hand, the frames in which it touches the object, by the labels of contact.

    `InputError` where the file has no contact labels for the object's vertices.
    """
    contact = read_record(clip.path).record("contact")
    labels = contact.values.get("object")
    # Not through `Record.array`: as float64 the labels of a dense mesh take eight times the memory.
    if not isinstance(labels, np.ndarray) or labels.ndim != 2 or labels.dtype.kind not in "iu":
        raise contact.refuse("object", "whole numbers of shape (T, V)")
    return {side: np.any(np.isin(labels, parts), axis=1) for side, parts in HAND_LABELS.items()}


def read_object(stated: Record, name: str, root: Path, options: base.ReaderOptions) -> Mesh:
    """The object's mesh, by the path in the file or by its name."""
    places = [root / MESHES / f"{name}.ply"]
    if "object_mesh" in stated:
        places.insert(0, inside(root, stated.text("object_mesh")))
    if options.objects is not None:
        places.insert(0, options.objects / f"{name}.ply")
    return find_mesh(places, name)


def read_hand(record: Record, side: Side, root: Path) -> base.ManoParameters:
    """One hand, with its person's template and the betas that agree with it approximately."""
    hand = record.record("rhand" if side == "right" else "lhand")
    params = hand.record("params")
    mesh = inside(root, hand.text("vtemp")) if "vtemp" in hand else root / "no such file"
    betas = mesh.with_name(f"{mesh.stem}_betas.npy")
    template = read_mesh(mesh).verts.double().numpy() if mesh.is_file() else None
    return base.ManoParameters(
        side,
        params.side_by_side(global_orient=3, fullpose=45),
        params.array("transl", ("T", 3)),
        betas=read_array(betas, (10,)) if betas.is_file() else None,
        template=template if template is not None and len(template) == MANO_VERTICES else None,
    )


def inside(root: Path, relative: str) -> Path:
    """A path that a file names, which must not lead out of the data set."""
    words = [word for word in relative.replace("\\", "/").split("/") if word not in ("", ".", "..")]
    return root.joinpath(*words)


READER = DatasetReader(
    parts, ("*.npz",), choose=sequences, name_parts=2, fps=120.0, convention=base.ORIGIN
)
