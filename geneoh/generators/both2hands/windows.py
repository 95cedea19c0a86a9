"""Clips of any length cut into overlapping windows, and features of windows joined again."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

FRAMES = 150  # frames of a window at 30 frames a second: 5 s, as in the paper
OVERLAP = 75
"""Frames that neighbouring windows share at least. With 30, hands of a long clip changed their
gesture more often, and more overlap than this hardly helps."""


@dataclass(frozen=True)
class ClipWindows:
    """The windows of a clip of one window's length or more."""

    frames: int  # of the clip
    starts: tuple[int, ...]

    @staticmethod
    def of(frames: int) -> "ClipWindows":
        """As few windows as cover a clip, evenly spread."""
        last = frames - FRAMES
        steps = -(-last // (FRAMES - OVERLAP))
        return ClipWindows(frames, tuple(round(last * i / max(1, steps)) for i in range(steps + 1)))

    def cut(self, clips: Float[Tensor, "B T *N"]) -> Float[Tensor, "W F *N"]:
        """All windows of all clips; those with the same start are adjacent."""
        return torch.cat([clips[:, start : start + FRAMES] for start in self.starts])

    def repeat(self, items: Tensor) -> Tensor:
        """Repeat an item per clip for each of the clip's windows."""
        return items.repeat(len(self.starts), *(1,) * (items.ndim - 1))

    def join(self, windows: Float[Tensor, "W F N"]) -> Float[Tensor, "B T N"]:
        """Windows blended into clips, each with most weight in its middle."""
        edge = torch.arange(1, FRAMES + 1, device=windows.device)
        weight = torch.minimum(edge, edge.flip(0)).to(windows)[:, None]
        parts = windows.unflatten(0, (len(self.starts), -1))
        total = windows.new_zeros(parts.shape[1], self.frames, windows.shape[-1])
        share = windows.new_zeros(self.frames, 1)
        for start, part in zip(self.starts, parts, strict=True):
            total[:, start : start + FRAMES] += weight * part
            share[start : start + FRAMES] += weight
        return total / share
