"""Batched objects, as unions of simple solids or as scans: signed distance and surface points.

Every object is either a union of at most `SOLIDS` solids (box, cylinder, ellipsoid, torus), each
with a pose and a rounding radius, or a scanned object; one batch may mix them. Some objects have a
second part that turns about a hinge or slides.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.geometry.mirror import mirror_axes, mirror_points, mirror_rotations
from geneoh.geometry.rigid import joint_poses
from geneoh.synthesis.shapes.scans import Scans

SOLIDS = 4  # most solids of an object
PARTS = 2  # rigid parts of an object: the first, and one on a joint
BOX, CYLINDER, ELLIPSOID, TORUS, SCAN = range(5)  # kinds of solids; SCAN + n is scanned object n
SURFACE_ERROR = 1e-5  # a projected point that is farther from the surface did not converge, metres
FAR_AWAY = 10.0  # coordinate of the centres of unused solids, metres, not near anything


def distance_to_box(
    local: Float[Tensor, "N P 3"], size: Float[Tensor, "N 1 3"], rounding: Float[Tensor, "N 1"]
) -> Float[Tensor, "N P"]:
    """Signed distance of points in the frames of boxes with round edges, metres."""
    q = local.abs() - (size - rounding[..., None])
    return q.clamp(min=0).norm(dim=-1) + q.amax(-1).clamp(max=0) - rounding


def distance_to_cylinder(
    local: Float[Tensor, "N P 3"], size: Float[Tensor, "N 1 3"], rounding: Float[Tensor, "N 1"]
) -> Float[Tensor, "N P"]:
    """Signed distance of points in the frames of cylinders with round edges, metres."""
    c = torch.stack([local[..., :2].norm(dim=-1), local[..., 2].abs()], -1) - size[..., 1:]
    c = c + rounding[..., None]
    return c.clamp(min=0).norm(dim=-1) + c.amax(-1).clamp(max=0) - rounding


def distance_to_ellipsoid(
    local: Float[Tensor, "N P 3"], size: Float[Tensor, "N 1 3"], _: Float[Tensor, "N 1"]
) -> Float[Tensor, "N P"]:
    """First-order bound k0 (k0 - 1) / k1 of the signed distance to ellipsoids, metres."""
    k0 = (local / size).norm(dim=-1)
    k1 = (local / size**2).norm(dim=-1).clamp(min=1e-6)
    return k0 * (k0 - 1) / k1


def distance_to_torus(
    local: Float[Tensor, "N P 3"], size: Float[Tensor, "N 1 3"], _: Float[Tensor, "N 1"]
) -> Float[Tensor, "N P"]:
    """Signed distance of points in the frames of tori, metres."""
    ring = local[..., :2].norm(dim=-1) - size[..., 0]
    return torch.stack([ring, local[..., 2]], -1).norm(dim=-1) - size[..., 1]


DISTANCES = {
    BOX: distance_to_box,
    CYLINDER: distance_to_cylinder,
    ELLIPSOID: distance_to_ellipsoid,
    TORUS: distance_to_torus,
}


@dataclass(frozen=True)
class Solids(Bundle):
    """A batch of objects, each a union of solids in the object's own frame, metres."""

    kind: Int[Tensor, "B S"]
    """BOX (half extents), CYLINDER (radius, radius, half height along z), ELLIPSOID (semi-axes),
    TORUS (ring radius, tube radius, unused; axis z) or SCAN (scale, the same on every axis; the
    first is negative for the mirror image)."""
    size: Float[Tensor, "B S 3"]
    rounding: Float[Tensor, "B S"]
    center: Float[Tensor, "B S 3"]
    rotation: Float[Tensor, "B S 3 3"]
    part: Int[Tensor, "B S"]  # which part each solid belongs to, 0 or 1
    axis: Float[Tensor, "B 3"]  # of the second part's joint, through `pivot`; a unit vector
    pivot: Float[Tensor, "B 3"]
    slides: Bool[Tensor, " B"]
    """Whether the second part slides along the axis (metres) or turns about it (radians)."""
    travel: Float[Tensor, "B 2"]
    """Range of the joint, relative to the state in which the object is drawn, in metres or radians;
    zero for rigid objects."""
    scans: Scans | None = None  # the scanned objects that kinds from SCAN on refer to

    @property
    def jointed(self) -> Bool[Tensor, " B"]:
        """Whether there is a second part."""
        return self.part.any(1)

    @property
    def scan(self) -> Int[Tensor, " B"]:
        """Index of the scanned object in `scans`; negative for a union of simple solids."""
        return self.kind[:, 0] - SCAN

    @property
    def extents(self) -> Float[Tensor, "B 3"]:
        """Approximate largest |coordinate| of an object along each axis of its frame, metres."""
        ring, tube, _ = self.size.unbind(-1)
        flat = torch.stack([ring + tube, ring + tube, tube], dim=-1)
        size = torch.where((self.kind == TORUS)[..., None], flat, self.size.abs())
        if self.scans is not None:
            half = size * self.scans.half[(self.kind - SCAN).clamp(min=0)]
            size = torch.where((self.kind >= SCAN)[..., None], half, size)
        reach = self.center.abs() + (self.rotation.abs() @ size[..., None])[..., 0]
        return (reach * (self.center[..., :1] < FAR_AWAY / 2)).amax(1)

    def only(self, part: int) -> "Solids":
        """The objects reduced to one part; an object without that part has no solid left."""
        away = (self.part != part)[..., None]
        return replace(self, center=torch.where(away, FAR_AWAY, self.center))

    def mirrored(self) -> "Solids":
        """The mirror images at x = 0: a right hand on them mirrors a left hand on the objects."""
        scanned = (self.kind >= SCAN)[..., None]
        return replace(
            self,
            size=torch.where(scanned, mirror_points(self.size), self.size),
            center=torch.where(self.center < FAR_AWAY / 2, mirror_points(self.center), self.center),
            rotation=mirror_rotations(self.rotation),  # simple solids are their own mirror images
            axis=mirror_axes(self.axis, self.slides),
            pivot=mirror_points(self.pivot),
        )

    def joint_pose(
        self, travelled: Float[Tensor, "B T"]
    ) -> tuple[Float[Tensor, "B T 3 3"], Float[Tensor, "B T 3"]]:
        """Rotation and translation of the second part for states of its joint."""
        return joint_poses(travelled, self.axis, self.pivot, self.slides)

    def nearest_part(self, points: Float[Tensor, "B P 3"]) -> Int[Tensor, "B P"]:
        """The part that each point is nearest to."""
        first, second = (self.only(part).signed_distance(points) for part in range(PARTS))
        return (second < first).long()

    def signed_distance(self, points: Float[Tensor, "B P 3"]) -> Float[Tensor, "B P"]:
        """Signed distance in metres, negative inside; exact outside of boxes, cylinders and tori.

        Ellipsoids use a bound of first order; a union has the least distance of its solids. Both
        are zero on the surface with the right gradient there.
        """
        used = self.center[..., 0] < FAR_AWAY / 2
        kinds = self.kind.clamp(max=SCAN)
        each = points.new_full((*used.shape, points.shape[1]), FAR_AWAY)
        there = kinds[used].unique().tolist()
        if not there:  # a distance that does not change, which has a gradient all the same
            each = each + 0 * points[:, None, :, 0]
        # only what there is: most of the time of a search for grasps is spent here
        for kind in there:
            at = torch.nonzero(used & (kinds == kind), as_tuple=True)
            from_center = points.index_select(0, at[0]) - self.center[at][:, None]
            local, size = from_center @ self.rotation[at], self.size[at][:, None]
            if kind == SCAN and self.scans is not None:
                found = self.scans.distance(self.kind[at] - SCAN, local / size) * size[..., 1]
            else:
                found = DISTANCES[kind](local, size, self.rounding[at][:, None])
            each = each.index_put(at, found)
        return each.amin(1)

    def distance_and_normal(
        self, points: Float[Tensor, "B P 3"]
    ) -> tuple[Float[Tensor, "B P"], Float[Tensor, "B P 3"]]:
        """Signed distance and its unit gradient, the outward normal on the surface."""
        with torch.enable_grad():
            query = points.detach().requires_grad_(True)
            distance = self.signed_distance(query)
            (gradient,) = torch.autograd.grad(distance.sum(), query)
        normal = torch.nn.functional.normalize(gradient, dim=-1)
        return distance.detach(), normal

    def surface_points(
        self, count: int, *, generator: torch.Generator, to_grasp: bool = False
    ) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B P 3"]]:
        """Points spread over the surface with their outward normals.

        With `to_grasp`, points of scanned objects prefer graspable places (`Scans.draw_points`).
        """
        if self.scans is None:
            return self._projected(count, generator=generator)
        scanned = self.scan >= 0
        points = self.size.new_zeros(len(scanned), count, 3)
        normals = points.clone()
        if not bool(scanned.all()):
            simple = self.take(~scanned, "B")._projected(count, generator=generator)
            points[~scanned], normals[~scanned] = simple
        which, scale = self.scan[scanned], self.size[scanned, :1]
        there, outward = self.scans.draw_points(
            which, count, generator=generator, to_grasp=to_grasp
        )
        turn, center = self.rotation[scanned, 0], self.center[scanned, :1]
        points[scanned] = there * scale @ turn.mT + center
        normals[scanned] = outward * scale.sign() @ turn.mT
        return points, normals

    def _projected(
        self, count: int, *, generator: torch.Generator
    ) -> tuple[Float[Tensor, "B P 3"], Float[Tensor, "B P 3"]]:
        """Points around simple solids, projected along the gradient of the distance."""
        batch, ring = len(self.kind), self.kind == TORUS
        used = (self.center[..., 0] < FAR_AWAY / 2).float()
        # thin parts get fewer points at sharp ends than wide faces, about as area weighting does
        outer = self.size[..., :2].sum(-1)
        reach = torch.where(ring, outer, self.size.norm(dim=-1)).clamp(min=0.01)
        drawn = count + count // 2  # a third is spare, for points that do not converge
        part = torch.multinomial(used * reach, drawn, replacement=True, generator=generator)
        at = torch.arange(batch)[:, None]
        ball = torch.randn(batch, drawn, 3, generator=generator)
        ball = ball / ball.norm(dim=-1, keepdim=True)
        extent = torch.where(ring[..., None], outer[..., None], self.size)[at, part]
        local = ball * extent * 1.2
        points = self.center[at, part] + (self.rotation[at, part] @ local[..., None])[..., 0]
        for _ in range(7):
            distance, normal = self.distance_and_normal(points)
            points = points - 0.9 * distance[..., None] * normal
        distance, normal = self.distance_and_normal(points)
        # sorted by convergence alone: sorted by distance, some solids would get all points
        outside = (distance.abs() > SURFACE_ERROR).int()
        keep = outside.argsort(dim=1, stable=True)[:, :count, None].expand(-1, -1, 3)
        return points.gather(1, keep), normal.gather(1, keep)
