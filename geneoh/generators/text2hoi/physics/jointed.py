"""Objects of two parts that a sentence opens or closes, from their meshes to the clip."""

from dataclasses import dataclass, replace
from functools import partial

import torch
from jaxtyping import Bool, Int
from torch import Tensor

from geneoh.errors import ConfigError, InputError
from geneoh.generators.text2hoi.networks.objects import Objects
from geneoh.generators.text2hoi.physics.joint_finding import COMPARED_STATES, joint_of
from geneoh.generators.text2hoi.physics.opening import (
    guided,
    left_out,
    moved_by_hands_at_part,
    starting_gap,
    under_table,
)
from geneoh.generators.text2hoi.physics.part_holds import held_at_parts
from geneoh.generators.text2hoi.physics.resting import eased
from geneoh.generators.text2hoi.physics.standing import StandingObject
from geneoh.geometry.distance import SurfaceDistance
from geneoh.geometry.joint import Joint
from geneoh.geometry.mesh import Mesh
from geneoh.geometry.sampling import sample_surface
from geneoh.seeds import seeded_generator
from geneoh.synthesis.actions.action import TOUCHED, Actions

LEAST_POINTS = 8  # points of the second part, which by its area alone may have none
IN_TABLE = 0.005  # how far an edge of it may dip into the table beside an imprecise hinge, metres
AS_NEAR = 0.005  # metres by which a hand may be farther away than in the best sample
LOST_MOTION = 0.1  # share of the joint's motion that may be lost without a note


@dataclass(frozen=True, eq=False)
class JointedObject:
    """An object that stands on the table, whose second part a hand opens or closes."""

    stood: StandingObject  # of both closed meshes as one
    meshes: tuple[Mesh, Mesh]  # upright
    part: Int[Tensor, " P"]  # which part each of the points is of
    joint: Joint  # upright, with its range
    closes: bool

    @classmethod
    def of(
        cls, meshes: tuple[Mesh, Mesh], stood: StandingObject, joint: Joint | None, closes: bool
    ) -> tuple["JointedObject", tuple[str, ...]]:
        """The object with its joint, which is found if `joint` is None, and notes on it.

        Raises:
            InputError: as `joint_of`.
        """
        found, notes = joint_of(meshes, joint)
        upright = [Mesh(mesh.verts @ stood.rotation.T + stood.shift, mesh.faces) for mesh in meshes]
        first, second = (SurfaceDistance(m).query(stood.points).distance.abs() for m in upright)
        moved, part = found.moved(stood.rotation, stood.shift), (second < first).long()
        most = room_over_table(moved, upright[1])
        if moved.most is not None and most < moved.most:
            words = f"{moved.in_unit(most)} {'cm' if moved.slides else 'degrees'}"
            notes = (*notes, f"the part meets the table beyond {words}, where the joint ends")
            moved = replace(moved, most=most)
        if int(part.sum()) < LEAST_POINTS:
            own = sample_surface(upright[1], LEAST_POINTS, generator=seeded_generator("part"))
            points = torch.cat([stood.points[LEAST_POINTS:], own.points])
            normals = torch.cat([stood.normals[LEAST_POINTS:], own.normals])
            stood = replace(stood, points=points, normals=normals)
            part = torch.cat([part[LEAST_POINTS:], torch.ones_like(part[:LEAST_POINTS])])
        return cls(stood, (upright[0], upright[1]), part, moved, closes), notes

    @property
    def most(self) -> float:
        """The state in which the joint is open, radians or metres."""
        assert self.joint.most is not None, "a joint that was found or given has its range"
        return self.joint.most

    @property
    def objects(self) -> Objects:
        """A batch of this object alone, as input of the networks.

        The pivot is the point of the axis that is nearest to the middle of the first part, or, of a
        slide, that middle, as in made actions.
        """
        middle, axis, pivot = self.meshes[0].center(), self.joint.axis, self.joint.pivot
        pivot = middle if self.joint.slides else pivot + (middle - pivot) @ axis * axis
        slides, part = torch.tensor([self.joint.slides]), self.part[None]
        found = {"part": part, "axis": axis[None], "pivot": pivot[None], "slides": slides}
        return replace(self.stood.objects, **found)

    def guided(self, drawn: Actions) -> Actions:
        """Sampled actions with a joint that opens or closes within its range; see `guided`."""
        return guided(drawn, self.closes, self.most)

    def reached(self, drawn: Actions) -> Bool[Tensor, " B"]:
        """Mask of sampled actions whose hand is at the second part when it begins to move and stays
        over the table; if there are none, of those that come closest to this."""
        drawn = drawn.to("cpu")
        guided = self.guided(drawn)
        away = starting_gap(guided, drawn).amin(1) + under_table(guided)
        return away <= (away.amin() + AS_NEAR).clamp(min=TOUCHED)

    def finished(
        self, actions: Actions, generator: torch.Generator | None
    ) -> tuple[Actions, tuple[str, ...]]:
        """A guided action from rest to rest whose part moves only while a hand is at it.

        With a generator the hand is first brought to the part (`held_at_parts`). A note reports
        motion that is lost.
        """
        sampled = actions
        if generator is not None:
            actions = held_at_parts(actions, self.meshes, generator=generator)
        move = partial(moved_by_hands_at_part, closes=self.closes)
        actions = move(eased(move(actions)))
        if left_out(sampled, actions) < LOST_MOTION:
            return actions, ()
        fault = "the hand is not always at the part while that should move, and it then rests"
        return actions, (f"{fault}; another seed may make a better one",)


def room_over_table(joint: Joint, part: Mesh) -> float:
    """The state of a joint up to which the second part, which is upright, is over the table."""
    states = torch.linspace(0.0, joint.most or 0.0, COMPARED_STATES)
    free = joint.pose(states).apply(part.verts)[..., 2].amin(-1) > -IN_TABLE
    return float(states[int(free.long().cumprod(0).sum()) - 1])


def joined(meshes: tuple[Mesh, ...]) -> Mesh:
    """All parts of an object as one mesh, in their order."""
    if len(meshes) == 1:
        return meshes[0]
    starts = torch.tensor([0, *(len(mesh.verts) for mesh in meshes)]).cumsum(0)
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    verts = torch.cat([mesh.verts for mesh in meshes])
    return Mesh(verts, torch.cat(faces), source=meshes[0].source)


def asked_joint(meshes: tuple[Mesh, ...], joint: Joint | str | None) -> Joint | None:
    """The joint that was passed for the meshes, parsed; None if there is none. The axis of a
    `Joint` may have any length.

    Raises:
        InputError: there are more than two meshes or none, there is a joint but a single mesh, the
            text of the joint is invalid, or its axis has no direction.
        ConfigError: `joint` is neither a text nor a `Joint`.
    """
    if len(meshes) not in (1, 2):
        raise InputError(
            f"expected one mesh, or two for the parts of an object, got {len(meshes)}; join those "
            "that move together to one"
        )
    if joint is not None and len(meshes) == 1:
        raise InputError(
            "a joint is of an object of two parts, got one mesh; give each part as a mesh, the "
            "first part first, or leave the joint out"
        )
    if joint is None:
        return None
    if isinstance(joint, Joint):
        return joint.with_unit_axis()
    if not isinstance(joint, str):
        raise ConfigError(f"joint must be a text or a Joint, got {type(joint).__name__}")
    return Joint.read(joint)
