"""Runs, blocks and overlapping windows of a track; windows are blended without a seam."""

from collections.abc import Sequence

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

WINDOW, STRIDE = 60, 30
"""Frames: the paper's window of two seconds, and half of it, so that most frames are in two."""
BLOCK = 600
"""Frames per batch where frames are independent, so that memory does not grow with the track."""


def runs(chosen: Bool[np.ndarray, " T"]) -> list[slice]:
    """The maximal runs of consecutive chosen frames."""
    edges = np.flatnonzero(np.diff(np.pad(chosen, 1).astype(int)))
    return [slice(start, stop) for start, stop in edges.reshape(-1, 2).tolist()]


def in_long_runs(chosen: Bool[np.ndarray, " T"], longest: float) -> Bool[np.ndarray, " T"]:
    """The chosen frames in runs of more than `longest` consecutive ones."""
    found = np.zeros(len(chosen), dtype=bool)
    for run in runs(chosen):
        found[run] = run.stop - run.start > longest
    return found


def blocks(frames: int) -> list[slice]:
    """The frames of a track, `BLOCK` at a time."""
    return [slice(at, min(at + BLOCK, frames)) for at in range(0, frames, BLOCK)]


def widened(block: slice, by: int, frames: int) -> tuple[slice, slice]:
    """A block with `by` more frames on either side where they exist, and its slice within that."""
    wide = slice(max(block.start - by, 0), min(block.stop + by, frames))
    return wide, slice(block.start - wide.start, block.stop - wide.start)


def spread_frames(frames: int, most: int) -> list[int]:
    """At most `most` frames of a track, evenly spread: the middles of equal shares."""
    count = min(frames, most)
    return [int((share + 0.5) * frames / count) for share in range(count)]


def window_starts(frames: int, size: int = WINDOW, stride: int = STRIDE) -> list[int]:
    """First frame of each window: evenly apart, `stride` at most; the last ends with the track."""
    last = max(frames - size, 0)
    steps = max(-(-last // stride), 1)
    return sorted({step * last // steps for step in range(steps + 1)})


def unfold(
    x: Float[Tensor, "*B T D"], starts: Sequence[int], size: int
) -> Float[Tensor, "*B W S D"]:
    """Cut a track into windows; a track shorter than a window repeats its last frame."""
    frames = torch.arange(size, device=x.device) + torch.tensor(starts, device=x.device)[:, None]
    return x[..., frames.clamp(max=x.shape[-2] - 1), :]


def fold(
    x: Float[Tensor, "*B W S D"], starts: Sequence[int], frames: int
) -> Float[Tensor, "*B T D"]:
    """Blend windows into one track of `frames` frames; undoes `unfold`.

    Each frame is a mean over the windows that hold it, weighted by `blend_weights`: where two
    windows disagree, the track crosses from one to the other over all the frames they share.
    """
    weights = blend_weights(starts, x.shape[-2], frames).to(x)
    out = x.new_zeros(*x.shape[:-3], frames, x.shape[-1])
    for index, start in enumerate(starts):
        held = min(x.shape[-2], frames - start)
        weight = weights[index, :held, None]
        out[..., start : start + held, :] += weight * x[..., index, :held, :]
    return out


def blend_weights(starts: Sequence[int], size: int, frames: int) -> Float[Tensor, "W S"]:
    """Weight of each window's frames; over the windows that hold a frame they sum to one.

    A window rises along a raised cosine over what it shares with the window before, and falls over
    what it shares with the next; then all are divided by their sum at each frame. Zero where a
    window reaches beyond the track.
    """
    first = torch.tensor(starts)
    shared = size - first.diff()
    step = torch.arange(size, dtype=torch.float64) + 0.5
    rise = torch.ones(len(starts), size, dtype=torch.float64)
    rise[1:] = torch.sin(torch.pi / 2 * (step / shared[:, None]).clamp(max=1)) ** 2
    fall = torch.ones_like(rise)
    fall[:-1] = rise[1:].flip(-1)
    place = torch.arange(size) + first[:, None]
    weights = torch.where(place < frames, rise * fall, 0.0)
    place = place.clamp(max=frames - 1)
    total = torch.zeros(frames, dtype=torch.float64)
    total = total.index_add(0, place.flatten(), weights.flatten())
    return (weights / total[place]).float()
