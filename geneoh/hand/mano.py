"""The MANO hand (Romero et al. 2017) from the file its user owns; nothing of it ships with geneoh.

Reads the official `MANO_RIGHT.pkl` and `MANO_LEFT.pkl`, and npz files with the same fields as
`smplx` writes them, without chumpy and without running the pickle (see `geneoh.files.pickles`).

Left shapes: the official left file holds the right hand's shape directions although its template is
mirrored (smplx issue 48). The same betas therefore mean two different left hands: "mano" is MANO
with mirrored ("mended") left directions, "mano-as-shipped" uses the official left file unchanged.
Their right hand is the same and is called "mano".
"""

import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import SIDES, Side
from geneoh.errors import InputError, MissingAssetError
from geneoh.files.values import read_values
from geneoh.geometry.mirror import MIRROR
from geneoh.hand.embedded import POSE, TIP_VERTS, embedded_hand, hand_model
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import LARGEST_HAND, PARENTS, SMALLEST_HAND

ENVIRONMENT = "GENEOH_MANO_DIR"
LARGEST_NUMBER = 2**32  # of a MANO file: the parent of the root is stored as 2**32 - 1
HOME = "https://mano.is.tue.mpg.de"
FOLDERS = ("", "models", "mano", "mano_v1_2/models")
"""Sub-folders of the user's folder that are searched: as unpacked, or as smplx expects them."""
FIELDS = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "f", "kintree_table")
BETAS = 10
SAME_SHAPE = 1e-6
"""Metres: the x rows of left and right shape directions differ by less in the official files."""

ManoName = Literal["mano", "mano-as-shipped"]
MENDED: ManoName = "mano"
AS_SHIPPED: ManoName = "mano-as-shipped"
MANO_NAMES = MENDED, AS_SHIPPED


def name_of(side: Side, name: ManoName) -> ManoName:
    """The name of one side's hand in a convention: right hands are the same in both."""
    return MENDED if side == "right" else name


@dataclass(frozen=True)
class PoseSpace:
    """MANO's PCA space of poses: its mean pose and its principal components."""

    mean: Float[Tensor, " 45"]  # what flat_hand_mean=False adds to a pose, radians
    components: Float[Tensor, "45 45"]  # rows of the pose components; not of unit length


def load_mano(
    side: Side, mano_dir: Path | str | None = None, *, name: ManoName = MENDED
) -> HandModel:
    """One MANO hand, of the convention `name`; see `geneoh.hand.library.load_hand`.

    The directions of a left file that are mirrored already are kept for "mano", and mirrored back
    for "mano-as-shipped".
    """
    path = find_mano(side, mano_dir)
    fields = _read_fields(path)
    _refuse_other_side(path, side, fields)
    if side == "left" and _is_as_shipped(fields, path) != (name == AS_SHIPPED):
        fields["shapedirs"] = fields["shapedirs"] * np.array(MIRROR)[:, None]
    return _model(side, fields, name_of(side, name))


def load_pose_space(side: Side, mano_dir: Path | str | None = None) -> PoseSpace:
    """Mean pose and pose components of one MANO hand; raises as `load_mano`."""
    path = find_mano(side, mano_dir)
    fields = _read_fields(path, ("hands_mean", "hands_components"))
    return PoseSpace(*(torch.from_numpy(fields[n].astype(np.float32)) for n in fields))


def mano_folder(mano_dir: Path | str | None) -> Path | None:
    """The folder of the user's MANO files: that of the caller, else that of the environment."""
    folder = mano_dir or os.environ.get(ENVIRONMENT)
    return Path(folder) if folder else None


def find_mano(side: Side, mano_dir: Path | str | None = None) -> Path:
    """The file of one side; `MissingAssetError` says what to get and where to put it."""
    root = mano_folder(mano_dir)
    name = f"MANO_{side.upper()}.pkl"
    advice = (
        f"register at {HOME}, download mano_v1_2.zip and put its {name} there, "
        "or use the embedded hand, which needs no file"
    )
    if root is None:
        raise MissingAssetError(
            f"{name}: no folder is given, so name one with --mano or in the environment variable "
            f"{ENVIRONMENT}; {advice}"
        )
    for place in FOLDERS:
        for candidate in (root / place / name, (root / place / name).with_suffix(".npz")):
            if os.path.isfile(candidate):
                return candidate
    raise MissingAssetError(f"{root / name}: expected this file and found none; {advice}")


def mano_files(folder: Path | str) -> list[Path]:
    """The MANO files that are in a folder: of both sides, one side or none."""
    found = []
    for side in SIDES:
        with suppress(MissingAssetError):
            found.append(find_mano(side, folder))
    return found


def refuse_without_mano(folder: Path | str) -> None:
    """`MissingAssetError` for a folder that holds the file of neither side."""
    if not mano_files(folder):
        find_mano("right", folder)


def translation_from_wrist(
    model: HandModel, betas: Float[Tensor, "*#B S"], wrist: Float[Tensor, "*#B 3"]
) -> Float[Tensor, "*B 3"]:
    """smplx's translation (convention O) from the wrist (convention W): t_O = t_W - J0(betas)."""
    return wrist - model.rest_wrist(betas)


def _read_fields(path: Path, needed: tuple[str, ...] = FIELDS) -> dict[str, np.ndarray]:
    """MANO's arrays by name, checked; `InputError` names the file, the field and what to do."""
    try:
        raw = read_values(path)
    except InputError as error:
        raise InputError(f"{error}; for MANO, download it again from {HOME}") from error
    raw = raw if isinstance(raw, dict) else {}
    missing = [name for name in needed if name not in raw]
    if missing:
        raise InputError(
            f"{path}: expected a MANO file, but {', '.join(missing)} is not in it; "
            f"use the official one from {HOME}"
        )
    optional = {"hands_mean"} & raw.keys() - set(needed)
    fields = {name: _array(path, name, raw[name]) for name in (*needed, *optional)}
    _check_shapes(path, fields)
    return fields


