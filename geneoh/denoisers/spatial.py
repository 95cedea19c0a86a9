"""SpatialDiff: posterior of a constant shift of the hand (paper 3.2; our form of it).

A tracker can be off by centimetres along the camera ray for a whole clip, and a hand beside an
object looks natural in itself. So the hand is placed at many trial shifts, like noisy samples, and
the network predicts the log density of each from the hand's relations to the surface. Mean and
covariance of this density are the denoised position and its uncertainty
(`geneoh.diffusion.posterior`). The paper's form is `geneoh.denoisers.relations`.
"""

import math
from dataclasses import dataclass, fields

import torch
from jaxtyping import Float
from torch import Tensor, nn

from geneoh.denoisers.base import CLOSE
from geneoh.diffusion.posterior import LogDensity, Posterior, importance_posterior
from geneoh.geometry.rotations import matrix_to_axis_angle
from geneoh.nn.blocks import NetworkConfig, mlp, zeroed
from geneoh.nn.checkpoint import finite_output
from geneoh.progress import OnStep
from geneoh.representation.nearest_surface import nearest_on_parts
from geneoh.representation.parameters import UNIT, HandParameters
from geneoh.representation.region import ObjectSurface
from geneoh.sequence.keypoints import palm_axes

SHIFT_UNIT = 0.02  # unit of shifts as network input, metres
LONGEST_SHIFT = 0.1  # longer shifts have zero density, metres: training has none
PRIOR_RANGE = (0.0005, 0.06)  # range of the prior's standard deviation, metres
SPEED_FRAMES = 2  # speeds are differences over this many frames before and after
SPEED_UNIT = 0.003  # unit of speeds as network input, metres per frame
HANDS_AT_ONCE = 10  # batch size over hands, which bounds the memory
LEAST_CUE = 0.01  # floor added to noise levels before the logarithm, in units of `UNIT`
TRACK_CUES = 12  # width of `SpatialEvidence.track`
FRAME_FEATURES = 21 * 8 + 63 + 5 + 3  # width of the features of one trial shift in one frame


@dataclass(frozen=True)
class SpatialConfig(NetworkConfig):
    """Size of the network and number of its input frames."""

    width: int = 192
    frames: int = 10  # evenly spaced input frames of a window


@dataclass(frozen=True)
class SpatialEvidence(ObjectSurface):
    """Evidence for the position of B hands over T frames, world frame, metres."""

    joints: Float[Tensor, "B T 21 3"]  # the hand after MotionDiff
    speeds: Float[Tensor, "B T 5"]  # `relative_speeds`: a moving object is probably held
    ray: Float[Tensor, "B 3"]  # unit direction from the camera to the hand; zero if unknown
    track: Float[Tensor, "B 12"]  # `track_cues`, which determine the width of the prior

    @classmethod
    def around(
        cls,
        surface: ObjectSurface,
        joints: Float[Tensor, "B T 21 3"],
        ray: Float[Tensor, "B 3"],
        track: Float[Tensor, "B 12"],
    ) -> "SpatialEvidence":
        """The evidence of hands near an object; speeds are relative to its first part."""
        moving = {f.name: getattr(surface, f.name) for f in fields(ObjectSurface)}
        speeds = relative_speeds(joints, surface.rotation[:, :, 0], surface.translation[:, :, 0])
        return cls(**moving, joints=joints, speeds=speeds, ray=ray, track=track)

    @property
    def knows_ray(self) -> Float[Tensor, " B"]:
        """1 where the camera ray is known, else 0."""
        return (self.ray.square().sum(-1) > 0.25).to(self.ray)

    def axes(self) -> Float[Tensor, "B T 3 3"]:
        """Axes of the palm in each frame as columns: the frame of the network's input."""
        return palm_axes(self.joints.flatten(0, 1)[:, None]).unflatten(0, self.joints.shape[:2])

    def spread_over(self, frames: int, *, phase: float = 0.5) -> "SpatialEvidence":
        """At most `frames` evenly spaced frames; `phase`, 0 to 1, is the offset of the first in
        units of their spacing."""
        total = self.joints.shape[1]
        count = min(frames, total)
        return self[((torch.arange(count) + phase) * total / count).long().clamp(max=total - 1)]


