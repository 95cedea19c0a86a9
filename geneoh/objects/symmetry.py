"""Rotational symmetry of a mesh: pose estimators cannot resolve it, and flip a nearly symmetric
object (a bottle, a box, a ball) by a symmetry rotation from one frame to the next."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.sampling import sample_surface

COMPARED_POINTS = 256  # surface points that are rotated and compared with the surface
TOLERANCE = 0.03
"""Largest mean distance of rotated points to the surface of a symmetric object, as a share of their
mean distance to the axis."""
ORDERS = (2, 3, 4, 5, 6)  # tested orders of finite rotational symmetry
REVOLUTION_TURNS = (0.37, 1.0, 1.9, 2.6)
"""Angles in radians that test a solid of revolution; no simple fractions of a full turn."""
SAME_AXIS = 0.9  # cosine between two axes of symmetry above which they count as the same
TURN_STEPS = 72  # discretisation of rotations about an axis of revolution, steps per full turn


@dataclass(frozen=True)
class Symmetry:
    """Rotations about `center` that map a mesh onto itself, up to the tolerance."""

    center: Float64[np.ndarray, " 3"]
    """Fixed point of all rotations in the mesh's frame, metres; without a symmetry, the centre of
    the bounding box."""
    rotations: Float64[np.ndarray, "S 3 3"]
    """Symmetry rotations, the identity first; `TURN_STEPS` about an axis of revolution."""
    is_ball: bool = False  # every rotation is a symmetry; `rotations` has the identity alone
    axis: Float64[np.ndarray, " 3"] | None = None
    """Unit axis of a solid of revolution, else None."""

    def nearest(
        self, rotation: Float64[np.ndarray, "3 3"], wanted: Float64[np.ndarray, "N 3 3"]
    ) -> tuple[Float64[np.ndarray, "N 3 3"], Float64[np.ndarray, " N"]]:
        """For each wanted rotation R, the symmetry rotation S for which `rotation` @ S is nearest
        to R, and the remaining angle, radians."""
        if self.is_ball:
            return rotation.T @ wanted, np.zeros(len(wanted))
        traces = np.einsum("nij,ik,skj->ns", wanted, rotation, self.rotations)
        best = traces.argmax(1)
        cosine = (traces[np.arange(len(wanted)), best] - 1) / 2
        return self.rotations[best], np.arccos(cosine.clip(-1, 1))


def find_symmetry(surface: SurfaceDistance) -> Symmetry:
    """The rotational symmetry of one mesh; deterministic."""
    generator = torch.Generator().manual_seed(0)
    samples = sample_surface(surface.solid, COMPARED_POINTS, generator=generator)
    points = samples.points.double().numpy()
    center, axes = area_moments(surface.solid.surface)
    around = points - center

    def misfit(axis: np.ndarray, *angles: float) -> float:
        """Distance of the rotated to the original surface, in units of `TOLERANCE`."""
        lever = float(np.linalg.norm(np.cross(around, axis), axis=1).mean())
        turns = Rotation.from_rotvec(np.outer(angles, axis))
        moved = np.stack([turn.apply(around) for turn in turns]) + center
        apart = surface.query(torch.from_numpy(moved)).distance.abs().mean(-1).max()
        return float(apart) / (TOLERANCE * lever)

    revolution = _distinct(axes, [misfit(axis, *REVOLUTION_TURNS) for axis in axes])
    if len(revolution) > 1:
        return Symmetry(center, np.eye(3)[None], is_ball=True)
    finite = [Rotation.identity()]
    for order in ORDERS if not revolution else ORDERS[:1]:
        angles = 2 * np.pi * np.arange(1, order) / order
        for axis in _distinct(axes, [misfit(axis, angles[0]) for axis in axes]):
            if not any(abs(axis @ other) > SAME_AXIS for other in revolution):
                finite += [Rotation.from_rotvec(angle * axis) for angle in angles]
    steps = 2 * np.pi * np.arange(TURN_STEPS) / TURN_STEPS if revolution else np.zeros(1)
    axis = revolution[0] if revolution else np.zeros(3)
    # half turns across an axis of revolution follow from one of them
    group = finite[:2] if revolution else finite
    rotations = closure(group, [Rotation.from_rotvec(step * axis) for step in steps])
    middle = surface.mesh.center().double().cpu().numpy()
    middle = center if len(rotations) > 1 else middle
    return Symmetry(middle, rotations, axis=axis if revolution else None)


def _distinct(axes: Float64[np.ndarray, "A 3"], misfits: list[float]) -> list[np.ndarray]:
    """The axes with a misfit below 1; of nearly equal axes, the best one."""
    found: list[np.ndarray] = []
    for index in np.argsort(misfits):
        is_new = all(abs(axes[index] @ other) < SAME_AXIS for other in found)
        if misfits[index] < 1 and is_new:
            found.append(axes[index])
    return found


def area_moments(mesh: Mesh) -> tuple[Float64[np.ndarray, " 3"], Float64[np.ndarray, "A 3"]]:
    """The area centroid of a surface, and candidate axes of symmetry: the axes of inertia, and the
    axes of the mesh's frame, because equal moments leave the axes of inertia undetermined."""
    corners = mesh.corners().double().numpy()
    areas = mesh.face_vectors().double().norm(dim=-1).numpy() / 2
    center = np.average(corners.mean(1), axis=0, weights=areas)
    corners = corners - center
    sums = corners.sum(1)
    moments = np.einsum("f,fki,fkj->ij", areas, corners, corners)
    moments += np.einsum("f,fi,fj->ij", areas, sums, sums)
    return center, np.concatenate([np.linalg.eigh(moments)[1].T, np.eye(3)])


def closure(finite: list[Rotation], circle: list[Rotation]) -> Float64[np.ndarray, "S 3 3"]:
    """Distinct products of two finite rotations and one rotation of a circle."""
    group = np.stack([turn.as_matrix() for turn in finite])
    both = np.einsum("aij,bjk->abik", group, group).reshape(-1, 3, 3)
    turns = np.stack([turn.as_matrix() for turn in circle])
    products = np.einsum("aij,bjk->abik", both, turns).reshape(-1, 3, 3)
    _, first = np.unique(products.round(3).reshape(-1, 9) + 0.0, axis=0, return_index=True)
    return products[np.sort(first)]
