"""One hand of an action in the object frame, where left hands are mirrored to right ones.

How firmly it holds the object, and a new hold where no sampled pose can carry the object.
"""

from dataclasses import dataclass, replace

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import SIDES
from geneoh.geometry.mirror import mirror_axis_angle, mirror_points
from geneoh.geometry.rotations import axis_angle_to_matrix, matrix_to_axis_angle
from geneoh.hand.library import mean_hand
from geneoh.hand.skeleton import forward_kinematics
from geneoh.hand.spheres import hand_and_wrist_spheres, hand_scale
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.grasping.contact_pads import Obstacles, OtherHands, Table, contact_pads
from geneoh.synthesis.grasping.grasp_energy import unheld
from geneoh.synthesis.grasping.grasps import GraspConfig, synthesize_grasps
from geneoh.synthesis.shapes.solids import Solids

RESTING_SPEED = 1e-5  # metres per frame below which an object rests
METRES_PER_RADIAN = 0.01  # metres of motion that a radian of rotation counts as
LIFTED = 0.01  # metres off its first height above which an object counts as lifted
GRASPS_TRIED = 12  # grasps that are synthesised at once
SIDES_TRIED, SIDE_SPREAD = 3, 0.6
"""Searches for the grasp of a hand that carries the object with another one, and the spread of
their directions relative to the side away from the other hand."""
PAD_TOUCH = 0.003  # distance from the surface below which a pad touches, metres
FIRM = 0.5  # largest share of a push from the worst side that a firm hold leaves unheld (`unheld`)
GRASPS = GraspConfig(grips=0)


@dataclass(frozen=True)
class HeldHands(Bundle):
    """N right hands of the mean shape, or mirrored left ones, in the frame of their object."""

    pose: Float[Tensor, "N 16 3"]
    wrist: Float[Tensor, "N 3"]  # metres

    @classmethod
    def of(cls, actions: Actions, number: int, middle: Float[Tensor, " 3"]) -> "HeldHands":
        """Hand `number` (0 left, 1 right) of the first action in all frames, relative to the
        `middle` of its object."""
        axes = actions.rotation[0].mT
        turn = axes @ axis_angle_to_matrix(actions.pose[0, number, :, 0])
        apart = actions.wrist[0, number] - actions.translation[0]
        wrist = (axes @ apart[..., None])[..., 0] - middle
        pose = [matrix_to_axis_angle(turn)[:, None], actions.pose[0, number, :, 1:]]
        return cls(torch.cat(pose, 1), wrist).on_side(number)

    def on_side(self, number: int) -> "HeldHands":
        """The hands, mirrored if `number` is that of the left hand."""
        if SIDES[number] == "right":
            return self
        return HeldHands(mirror_axis_angle(self.pose), mirror_points(self.wrist))

    def into(self, actions: Actions, number: int, middle: Float[Tensor, " 3"]) -> Actions:
        """The actions with this hand in the first one; the inverse of `of`."""
        hand, turn, shift = self.on_side(number), actions.rotation[0], actions.translation[0]
        world = turn @ axis_angle_to_matrix(hand.pose[:, 0])
        place = (turn @ (hand.wrist + middle)[..., None])[..., 0] + shift
        poses, wrists = actions.pose.clone(), actions.wrist.clone()
        poses[0, number] = torch.cat([matrix_to_axis_angle(world)[:, None], hand.pose[:, 1:]], 1)
        wrists[0, number] = place
        return replace(actions, pose=poses, wrist=wrists)

    @property
    def spheres(self) -> tuple[Float[Tensor, "N K 3"], Float[Tensor, "N K"]]:
        """Centres and radii of the spheres that fill the hands and their wrists."""
        return hand_and_wrist_spheres(*self._posed(), self._scale())

    @property
    def mirrored_spheres(self) -> OtherHands:
        """The spheres as an obstacle of the hand of the other side, whose frame is mirrored."""
        centers, radii = self.spheres
        return OtherHands(mirror_points(centers), radii)

    @property
    def pads(self) -> Float[Tensor, "N 19 3"]:
        """Contact points on the skin (pads)."""
        return contact_pads(*self._posed(), self._scale())[0]

    def _posed(self) -> tuple[Float[Tensor, "N 21 3"], Float[Tensor, "N 16 3 3"]]:
        return forward_kinematics(axis_angle_to_matrix(self.pose), self.wrist, mean_offsets())

    def _scale(self) -> Float[Tensor, "N 1"]:
        return hand_scale(mean_offsets()).expand(len(self.pose), 1)


