"""A hand track as a layer of the `smplx` package, for body models, renderers and optimisers. Only
this module imports smplx, whose licence is non-commercial, and only when a layer is made."""

import logging
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.arguments import checked_call
from geneoh.choices import HandSource, Side
from geneoh.errors import InputError
from geneoh.fitting.subject import subject_of
from geneoh.hand.library import hand_of_betas
from geneoh.hand.mano import mano_folder, translation_from_wrist
from geneoh.hand.model import HandModel
from geneoh.hand.skeleton import PARENTS
from geneoh.readers.npz.hands import with_keypoints
from geneoh.sequence.gaps import fill_gaps
from geneoh.sequence.sequence import Sequence
from geneoh.sequence.validation import check_seen

LOG = logging.getLogger(__name__)


@checked_call
def to_smplx(
    side: Side,
    sequence: Sequence,
    *,
    hand: HandSource = "embedded",
    mano_dir: Path | str | None = None,
) -> nn.Module:
    """One hand of a sequence as an `smplx.MANO` module with its pose, all frames as one batch.

        layer = geneoh.to_smplx("left", result.sequence)
        vertices = layer().vertices  # (T, 778, 3), metres, in the frame of the sequence

    The pose is in the module's own parameters, one row per frame: `betas` (T, 10), `global_orient`
    (T, 3), `hand_pose` (T, 45) in radians, and `transl` (T, 3) in metres, which places MANO's
    origin and not the wrist. `dict(layer.named_parameters())` are the keyword arguments for another
    layer of the same hand, made with `use_pca=False, flat_hand_mean=True`.

    Args:
        side: "left" or "right".
        sequence: holds a pose of that hand, as every result of `geneoh.denoise` does. Frames in
            which the hand was not observed are filled by interpolation.
        hand: the hand to pose: "embedded", or the user's "mano" (of its two left hands the one
            that the betas belong to). Betas of another hand are replaced by a shape that is fitted
            to the track's keypoints, or to those of the user's MANO; without any, the mean hand is
            used, which is logged as a warning.
        mano_dir: folder of the user's MANO files; without it GENEOH_MANO_DIR says where.

    Raises:
        InputError: the sequence has no such hand, or in no frame, or only its keypoints.
        MissingAssetError: a MANO hand is requested and there is no MANO file.
    """
    if not isinstance(sequence, Sequence):
        raise InputError(
            f"geneoh.to_smplx takes a side, then a Sequence, got {type(sequence).__name__}; "
            "a result has one in .sequence"
        )
    track, name = sequence.hand(side), sequence.source or "the sequence"
    check_seen(track, name)
    track = with_keypoints(fill_gaps(track), mano_folder(mano_dir))
    if track.pose is None or track.wrist is None:
        raise InputError(
            f"{name}: smplx needs the {side} hand's 'pose' and 'wrist', got its keypoints only; "
            "run geneoh.denoise on it, which finds the pose"
        )
    model = hand_of_betas(side, track.hand_model, asked=hand, mano_dir=mano_dir)
    model = model.to(track.pose.device)
    subject = subject_of(track, model)
    if track.joints is None:
        for words in subject.notes:
            LOG.warning("%s: %s", name, words)
    betas = subject.betas
    pose = {
        "betas": betas.expand(track.frames, -1),
        "global_orient": track.pose[:, 0],
        "hand_pose": track.pose[:, 1:].flatten(1),
        "transl": translation_from_wrist(model, betas, track.wrist),
    }
    return layer_of(model, pose).to(track.pose.device)


def layer_of(model: HandModel, pose: dict[str, Float[Tensor, "T _"]]) -> nn.Module:
    """The module of smplx for a hand model, its parameters set to a pose of T frames."""
    from smplx import MANO
    from smplx.utils import Struct

    class Quiet(MANO):
        """Prints no warning about ten betas, which every MANO hand has."""

        SHAPE_SPACE_DIM = 10

    fields = {
        "v_template": model.template,
        "shapedirs": model.shape_dirs,
        "posedirs": model.pose_dirs,
        "J_regressor": model.joint_regressor,
        "weights": model.skin_weights,
        "f": model.faces,
        "hands_mean": model.pose_mean[1:].flatten(),
    }
    arrays = {name: tensor.detach().cpu().numpy() for name, tensor in fields.items()}
    arrays["kintree_table"] = np.stack([PARENTS, np.arange(len(PARENTS))])
    arrays["hands_components"] = np.eye(45)  # required by smplx, but unused without PCA
    parameters: dict[str, Any] = {
        name: tensor.detach().cpu().numpy() for name, tensor in pose.items()
    }
    layer = Quiet(
        "",
        data_struct=Struct(**arrays),
        is_rhand=model.side == "right",
        use_pca=False,
        flat_hand_mean=True,
        create_body_pose=False,
        batch_size=len(pose["transl"]),
        **parameters,
    )
    object.__setattr__(layer, "__class__", MANO)
    return layer
