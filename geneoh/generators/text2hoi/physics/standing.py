"""From a mesh to the input of the networks: upright on the table, as surface points."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from geneoh.choices import Axis
from geneoh.errors import InputError
from geneoh.generators.text2hoi.networks.objects import Objects
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.rotations import turn_up
from geneoh.geometry.sampling import sample_surface
from geneoh.synthesis.actions.action import Actions

POINTS = 1024  # points of an object (paper)
LARGEST_SIDE = 2.0  # largest side of an object that hands move, metres
THICKEST = 0.2
"""Largest thickness (smallest side), metres: no thicker object was learned; hands end up inside."""
SMALLEST = 0.004  # least value of an object's largest side, metres
NEAREST = 3  # closest points from which a vertex's contact is interpolated


@dataclass(frozen=True)
class StandingObject:
    """A mesh that stands on the table: p_upright = rotation @ p_mesh + shift."""

    mesh: Mesh
    rotation: Float[Tensor, "3 3"]
    shift: Float[Tensor, " 3"]
    points: Float[Tensor, "P 3"]  # of the surface, upright
    normals: Float[Tensor, "P 3"]  # outward

    @property
    def objects(self) -> Objects:
        """A batch of this object alone, rigid, as input of the networks."""
        none = torch.zeros(1, 3)
        return Objects(
            points=self.points[None],
            normals=self.normals[None],
            part=torch.zeros(1, len(self.points), dtype=torch.long),
            axis=none,
            pivot=none,
            slides=torch.zeros(1, dtype=torch.bool),
        )

    def poses(self, actions: Actions) -> tuple[Float[Tensor, "T 3 3"], Float[Tensor, "T 3"]]:
        """The poses of the mesh itself in the first of some actions, mesh to world."""
        rotation = actions.rotation[0] @ self.rotation
        translation = actions.rotation[0] @ self.shift + actions.translation[0]
        return rotation, translation

    def on_vertices(self, values: Float[Tensor, " P"]) -> Float[Tensor, " V"]:
        """Values at the points, interpolated to the mesh's vertices from the closest points."""
        verts = self.mesh.verts @ self.rotation.T + self.shift
        found = [
            torch.cdist(part, self.points).topk(NEAREST, largest=False)
            for part in verts.split(4096)
        ]
        distance = torch.cat([each.values for each in found])
        index = torch.cat([each.indices for each in found])
        weight = 1 / distance.clamp(min=1e-6)
        return (values[index] * weight).sum(-1) / weight.sum(-1)


def stand_on_table(mesh: Mesh, up: Axis = "z", *, generator: torch.Generator) -> StandingObject:
    """The mesh with an axis of its frame up, its lowest point on the table, over the origin.

    Raises:
        InputError: the mesh is too large, too thick or too small for hands; perhaps it is not in
            metres.
    """
    sides = mesh.extent()
    size, thickness = float(sides.amax()), float(sides.amin())
    name = mesh.source or "the mesh"
    if not SMALLEST <= size <= LARGEST_SIDE:
        unit = "mm or cm" if size > LARGEST_SIDE else "m or cm"
        raise InputError(
            f"{name}: expected an object of {SMALLEST:g} to {LARGEST_SIDE:g} m for hands, got "
            f"{size:.3g} m; pass --unit {unit}, or scale it"
        )
    if thickness > THICKEST:
        raise InputError(
            f"{name}: expected an object that is at most {THICKEST:g} m thick "
            f"for hands, got {thickness:.3g} m on its shortest side; pass --unit if it is not in "
            "metres, or scale it"
        )
    rotation = turn_up(up)
    found = sample_surface(mesh, POINTS, generator=generator)
    points = found.points @ rotation.T
    low = (mesh.verts @ rotation.T)[:, 2].amin()
    shift = -torch.cat([points[:, :2].mean(0), low[None]])
    return StandingObject(mesh, rotation, shift, points + shift, found.normals @ rotation.T)