def table_of(actions: Actions, number: int, middle: Float[Tensor, " 3"]) -> Table:
    """The table in all frames of the first action, in the coordinates of `HeldHands.of`."""
    up = actions.rotation[0, :, 2]
    height = actions.translation[0, :, 2] + up @ middle
    return Table(up if SIDES[number] == "right" else mirror_points(up), height)


def mean_offsets() -> Float[Tensor, "1 20 3"]:
    """Bone offsets of the mean right hand."""
    return mean_hand("right").offsets[None]


def frames_of_motion(actions: Actions) -> Bool[Tensor, " T"]:
    """Mask of frames just before or after which the object of the first action moves."""
    shift = actions.translation[0].diff(dim=0).norm(dim=-1)
    turn = matrix_to_axis_angle(actions.rotation[0, :-1].mT @ actions.rotation[0, 1:])
    moves = shift + METRES_PER_RADIAN * turn.norm(dim=-1) > RESTING_SPEED
    return torch.nn.functional.pad(moves, (1, 0)) | torch.nn.functional.pad(moves, (0, 1))


def lifted(actions: Actions, frames: Bool[Tensor, " T"]) -> bool:
    """Whether the object of the first action is off its first height in some frames."""
    height = actions.translation[0, :, 2]
    return bool(((height - height[0]).abs() > LIFTED)[frames].any())


@dataclass(frozen=True)
class Holding:
    """Contact of hands with an object, and how firm it is."""

    touching: Float[Tensor, " N"]  # number of touching pads
    loose: Float[Tensor, " N"]  # share of the worst push that is not held, 0 to 1

    @classmethod
    def of(cls, solids: Solids, hands: HeldHands) -> "Holding":
        """The contact of N hands with N objects."""
        pads = hands.pads
        gap, normal = solids.distance_and_normal(pads)
        touching = gap.abs() < PAD_TOUCH
        return cls(touching.sum(1).to(gap), unheld(pads, normal, touching))


def new_hold(
    solids: Solids,
    drawn: HeldHands,
    beside: Obstacles,
    generator: torch.Generator,
    *,
    alone: bool = True,
) -> HeldHands | None:
    """The firm grasp that is closest to a sampled hand, synthesised as for the training data.

    The search starts on the sampled hand's side of the object and avoids the table and the other
    hand. A hand that carries the object with another one, and so not `alone`, also takes a
    grasp that is not firm by itself, and one on the side away from the other hand. None if no grasp
    passes the checks of the training data.
    """
    copies = [0] * GRASPS_TRIED
    objects, beside_each = solids.take(copies, "B"), beside.take(copies, "B")
    side = torch.nn.functional.normalize(drawn.wrist, dim=-1)
    toward = side.expand(GRASPS_TRIED, -1)
    if beside.other is not None:
        side = -torch.nn.functional.normalize(beside.other.centers.mean(1), dim=-1)
    for _ in range(1 if alone else SIDES_TRIED):
        found, kept = new_grasps(solids, toward, beside_each, generator)
        firm = kept & (Holding.of(objects, found).loose < FIRM)
        good = firm if alone or bool(firm.any()) else kept
        if bool(good.any()):
            away = (found.spheres[0] - drawn.spheres[0]).norm(dim=-1).mean(1)
            nearest = away.masked_fill(~good, torch.inf).argmin()
            return found.take(nearest[None], "N")
        around = side + SIDE_SPREAD * torch.randn(GRASPS_TRIED, 3, generator=generator)
        toward = torch.nn.functional.normalize(around, dim=-1)
    return None


def new_grasps(
    solids: Solids, toward: Float[Tensor, "N 3"], beside: Obstacles, generator: torch.Generator
) -> tuple[HeldHands, Bool[Tensor, " N"]]:
    """New grasps of one object from N directions, and which of them pass the checks."""
    grasps = synthesize_grasps(
        solids.take([0] * len(toward), "B"),
        mean_offsets().expand(len(toward), -1, -1),
        GRASPS,
        generator=generator,
        toward=toward,
        beside=beside,
    )
    return HeldHands(grasps.pose, grasps.wrist), grasps.kept
