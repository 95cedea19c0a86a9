"""From grasps to interactions at 30 frames a second: reach, close, carry, adjust, let go, leave."""

import math
from dataclasses import dataclass, fields

import torch
from jaxtyping import Float, Int
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.synthesis.grasps import Grasps, curled
from geneoh.synthesis.objects import Solids

SHORTEST_MOVE = 12.0
"""Frames that the object takes from one rest point to the next, at least."""
KEYFRAMES = 5
"""Rest points of the object's path; some coincide, so the object also stands still while held."""


@dataclass(frozen=True)
class Interactions:
    """B right-hand interactions of T frames in the world frame, with their skeletons."""

    pose: Float[Tensor, "B T 16 3"]
    wrist: Float[Tensor, "B T 3"]
    offsets: Float[Tensor, "B 20 3"]
    rotation: Float[Tensor, "B T 3 3"]
    translation: Float[Tensor, "B T 3"]
    points: Float[Tensor, "B P 3"]
    """Object surface points in the object's frame, with `normals`."""
    normals: Float[Tensor, "B P 3"]

    def chosen(self, which: Int[Tensor, " C"]) -> "Interactions":
        """Some of the interactions."""
        return Interactions(*(getattr(self, field.name)[which] for field in fields(self)))


def _ease(x: Float[Tensor, "*S"]) -> Float[Tensor, "*S"]:
    """Minimum-jerk profile from 0 to 1, clamped outside."""
    x = x.clamp(0, 1)
    return x**3 * (10 - 15 * x + 6 * x**2)


def wander(
    batch: int, frames: int, channels: int, period: float, *, generator: torch.Generator
) -> Float[Tensor, "B T C"]:
    """Smooth unit-variance noise that changes over about `period` frames."""
    time = torch.arange(-3 * int(period), 3 * int(period) + 1, dtype=torch.float32)
    kernel = torch.exp(-0.5 * (time / period) ** 2)
    kernel = kernel / kernel.square().sum().sqrt()
    white = torch.randn(batch * channels, 1, frames + len(kernel) - 1, generator=generator)
    smooth = torch.nn.functional.conv1d(white, kernel[None, None])
    return smooth.reshape(batch, channels, frames).transpose(1, 2)


def _object_path(
    lift: Float[Tensor, " B"],
    release: Float[Tensor, " B"],
    frames: int,
    *,
    generator: torch.Generator,
) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
    """Object poses: at rest before `lift` and after `release`, smooth moves between rests."""
    batch = len(lift)
    moves = torch.rand(batch, KEYFRAMES, 1, generator=generator) < 0.75
    moves = moves & (torch.rand(batch, 1, 1, generator=generator) < 0.85)
    reach = torch.tensor([0.25, 0.25, 0.18])
    shift = (torch.randn(batch, KEYFRAMES, 3, generator=generator) * reach * moves).cumsum(1) * 0.7
    turn = (torch.randn(batch, KEYFRAMES, 3, generator=generator) * 0.8 * moves).cumsum(1) * 0.7
    cuts = torch.rand(batch, KEYFRAMES - 1, generator=generator).sort(1).values
    cuts = torch.cat([torch.zeros(batch, 1), cuts, torch.ones(batch, 1)], 1)
    # the last move ends with the release, where the hold is long enough for one at all
    latest = (release - lift - SHORTEST_MOVE).clamp(min=0)[:, None]
    starts = lift[:, None] + torch.minimum(cuts * (release - lift).clamp(min=0)[:, None], latest)
    time = torch.arange(frames, dtype=torch.float32)
    progress = (time[None, :, None] - starts[:, None, :-1]) / (
        (starts[:, 1:] - starts[:, :-1])[:, None].clamp(min=SHORTEST_MOVE)
    )
    step = _ease(progress)
    previous = torch.zeros(batch, 1, 3)
    moved = step @ torch.diff(torch.cat([previous, shift], 1), dim=1)
    turned = step @ torch.diff(torch.cat([previous, turn], 1), dim=1)
    upright = axis_angle_to_matrix(2.0 * torch.randn(batch, 1, 3, generator=generator))
    return axis_angle_to_matrix(turned) @ upright, moved


