"""Training batches: random windows of synthetic interactions, corrupted and made canonical."""

from dataclasses import dataclass, fields
from typing import TypeVar

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.denoisers.base import POINTS, Observation
from geneoh.denoisers.motion import MotionDenoiser, ObservedMotion
from geneoh.diffusion.samplers import denoise_via_diffusion
from geneoh.diffusion.schedule import descending_sigmas
from geneoh.geometry.rotations import (
    axis_angle_to_matrix,
    interpolate_rotations,
)
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.parameters import HandParameters
from geneoh.representation.region import ContactRegion, contact_region
from geneoh.synthesis.motion import Interactions
from geneoh.training.augmentation import augmented
from geneoh.training.corruption import draw_corruption

WINDOW = 60
"""Frames of a window (paper: 60 at 30 frames a second)."""
MOTION_LEVEL, MOTION_STEPS = 650, 3
"""How a stage that follows MotionDiff sees its work in training: from the level of the default
preset, in fewer steps."""
FAST_SHARE = 0.25
"""Share of the batches that play at twice the speed."""


Bundle = TypeVar("Bundle")


def moved_to(bundle: Bundle, device: torch.device) -> Bundle:
    """A dataclass of tensors and such dataclasses on another device."""
    return type(bundle)(
        **{
            field.name: value.to(device) if isinstance(value, Tensor) else moved_to(value, device)
            for field in fields(bundle)
            for value in [getattr(bundle, field.name)]
        }
    )


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

    hand: HandParameters
    """The clean hand's parameters in the canonical frame of `region`."""
    motion: ObservedMotion
    """The noisy hand's parameters there, with what MotionDiff is shown besides."""

    def to(self, device: torch.device) -> "Batch":
        """The same batch on another device."""
        return moved_to(self, device)

    @property
    def clean_canon(self) -> Float[Tensor, "B T 21 3"]:
        """Clean keypoints in the canonical frame."""
        return self.region.to_canon(self.clean)


def filled(hand: HandParameters, keep: Bool[Tensor, "B T"]) -> HandParameters:
    """Frames that are not kept, interpolated between their kept neighbours, held at the ends."""
    frames = keep.shape[1]
    time = torch.arange(frames, device=keep.device).expand_as(keep)
    before = torch.where(keep, time, -1).cummax(1).values
    after = torch.where(keep, time, frames).flip(1).cummin(1).values.flip(1)
    before_or = torch.where(before < 0, after, before)
    after_or = torch.where(after >= frames, before, after)
    weight = (time - before_or) / (after_or - before_or).clamp(min=1)

    def between(values: Tensor) -> Tensor:
        flat = values.flatten(2)
        start, end = (flat.gather(1, at[..., None].expand_as(flat)) for at in (before_or, after_or))
        return torch.lerp(start, end, weight[..., None].to(flat)).view_as(values)

    batch = torch.arange(len(keep), device=keep.device)[:, None]
    turn = interpolate_rotations(
        hand.turn[batch, before_or], hand.turn[batch, after_or], weight.to(hand.wrist)
    )
    turn = torch.where(keep[..., None, None], hand.turn, turn)
    return HandParameters(between(hand.wrist), turn, between(hand.fingers), hand.offsets)


def draw_batch(
    data: Interactions,
    size: int,
    *,
    generator: torch.Generator,
    withheld: float = 0.2,
    before: MotionDenoiser | None = None,
) -> Batch:
    """A batch of `size` random windows.

    Four in five batches have full windows (whole clips where those are shorter), the others a
    random shorter length, so that short clips are nothing new.

    Args:
        data: the interactions to draw from.
        size: windows.
        generator: source of every random choice.
        withheld: share of items whose observation is hidden from the network, which makes it the
            paper's canonical denoiser as well.
        before: MotionDiff, for a stage that follows it: the noisy hand is what it leaves.
    """

    def integers(low: int, high: int, count: int) -> Tensor:
        return torch.randint(low, high, (count,), generator=generator)

    total, available = data.wrist.shape[:2]
    short = torch.rand((), generator=generator) < 0.2
    frames = min(available, int(integers(2, WINDOW, 1)) if short else WINDOW)
    pick = integers(0, total, size)
    fast = torch.rand((), generator=generator) < FAST_SHARE
    stride = 2 if fast and 2 * frames <= available else 1
    reach = stride * (frames - 1) + 1
    window = integers(0, available - reach + 1, size)[:, None] + stride * torch.arange(frames)
    at = pick[:, None]
    rotation, translation = data.rotation[at, window], data.translation[at, window]
    pose, wrist = data.pose[at, window], data.wrist[at, window]
    clean = HandParameters.of_pose(wrist, pose, data.offsets[pick])
    clean = augmented(clean, generator=generator)
    noise = draw_corruption(size, frames, generator=generator)
    noisy = HandParameters.of_pose(
        clean.wrist + noise.translation, clean.pose + noise.pose, clean.offsets
    )
    noisy = filled(noisy, noise.keep)
    points, normals = data.points[pick], data.normals[pick]
    turn = axis_angle_to_matrix(3.0 * torch.randn(size, 3, generator=generator))

    def around(joints: Tensor) -> ContactRegion:
        region = contact_region(
            joints,
            points,
            normals,
            data.part[pick],
            rotation,
            translation,
            count=POINTS,
            every=4,
        )
        return region.turned(turn)

    observed = noisy.joints
    joints = observed + noise.jitter
    region = around(joints)
    nearest, outward = nearest_on_parts(
        observed, points, normals, data.part[pick], rotation, translation
    )
    motion = ObservedMotion(
        noisy.to_canon(region),
        noise.keep.float(),
        region.to_canon(nearest),
        outward @ region.rotation,
        region.rotation,
        region.center,
    )
    if before is not None:
        joints = region.to_world(after_motion(motion, before, generator=generator).joints)
        region = around(joints)
    given = (torch.rand(size, generator=generator) >= withheld).float()
    trust = noise.keep[..., None].expand(-1, -1, 21).float()
    observation = Observation(region.to_canon(joints), trust, given)
    return Batch(clean.joints, joints, region, observation, clean.to_canon(region), motion)


@torch.no_grad()
def after_motion(
    seen: ObservedMotion, model: MotionDenoiser, *, generator: torch.Generator
) -> HandParameters:
    """A quick sample of what MotionDiff leaves of the observed hand, canonical frame."""
    device = next(model.parameters()).device
    there = moved_to(seen, device)

    def clean(x: Tensor, sigma: float) -> Tensor:
        level = x.new_full((len(x),), sigma).to(device)
        return model(x.to(device), level, there).to(x)

    change = denoise_via_diffusion(
        clean,
        seen.hand.wrist.new_zeros(*seen.trust.shape, 51),
        descending_sigmas(MOTION_LEVEL, MOTION_STEPS),
        sampler="ddim",
        samples=1,
        generator=generator,
    )
    return seen.hand.moved(change)