def relative_speeds(
    joints: Float[Tensor, "B T 21 3"],
    rotation: Float[Tensor, "B T 3 3"],
    translation: Float[Tensor, "B T 3"],
) -> Float[Tensor, "B T 5"]:
    """log(1 + speed) of five speeds, in units of 3 mm or 0.03 rad per frame.

    They are: the object at the hand's centre, the object's rotation, the hand's centre relative to
    the object, the hand's centre in the world, and the keypoints relative to the hand's centre."""
    frames = joints.shape[1]
    time = torch.arange(frames, device=joints.device)
    before = (time - SPEED_FRAMES).clamp(min=0)
    after = (time + SPEED_FRAMES).clamp(max=frames - 1)
    length = (after - before).clamp(min=1).to(joints)[:, None]
    middle = joints.mean(2)

    def seen_from(place: Tensor, frame: Tensor) -> Tensor:
        """World points in the object frame at the frame indices `frame`."""
        turned = (place - translation[:, frame])[..., None, :] @ rotation[:, frame]
        return turned[..., 0, :]

    held = (rotation[:, after] @ seen_from(middle, before)[..., None])[..., 0]
    carried = held + translation[:, after] - middle
    turn = matrix_to_axis_angle(rotation[:, before].mT @ rotation[:, after])
    over = seen_from(middle[:, after], after) - seen_from(middle[:, before], before)
    around = (joints - middle[:, :, None])[:, after] - (joints - middle[:, :, None])[:, before]
    speeds = [
        carried.norm(dim=-1, keepdim=True) / SPEED_UNIT,
        turn.norm(dim=-1, keepdim=True) / 0.03,
        over.norm(dim=-1, keepdim=True) / SPEED_UNIT,
        (middle[:, after] - middle[:, before]).norm(dim=-1, keepdim=True) / SPEED_UNIT,
        around.norm(dim=-1).mean(-1, keepdim=True) / SPEED_UNIT,
    ]
    return torch.log1p(torch.cat(speeds, dim=-1) / length)


def track_cues(
    observed: HandParameters,
    change: Float[Tensor, "B T 51"],
    trust: Float[Tensor, "B T"],
    object_noise: Float[Tensor, "B 2"],
) -> Float[Tensor, "B 12"]:
    """Noise levels of the input, from which the size of a constant error is predicted.

    They are logarithms of the constant and the varying part of the `change` that MotionDiff made
    (units of `UNIT`), of the jitter of the observed hand, and of the white noise on the object's
    rotation (rad) and translation (m); then the share of frames with positive trust.
    """
    constant, varying = change.mean(1), change - change.mean(1, keepdim=True)
    parts = [slice(0, 3), slice(3, 6), slice(6, 51)]
    turn = observed.turn.flatten(2)
    values = torch.cat(
        [
            *(constant[:, part].square().mean(-1, keepdim=True).sqrt() for part in parts),
            *(varying[..., part].square().mean((1, 2))[:, None].sqrt() for part in parts),
            _jitter(observed.wrist) / UNIT[0],
            _jitter(turn) / UNIT[3],
            _jitter(observed.fingers.flatten(2)) / UNIT[6],
            object_noise / torch.tensor([UNIT[3], UNIT[0]]).to(object_noise),
        ],
        dim=-1,
    )
    seen = (trust > 0).to(values).mean(1, keepdim=True)
    return torch.cat([(values + LEAST_CUE).log(), seen], dim=-1)


def object_noise_of(track: Float[Tensor, "B 12"]) -> Float[Tensor, "B 2"]:
    """White noise of the object's rotation (rad) and translation (m), recovered from the cues."""
    return _values_of(track[:, 9:11]) * torch.tensor([UNIT[3], UNIT[0]]).to(track)


def wrist_noise_of(track: Float[Tensor, "B 12"]) -> Float[Tensor, "B 1"]:
    """Standard deviation per axis of the change that MotionDiff made to the wrist, metres."""
    return _values_of(track[:, 3:4]) * UNIT[0]


def _values_of(cues: Float[Tensor, "B D"]) -> Float[Tensor, "B D"]:
    """Inverse of the logarithm in `track_cues`."""
    return (cues.exp() - LEAST_CUE).clamp(min=0)


def _jitter(values: Float[Tensor, "B T D"]) -> Float[Tensor, "B 1"]:
    """Root mean square of second differences over time; zero for fewer than three frames."""
    if values.shape[1] < 3:
        return torch.zeros_like(values[:, 0, :1])
    return values.diff(n=2, dim=1).square().mean((1, 2))[:, None].sqrt()


