"""How far from the truth: mean distance of keypoints and of vertices, per frame."""

from jaxtyping import Float
from torch import Tensor


def mpjpe(
    joints: Float[Tensor, "*B T 21 3"], truth: Float[Tensor, "*#B T 21 3"]
) -> Float[Tensor, "*B T"]:
    """Mean per-joint position error of each frame, metres, in the world frame without alignment.

    Frames that were not observed are NaN in, NaN out; `mean_over_frames` leaves them out.

    Source: GeneOH Diffusion, C.2 (mean per-joint position error).
    """
    return (joints - truth).norm(dim=-1).mean(-1)


def mpvpe(
    verts: Float[Tensor, "*B T V 3"], truth: Float[Tensor, "*#B T V 3"]
) -> Float[Tensor, "*B T"]:
    """Mean per-vertex position error of each frame, metres; both hands of one topology.

    Source: GeneOH Diffusion, C.2 (mean per-vertex position error).
    """
    return (verts - truth).norm(dim=-1).mean(-1)
