"""Physical realism: whether the contacts of an object can cause its motion.

A frame is realistic if its object rests on the table, or if hands touch it and contact forces in
their friction cones add up to the wrench that its motion requires against gravity. Text2HOI reports
a score of this name after ManipNet, but states no mass, friction, contact distance or solver, and
released no code for it. This is therefore our own definition, and its numbers must not be compared
with the paper's:

- the mass, whose size cancels, is spread evenly over the surface of all parts, so that the measured
  motion of the surface points alone gives force and torque;
- a hand touches where its skin is inside the object or at most 5 mm off it, with friction 0.8;
- the table, the plane z = 0, bears what stands on it, without friction while the object moves;
- the residual wrench is at most a tenth of the weight, with a penalty on large forces
  (`geneoh.geometry.forces.PRESSURE_COST`).

Points and skin are in the world frame, whose z axis points up, in metres.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.distance import pairwise_distances
from geneoh.geometry.forces import EDGES, friction_cones, wrench_left
from geneoh.metrics.contact import MOVING, TOUCH

GRAVITY = 9.81  # m/s²
FRICTION = 0.8
WRENCH_LEFT = 0.1  # largest residual wrench of a realistic frame, in units of the weight
NEAR_HAND = 0.02  # distance from a keypoint to the object of a hand near it, metres (paper)
SPAN = 2  # step in frames of second differences: a step of one frame shows mostly noise
SPREAD = 32  # most contact points of a frame, chosen far apart, through which forces act
SOLVER_STEPS = 200  # iterations of the solver for the forces


@dataclass(frozen=True)
class SurfacePoints(Bundle):
    """Surface points of B objects over T frames in the world."""

    points: Float[Tensor, "B T P 3"]
    normals: Float[Tensor, "B T P 3"]  # outward
    length: Int[Tensor, " B"]  # number of frames that count

    @property
    def valid(self) -> Bool[Tensor, "B T"]:
        """Frames that count."""
        frames = torch.arange(self.points.shape[1], device=self.length.device)
        return frames < self.length[:, None]

    @property
    def moves(self) -> Bool[Tensor, "B T"]:
        """Whether any point moves at least 0.3 mm to the next frame; false in the last one."""
        step = self.points.diff(dim=1).norm(dim=-1).amax(-1)
        last = torch.zeros_like(self.valid[:, :1])
        return torch.cat([(step >= MOVING) & self.valid[:, 1:], last], 1)


def moved_alone(joints: Float[Tensor, "B T K 3"], surface: SurfacePoints) -> Float[Tensor, " B"]:
    """Motion without contact: the share of the frames in which an object moves that have no
    keypoint within 2 cm of its points, 0 to 1.

    NaN for an object that never moves. `joints` are the keypoints of both hands, NaN for an absent
    hand.
    """
    shares = []
    for clip, moves in enumerate(surface.moves):
        apart = pairwise_distances(joints[clip, moves], surface.points[clip, moves])
        shares.append((~(apart <= NEAR_HAND).flatten(1).any(1)).to(joints).mean())
    return torch.stack(shares)


def realistic_frames(
    touched: Bool[Tensor, "B T P"], surface: SurfacePoints, fps: float, friction: float = FRICTION
) -> Bool[Tensor, "B T"]:
    """Whether each frame is realistic, by the points that hands touch; see the module."""
    stands = surface.points[..., 2] <= TOUCH
    still = ~(surface.moves | surface.moves.roll(1, 1))  # `moves` is false in the last frame
    passed = still & stands.any(-1) & surface.valid
    unsure = ~passed & surface.valid & touched.any(-1)
    if not bool(unsure.any()):
        return passed
    wanted, centre, size = wanted_wrench(surface, fps)
    arms = (surface.points - centre[:, :, None])[unsure]
    down = arms.new_tensor([0.0, 0.0, -1.0]).expand_as(arms)
    hands = _cones(arms, surface.normals[unsure], touched[unsure], friction)
    spanned = torch.cat([hands, _cones(arms, down, stands[unsure], 0.0)], 1)
    # torques divided by the radius of gyration count like forces
    scale = torch.cat([torch.ones_like(arms[:, :1]), size[unsure][:, None].expand(-1, 1, 3)], -1)
    left = wrench_left(spanned / scale, wanted[unsure][:, None] / scale, steps=SOLVER_STEPS)
    passed[unsure] = left[:, 0].norm(dim=-1) <= WRENCH_LEFT
    return passed


def wanted_wrench(
    surface: SurfacePoints, fps: float
) -> tuple[Float[Tensor, "B T 6"], Float[Tensor, "B T 3"], Float[Tensor, "B T 1"]]:
    """The required wrench per unit of weight about the centre of mass, that centre, and the radius
    of gyration, metres.

    Each point has an equal share of the mass. Accelerations are second differences with a step of
    two frames, or of one in clips of three or four frames; the first and last frames of a clip take
    the nearest one. They are zero in shorter clips.
    """
    points, frames = surface.points, torch.arange(surface.points.shape[1])
    last = surface.length[:, None] - 1
    span = (last // 2).clamp(max=SPAN)
    middle = torch.minimum(frames.to(last).maximum(span), last - span)
    clip = torch.arange(len(points))[:, None]
    bend = points[clip, middle - span] - 2 * points[clip, middle] + points[clip, middle + span]
    pull = bend * ((fps / span.clamp(min=1)) ** 2 / GRAVITY)[..., None, None]
    centre = points.mean(2)
    arms = points - centre[:, :, None]
    force = pull.mean(2) + points.new_tensor([0.0, 0.0, 1.0])
    torque = torch.linalg.cross(arms, pull).mean(2)
    size = arms.square().sum(-1).mean(-1, keepdim=True).sqrt()
    return torch.cat([force, torque], -1), centre, size


def touched_points(
    distance: Float[Tensor, "*B V"], index: Int[Tensor, "*B V"], count: int
) -> Bool[Tensor, "*B P"]:
    """Which of `count` surface points the skin touches.

    A point is touched if it is the surface point of a vertex that is inside or at most 5 mm off.
    `distance` and `index` are from `geneoh.geometry.oriented_points.signed_to_points`.
    """
    hits = (distance <= TOUCH).to(index)
    return hits.new_zeros(*index.shape[:-1], count).scatter_add(-1, index, hits) > 0


def _cones(
    arms: Float[Tensor, "N P 3"],
    normals: Float[Tensor, "N P 3"],
    chosen: Bool[Tensor, "N P"],
    friction: float,
) -> Float[Tensor, "N K 6"]:
    """Wrenches that span the friction cones at up to `SPREAD` chosen points, padded with zeros."""
    at, there = spread_out(arms, chosen)
    row = torch.arange(len(arms), device=arms.device)[:, None]
    edges = EDGES if friction else 1
    cones = friction_cones(arms[row, at], normals[row, at], friction, edges=edges)
    return (cones * there[..., None, None]).flatten(1, 2)


def spread_out(
    points: Float[Tensor, "N P 3"], chosen: Bool[Tensor, "N P"]
) -> tuple[Int[Tensor, "N C"], Bool[Tensor, "N C"]]:
    """Indices of at most 32 chosen points by farthest point sampling, and a mask of valid ones."""
    count = min(SPREAD, int(chosen.sum(1).max()))
    far = torch.where(chosen, torch.inf, -1.0).to(points)
    at, row = [], torch.arange(len(points), device=points.device)
    for _ in range(count):
        at.append(far.argmax(1))
        apart = (points - points[row, at[-1]][:, None]).norm(dim=-1)
        far = torch.minimum(far, torch.where(chosen, apart, -1.0))
    index = torch.stack(at, 1) if at else row[:, None][:, :0]
    order = torch.arange(count, device=points.device)
    return index, order < chosen.sum(1, keepdim=True)