class SpatialDenoiser(nn.Module):
    """Unnormalised log density of a constant shift of the hand: prior plus learned likelihood."""

    def __init__(self, config: SpatialConfig) -> None:
        """Build the network; its last layers start at zero, which leaves the prior alone."""
        super().__init__()
        self.config = config
        width = config.width
        self.look = mlp(FRAME_FEATURES, width, width, width)
        self.judge = mlp(2 * width + 5 + TRACK_CUES, width, width, 1)
        zeroed(self.judge[-1])
        self.width = mlp(TRACK_CUES + 1, 64, 2)
        zeroed(self.width[-1])
        nn.init.constant_(self.width[-1].get_parameter("bias"), math.log(0.015))

    def prior(self, evidence: SpatialEvidence) -> Float[Tensor, "B 2"]:
        """Prior standard deviations of the shift along and across the camera ray, metres; both are
        equal if the ray is unknown."""
        known = evidence.knows_ray[:, None]
        low, high = (math.log(limit) for limit in PRIOR_RANGE)
        both = self.width(torch.cat([evidence.track, known], dim=-1)).clamp(low, high).exp()
        along, across = both.split(1, dim=-1)
        return torch.cat([torch.where(known > 0, along, across), across], dim=-1)

    def prior_root(
        self, evidence: SpatialEvidence, axes: Float[Tensor, "3 3"]
    ) -> Float[Tensor, "B 3 3"]:
        """Symmetric square root of the prior's covariance, metres, in `axes` (as columns)."""
        along, across = self.prior(evidence)[..., None, None].unbind(1)
        ray = evidence.ray @ axes
        return across * torch.eye(3).to(ray) + (along - across) * ray[:, :, None] * ray[:, None]

    def forward(
        self, shifts: Float[Tensor, "B M 3"], evidence: SpatialEvidence
    ) -> Float[Tensor, "B M"]:
        """Unnormalised log density at M shifts of the whole hand, world axes, metres."""
        seen = self.look(frame_features(shifts, evidence))
        pooled = torch.cat([seen.mean(1), seen.amax(1)], dim=-1)
        along = (shifts * evidence.ray[:, None]).sum(-1, keepdim=True)
        size = shifts.norm(dim=-1, keepdim=True)
        across = (size.square() - along.square()).clamp(min=0).sqrt()
        known = evidence.knows_ray[:, None, None].expand_as(size)
        where = torch.cat([along, along.abs(), across, size], dim=-1) / SHIFT_UNIT
        track = evidence.track[:, None].expand(-1, shifts.shape[1], -1)
        likely = self.judge(torch.cat([pooled, where, known, track], dim=-1))[..., 0]
        away = torch.cat([along, across], dim=-1) / self.prior(evidence)[:, None]
        return likely - 0.5 * away.square().sum(-1)

    def posterior(
        self,
        evidence: SpatialEvidence,
        axes: Float[Tensor, "3 3"],
        *,
        rounds: int,
        places: int,
        generator: torch.Generator,
        besides: LogDensity | None = None,
        on_step: OnStep | None = None,
    ) -> Posterior:
        """Mean and covariance of the density of the shift, metres; see `importance_posterior`.

        They are in `axes` (columns), which must rotate with the scene to make the result
        equivariant. `besides` is an additional log density of shifts in the world frame.
        """
        seen = evidence.spread_over(self.config.frames)

        def within_reach(shifts: Tensor) -> Tensor:
            world = shifts @ axes.mT
            groups = [slice(at, at + HANDS_AT_ONCE) for at in range(0, len(world), HANDS_AT_ONCE)]
            density = torch.cat([self(world[own], seen.take(own, "B")) for own in groups])
            density = finite_output(density)
            if besides is not None:
                density = density + besides(world)
            return density.masked_fill(shifts.norm(dim=-1) > LONGEST_SHIFT, -torch.inf)

        return importance_posterior(
            within_reach,
            finite_output(self.prior_root(seen, axes)),
            rounds=rounds,
            places=places,
            generator=generator,
            on_step=on_step,
        )


def frame_features(
    shifts: Float[Tensor, "B M 3"], evidence: SpatialEvidence
) -> Float[Tensor, "B T M F"]:
    """Relations of the shifted hand to the surface at M trial shifts, in the axes of the palm."""
    joints, axes = evidence.joints, evidence.axes()
    count = shifts.shape[1]
    placed = joints[:, :, None] + shifts[:, None, :, None]  # (B, T, M, 21, 3)
    near = nearest_on_parts(placed.flatten(2, 3), evidence)
    nearest, outward = (found.unflatten(2, (count, 21)) for found in (near.points, near.normals))
    way = nearest - placed
    close = torch.exp(-way.norm(dim=-1, keepdim=True) / CLOSE)
    height = -(way * outward).sum(-1, keepdim=True)

    def in_palm(vectors: Tensor) -> Tensor:
        return (vectors.flatten(2, 3) @ axes).unflatten(2, (count, 21))

    contact = [
        (height * close / 0.01).clamp(-4, 4),
        close,
        in_palm(way) * close / 0.01,
        in_palm(outward) * close,
    ]
    hand = ((joints - joints[:, :, :1]) @ axes / 0.06).flatten(2)
    around = torch.cat([hand, evidence.speeds], dim=-1)[:, :, None].expand(-1, -1, count, -1)
    place = shifts[:, None] @ axes / SHIFT_UNIT
    return torch.cat([torch.cat(contact, dim=-1).flatten(3), around, place], dim=-1)