def animate(
    grasps: Grasps, solids: Solids, frames: int, points: int, *, generator: torch.Generator
) -> Interactions:
    """One interaction of `frames` frames per grasp.

    The hand follows the grasp in the object's frame while it holds, and comes from and leaves to a
    random place in front of it with its fingers open; small smooth adjustments and single lifted
    fingers keep the hold alive.
    """
    batch = len(grasps.pose)

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(batch, *shape, generator=generator)

    time = torch.arange(frames, dtype=torch.float32)[None]
    close = uniform(-0.25, 0.55) * frames  # negative: the clip starts in the middle of the hold
    hold = uniform(0.4, 1.1) * frames
    release = close + hold
    rotation, translation = _object_path(close + 4, release - 4, frames, generator=generator)

    def away(at: Tensor, before: float) -> tuple[Tensor, Tensor]:
        """How far from the hold (0 to 1): the wrist's way and the fingers' opening."""
        way = before * (at[:, None] - time) / uniform(18.0, 40.0, 1)
        opening = before * (at[:, None] - time) / uniform(8.0, 16.0, 1)
        return _ease(way - 0.1), _ease(opening + 0.3)

    wrist_in, open_in = away(close, 1.0)
    wrist_out, open_out = away(release, -1.0)

    rotation_grasp = axis_angle_to_matrix(grasps.pose[:, 0])
    back = rotation_grasp @ torch.tensor([0.6, 1.0, 0.0])  # up off the palm and towards the forearm

    def place() -> Tensor:
        return back * uniform(0.06, 0.2, 1) + 0.05 * torch.randn(batch, 3, generator=generator)

    path = wrist_in[..., None] * place()[:, None] + wrist_out[..., None] * place()[:, None]
    slide = 0.001 * wander(batch, frames, 3, 12.0, generator=generator)
    wrist_object = grasps.wrist[:, None] + path + slide
    turn = wrist_in[..., None] * 0.4 * torch.randn(batch, 1, 3, generator=generator)
    turn = turn + wrist_out[..., None] * 0.4 * torch.randn(batch, 1, 3, generator=generator)
    orient_object = rotation_grasp[:, None] @ axis_angle_to_matrix(
        turn + 0.01 * wander(batch, frames, 3, 15.0, generator=generator)
    )

    # people reach with their fingers more or less open, no two fingers alike
    scatter = (0.3 * torch.randn(batch, 5, generator=generator)).exp()
    flat = curled(uniform(0.05, 0.9, 1) * scatter)[:, None]
    # but never more bent than in the grasp: to open must not press a finger into the object
    flat[:, :, :12, 2] = torch.minimum(flat[:, :, :12, 2], grasps.pose[:, None, 1:13, 2])
    openness = torch.maximum(open_in, open_out)[..., None, None] * uniform(0.5, 1.0, 1, 1, 1)
    fingers = grasps.pose[:, None, 1:]
    fingers = fingers + openness * (flat - fingers)
    lifted = (torch.rand(batch, 5, generator=generator) < 0.15).float()
    beat = uniform(0.2, 0.8, 1) * frames
    bump = torch.exp(-0.5 * ((time - beat) / 7.0) ** 2)
    # a tool in use: the same fingers open and close again and again
    period, works = uniform(12.0, 40.0, 1), torch.rand(batch, 1, generator=generator) < 0.2
    bump = torch.where(works, 0.5 - 0.5 * torch.cos(2 * math.pi * (time - beat) / period), bump)
    lift = bump[..., None] * lifted.repeat_interleave(3, dim=1)[:, None]
    fingers = fingers + (lift * uniform(0.2, 0.6, 1, 1))[..., None] * (flat - fingers)
    tremble = wander(batch, frames, 45, 8.0, generator=generator).reshape(batch, frames, 15, 3)
    fingers = fingers + tremble * (0.004 + 0.04 * openness)

    orient = matrix_to_axis_angle(rotation @ orient_object)
    surface, normals = solids.surface_points(points, generator=generator)
    return Interactions(
        pose=torch.cat([orient[:, :, None], fingers], dim=2),
        wrist=(rotation @ wrist_object[..., None])[..., 0] + translation,
        offsets=grasps.offsets,
        rotation=rotation,
        translation=translation,
        points=surface,
        normals=normals,
    )
