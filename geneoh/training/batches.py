"""Training batches: random windows of synthetic interactions, corrupted and made canonical."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.denoisers.base import POINTS, Observation
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.representation.region import ContactRegion, contact_region
from geneoh.synthesis.motion import Interactions
from geneoh.training.corruption import draw_corruption

WINDOW = 60
"""Frames of a window (paper: 60 at 30 frames a second)."""


@dataclass(frozen=True)
class Batch:
    """Clean and noisy hands of one window length around the noisy hand's contact points."""

    clean: Float[Tensor, "B T 21 3"]
    """World frame, metres."""
    noisy: Float[Tensor, "B T 21 3"]
    """World frame, gaps filled linearly."""
    region: ContactRegion
    observation: Observation
    """The noisy hand in the canonical frame of `region`."""

    def to(self, device: torch.device) -> "Batch":
        """The same batch on another device."""
        seen, region = self.observation, self.region
        return Batch(
            self.clean.to(device),
            self.noisy.to(device),
            ContactRegion(
                region.points.to(device),
                region.normals.to(device),
                region.rotation.to(device),
                region.center.to(device),
            ),
            Observation(seen.joints.to(device), seen.trust.to(device), seen.given.to(device)),
        )

    @property
    def clean_canon(self) -> Float[Tensor, "B T 21 3"]:
        """Clean keypoints in the canonical frame."""
        return self.region.to_canon(self.clean)


def filled(values: Float[Tensor, "B T D"], keep: Bool[Tensor, "B T"]) -> Float[Tensor, "B T D"]:
    """Frames that are not kept, interpolated linearly between their kept neighbours."""
    frames = keep.shape[1]
    time = torch.arange(frames, device=keep.device).expand_as(keep)
    before = torch.where(keep, time, -1).cummax(1).values
    after = torch.where(keep, time, frames).flip(1).cummin(1).values.flip(1)
    before_or = torch.where(before < 0, after, before)
    after_or = torch.where(after >= frames, before, after)
    weight = (time - before_or) / (after_or - before_or).clamp(min=1)

    def at(index: Tensor) -> Tensor:
        return values.gather(1, index[..., None].expand_as(values))

    return torch.lerp(at(before_or), at(after_or), weight[..., None].to(values))


def draw_batch(
    data: Interactions,
    size: int,
    *,
    generator: torch.Generator,
    whiteness: float = 1.0,
    withheld: float = 0.2,
) -> Batch:
    """A batch of `size` random windows.

    Four in five batches have full windows (whole clips where those are shorter), the others a
    random shorter length, so that short clips are nothing new. `withheld` is the share of items
    whose observation is hidden from the network, which makes it the paper's canonical denoiser as
    well.
    """

    def integers(low: int, high: int, count: int) -> Tensor:
        return torch.randint(low, high, (count,), generator=generator)

    total, available = data.wrist.shape[:2]
    short = torch.rand((), generator=generator) < 0.2
    frames = min(available, int(integers(2, WINDOW, 1)) if short else WINDOW)
    pick = integers(0, total, size)
    window = integers(0, available - frames + 1, size)[:, None] + torch.arange(frames)
    at = pick[:, None]
    pose, wrist, offsets = data.pose[at, window], data.wrist[at, window], data.offsets[at]
    noise = draw_corruption(size, frames, generator=generator, whiteness=whiteness)
    clean, _ = forward_kinematics(axis_angle_to_matrix(pose), wrist, offsets)
    turned = axis_angle_to_matrix(pose + noise.pose)
    noisy, _ = forward_kinematics(turned, wrist + noise.translation, offsets)
    noisy = filled((noisy + noise.jitter).flatten(2), noise.keep).unflatten(-1, (21, 3))
    region = contact_region(
        noisy,
        data.points[pick],
        data.normals[pick],
        torch.zeros(size, data.points.shape[1], dtype=torch.long),
        data.rotation[at, window][:, :, None],
        data.translation[at, window][:, :, None],
        count=POINTS,
        every=4,
    )
    turn = axis_angle_to_matrix(3.0 * torch.randn(size, 3, generator=generator))
    region = region.turned(turn)
    given = (torch.rand(size, generator=generator) >= withheld).float()
    trust = noise.keep[..., None].expand(-1, -1, 21).float()
    observation = Observation(region.to_canon(noisy), trust, given)
    return Batch(clean, noisy, region, observation)
