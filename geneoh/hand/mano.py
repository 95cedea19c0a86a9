"""The MANO hand (Romero et al. 2017) from the file its user owns; nothing of it ships with geneoh.

Reads the official `MANO_RIGHT.pkl` and `MANO_LEFT.pkl`, and npz files with the same fields as
`smplx` writes them, without chumpy and without running the pickle (see `pickles`).

Left shapes: the official left file carries the right hand's shape directions although its template
is mirrored, so equal betas give different hands (smplx issue 48). They are mended here unless
`mend_left=False`; data sets made with the file as it is (ARCTIC, DexYCB, TACO, H2O) need that.
"""

import os
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.errors import InputError, MissingAssetError
from geneoh.hand.embedded import TIP_VERTS, embedded_right
from geneoh.hand.model import HandModel, Side
from geneoh.hand.pickles import MOST_BYTES, RefusedPickleError, read_pickle, unfold
from geneoh.hand.skeleton import PARENTS

ENVIRONMENT = "GENEOH_MANO_DIR"
HOME = "https://mano.is.tue.mpg.de"
FOLDERS = ("", "models", "mano", "mano_v1_2/models")
"""Where in the given folder the files are looked for: as unpacked, or as smplx wants them."""
FIELDS = ("v_template", "shapedirs", "posedirs", "J_regressor", "weights", "f", "kintree_table")
BETAS = 10
SAME_SHAPE = 1e-6
"""Metres: the left x row equals the right one to rounding when the file has the error."""


def load_mano(
    side: Side, mano_dir: Path | str | None = None, *, mend_left: bool = True
) -> HandModel:
    """One MANO hand.

    Args:
        side: "left" or "right".
        mano_dir: folder that holds MANO_RIGHT.pkl and MANO_LEFT.pkl (or .npz); without it the
            environment variable GENEOH_MANO_DIR says where.
        mend_left: give the left hand the mirror of the right hand's shape directions. A left file
            that was mended before is recognised if the right one lies beside it.

    Raises:
        MissingAssetError: there is no such file; the message says where to get it.
        InputError: the file is not a MANO file.
    """
    path = find_mano(side, mano_dir)
    fields = _read_fields(path)
    if side == "left" and mend_left and _needs_mending(fields, path):
        fields["shapedirs"] = fields["shapedirs"] * np.array([-1.0, 1.0, 1.0])[:, None]
    return _model(side, fields)


def find_mano(side: Side, mano_dir: Path | str | None = None) -> Path:
    """The file of one side; `MissingAssetError` says what to get and where to put it."""
    folder = mano_dir or os.environ.get(ENVIRONMENT)
    name = f"MANO_{side.upper()}.pkl"
    advice = (
        f"register at {HOME}, download mano_v1_2.zip and put its {name} there, "
        "or use the embedded hand, which needs no file"
    )
    if not folder:
        raise MissingAssetError(
            f"{name}: no folder is given, so name one with --mano or in the environment variable "
            f"{ENVIRONMENT}; {advice}"
        )
    root = Path(folder)
    for place in FOLDERS:
        for candidate in (root / place / name, (root / place / name).with_suffix(".npz")):
            if candidate.is_file():
                return candidate
    raise MissingAssetError(f"{root / name}: expected this file and found none; {advice}")


def wrist_from_translation(
    model: HandModel, betas: Float[Tensor, "*#B S"], transl: Float[Tensor, "*#B 3"]
) -> Float[Tensor, "*B 3"]:
    """Wrist position (convention W) of smplx's translation (convention O): t_W = t_O + J0(beta)."""
    return transl + _root(model, betas)


def translation_from_wrist(
    model: HandModel, betas: Float[Tensor, "*#B S"], wrist: Float[Tensor, "*#B 3"]
) -> Float[Tensor, "*B 3"]:
    """The inverse of `wrist_from_translation`."""
    return wrist - _root(model, betas)


def _root(model: HandModel, betas: Float[Tensor, "*B S"]) -> Float[Tensor, "*B 3"]:
    """J0(beta): where the rest pose has its wrist joint."""
    dirs = torch.einsum("v,vcs->cs", model.joint_regressor[0], model.shape_dirs)
    mean = model.joint_regressor[0] @ model.template
    return mean + betas @ dirs[:, : betas.shape[-1]].T


def _read_fields(path: Path) -> dict[str, np.ndarray]:
    """MANO's arrays by name, checked; `InputError` names the file, the field and what to do."""
    raw = _read_npz(path) if path.suffix == ".npz" else _read_pkl(path)
    missing = [name for name in FIELDS if name not in raw]
    if missing:
        raise InputError(
            f"{path}: expected a MANO file, but {', '.join(missing)} is not in it; "
            f"use the official one from {HOME}"
        )
    fields = {}
    for name in (*FIELDS, "hands_mean"):
        if name in raw:
            fields[name] = _array(path, name, raw[name])
    _check_shapes(path, fields)
    return fields