def _array(path: Path, name: str, value: Any) -> np.ndarray:
    """One field as an array of numbers."""
    array = value if isinstance(value, np.ndarray) else np.zeros(0, dtype=object)
    if array.dtype.kind not in "fiu" or not (np.abs(array.astype(float)) <= LARGEST_NUMBER).all():
        got = array.dtype if isinstance(value, np.ndarray) else type(value).__name__
        raise InputError(
            f"{path}: '{name}' must hold finite numbers up to {LARGEST_NUMBER}, got {got}; "
            f"use the official file from {HOME}"
        )
    return array


def _check_shapes(path: Path, fields: dict[str, np.ndarray]) -> None:
    """Refuse arrays of other shapes than MANO's, and another kinematic tree."""
    for name in ("hands_mean", "hands_components"):
        shape = (45,) if name == "hands_mean" else (45, 45)
        if name in fields and fields[name].shape != shape:
            raise InputError(f"{path}: '{name}' must be {shape}, got {fields[name].shape}")
    if "v_template" not in fields:
        return
    verts = fields["v_template"].shape[0] if fields["v_template"].ndim else 0
    shapes: dict[str, tuple[int, ...]] = {
        "v_template": (verts, 3),
        "posedirs": (verts, 3, 135),
        "J_regressor": (16, verts),
        "weights": (verts, 16),
        "kintree_table": (2, 16),
    }
    for name, shape in shapes.items():
        if fields[name].shape != shape:
            raise InputError(
                f"{path}: '{name}' must be {shape}, got {fields[name].shape}; this is no MANO hand"
            )
    dirs, faces = fields["shapedirs"].shape, fields["f"].shape
    if len(dirs) != 3 or dirs[:2] != (verts, 3) or dirs[2] < BETAS:
        raise InputError(f"{path}: 'shapedirs' must be ({verts}, 3, {BETAS}), got {dirs}")
    if len(faces) != 2 or not faces[0] or faces[1] != 3 or verts <= max(TIP_VERTS):
        raise InputError(f"{path}: expected 778 vertices and (F, 3) faces, got {verts} and {faces}")
    if fields["f"].min() < 0 or fields["f"].max() >= verts:
        raise InputError(f"{path}: 'f' names vertices beyond the {verts} there are")
    # The root's parent is -1, stored as 2**32 - 1.
    if tuple(fields["kintree_table"][0, 1:].astype(int)) != PARENTS[1:]:
        raise InputError(f"{path}: 'kintree_table' is not MANO's tree of 16 joints")
    _check_size(path, fields)


def _check_size(path: Path, fields: dict[str, np.ndarray]) -> None:
    """Refuse a rest hand, shape directions or pose correctives of a size that no hand has."""
    verts = fields["v_template"].astype(float)
    points = np.concatenate([fields["J_regressor"].astype(float) @ verts, verts[list(TIP_VERTS)]])
    for name, least, found in (
        ("v_template", SMALLEST_HAND, np.ptp(points, axis=0).max()),
        ("shapedirs", 0.0, np.abs(fields["shapedirs"]).max()),
        ("posedirs", 0.0, np.abs(fields["posedirs"]).max()),
    ):
        if not least <= found <= LARGEST_HAND:
            raise InputError(
                f"{path}: '{name}' must be in metres and span {least:g} to {LARGEST_HAND:g}, "
                f"got {found:.3g}; use the official file from {HOME}"
            )


def _refuse_other_side(path: Path, side: Side, fields: dict[str, np.ndarray]) -> None:
    """Refuse the hand of the other side: fingers of the right rest hand point along -x."""
    verts = fields["v_template"].astype(float)
    wrist = fields["J_regressor"][0].astype(float) @ verts
    found = "right" if (verts[list(TIP_VERTS)] - wrist)[:, 0].mean() < 0 else "left"
    if found != side:
        raise InputError(
            f"{path}: expected the {side} hand, got the {found} one (by the direction of its "
            f"fingers); give each file the name that it has in the download from {HOME}"
        )


def _is_as_shipped(left: dict[str, np.ndarray], path: Path) -> bool:
    """Whether a left file has the right hand's shape directions: by the right file beside it, else
    because shapes that widen the hand shorten it. People differ in the size of the hand first."""
    with suppress(MissingAssetError):
        right = _read_fields(find_mano("right", path.parent))
        if right["shapedirs"].shape == left["shapedirs"].shape:
            gap = np.abs(right["shapedirs"][:, 0] - left["shapedirs"][:, 0]).max()
            return bool(gap < SAME_SHAPE)
    verts, dirs = (left[name].astype(float) for name in ("v_template", "shapedirs"))
    growth = np.einsum("vc,vcs->cs", verts - verts.mean(0), dirs)
    return float((growth[0] * growth[1:].sum(0)).sum()) <= 0


def _model(side: Side, fields: dict[str, np.ndarray], name: ManoName) -> HandModel:
    """A `HandModel` of the fields, with the embedded hand's joint limits (same rest frame)."""
    pose = {name: getattr(embedded_hand(side), name) for name in POSE}
    if "hands_mean" in fields:
        mean = torch.from_numpy(fields["hands_mean"].astype(np.float32)).reshape(15, 3)
        pose["pose_mean"] = torch.cat([torch.zeros(1, 3), mean])
    return hand_model(name, side, fields | {"shapedirs": fields["shapedirs"][..., :BETAS]}, pose)
