"""Gaussian smoothing of generated clips over time, which removes jitter."""

import torch
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d
from torch import Tensor


def smoothed_clips(
    clips: Float[Tensor, "B T N"], deviation: float, lengths: Int[Tensor, " B"] | None = None
) -> Float[Tensor, "B T N"]:
    """Each feature smoothed over time; `deviation` is the Gaussian's, in frames, 0 for none.

    A clip is padded with its first and last frame; frames after its length repeat the last one.
    """
    if not deviation:
        return clips
    if lengths is not None:
        frames = torch.arange(clips.shape[1], device=clips.device)
        frames = frames.minimum(lengths[:, None] - 1)
        clips = clips[torch.arange(len(clips), device=clips.device)[:, None], frames]
    smooth = gaussian_filter1d(clips.cpu().numpy(), deviation, axis=1, mode="nearest")
    return torch.from_numpy(smooth).to(clips)