def _read_pkl(path: Path) -> Mapping[str, Any]:
    """The pickle's dictionary, not run; arrays still folded up."""
    if path.stat().st_size > MOST_BYTES:
        raise InputError(f"{path}: expected a MANO file of about 4 MB, got one of over 256 MB")
    try:
        return read_pickle(path.read_bytes())
    except RefusedPickleError as error:
        raise InputError(
            f"{path}: it asks for {error}, which no MANO file needs, so it was not read; "
            f"use the official file from {HOME}"
        ) from error
    except ValueError as error:
        raise InputError(
            f"{path}: expected MANO's pickle, got something broken ({error}); "
            f"download it again from {HOME}"
        ) from error


def _read_npz(path: Path) -> Mapping[str, Any]:
    """The npz file's arrays; none may hold Python objects."""
    try:
        with zipfile.ZipFile(path) as archive:
            total = sum(info.file_size for info in archive.infolist())
        if total > MOST_BYTES:
            raise InputError(f"{path}: expected MANO's arrays, about 4 MB, got over 256 MB")
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in (*FIELDS, "hands_mean") if name in data.files}
    except (OSError, ValueError, EOFError, MemoryError, zipfile.BadZipFile) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"{path}: expected an npz of plain arrays ({error}); use the official pkl file instead"
        ) from error


def _array(path: Path, name: str, value: Any) -> np.ndarray:
    """One field as an array of numbers."""
    try:
        array = value if isinstance(value, np.ndarray) else unfold(value)
    # What is left in a damaged pickle can fail in numpy in many ways.
    except Exception as error:
        raise InputError(
            f"{path}: '{name}' cannot be read ({error}); download the file again from {HOME}"
        ) from error
    if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise InputError(
            f"{path}: '{name}' must hold finite numbers, got {array.dtype}; "
            f"use the official file from {HOME}"
        )
    return array


def _check_shapes(path: Path, fields: dict[str, np.ndarray]) -> None:
    """Refuse arrays of other shapes than MANO's, and another kinematic tree."""
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
    if len(faces) != 2 or faces[1] != 3 or verts <= max(TIP_VERTS):
        raise InputError(f"{path}: expected 778 vertices and (F, 3) faces, got {verts} and {faces}")
    if fields["f"].min() < 0 or fields["f"].max() >= verts:
        raise InputError(f"{path}: 'f' names vertices beyond the {verts} there are")
    # The root's parent is -1, stored as 2**32 - 1.
    if tuple(fields["kintree_table"][0, 1:].astype(int)) != PARENTS[1:]:
        raise InputError(f"{path}: 'kintree_table' is not MANO's tree of 16 joints")
    if "hands_mean" in fields and fields["hands_mean"].shape != (45,):
        raise InputError(f"{path}: 'hands_mean' must be (45,), got {fields['hands_mean'].shape}")


def _needs_mending(left: dict[str, np.ndarray], path: Path) -> bool:
    """Whether a left file has the right hand's shape directions; yes if no right one can tell."""
    try:
        right = _read_fields(find_mano("right", path.parent))
    except MissingAssetError:
        return True
    if right["shapedirs"].shape != left["shapedirs"].shape:
        return True
    gap = np.abs(right["shapedirs"][:, 0] - left["shapedirs"][:, 0]).max()
    return bool(gap < SAME_SHAPE)


def _model(side: Side, fields: dict[str, np.ndarray]) -> HandModel:
    """The fields as a model; joint limits are the embedded hand's, whose frame is the same."""
    limits = embedded_right() if side == "right" else embedded_right().mirrored()
    tensors = {
        name: torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32))
        for name, array in fields.items()
        if name not in ("f", "kintree_table")
    }
    mean = limits.pose_mean
    if "hands_mean" in tensors:
        mean = torch.cat([torch.zeros(1, 3), tensors["hands_mean"].reshape(15, 3)])
    return HandModel(
        name="mano",
        side=side,
        template=tensors["v_template"],
        shape_dirs=tensors["shapedirs"][..., :BETAS].contiguous(),
        pose_dirs=tensors["posedirs"],
        joint_regressor=tensors["J_regressor"],
        skin_weights=tensors["weights"],
        faces=torch.from_numpy(fields["f"].astype(np.int64)),
        tip_verts=TIP_VERTS,
        pose_low=limits.pose_low,
        pose_high=limits.pose_high,
        pose_mean=mean,
        pose_std=limits.pose_std,
    )
