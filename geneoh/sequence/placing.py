"""Sequences in another frame: that of the world, where a moving camera gave them in its own."""

from dataclasses import replace

from jaxtyping import Float
from torch import Tensor

from geneoh.geometry.rigid import Rigid
from geneoh.geometry.rotations import nearest_rotations
from geneoh.sequence.gaps import fill_object, moved
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence


def placed(sequence: Sequence, pose: Rigid) -> Sequence:
    """A sequence after a rigid motion of hands, camera rays and object in each frame."""
    hands = tuple(placed_hand(hand, pose) for hand in sequence.hands)
    return replace(sequence, hands=hands, object=placed_object(sequence.object, pose))


def placed_hand(hand: HandTrack, pose: Rigid) -> HandTrack:
    """A hand and its camera ray after a rigid motion in each frame."""
    ray = hand.camera_ray
    if ray is not None:
        ray = (pose.rotation @ ray[..., None])[..., 0]
    return replace(moved(hand, pose), camera_ray=ray)


def placed_object(motion: ObjectTrack, pose: Rigid) -> ObjectTrack:
    """An object after a rigid motion in each frame."""
    rotation = pose.rotation[:, None] @ motion.rotation
    return replace(motion, rotation=rotation, translation=pose.apply(motion.translation))


def camera_of(matrices: Float[Tensor, "T 4 4"] | None) -> Rigid | None:
    """The poses of a camera, from matrices whose rotations may be rounded; None without any."""
    if matrices is None:
        return None
    return Rigid(nearest_rotations(matrices[:, :3, :3]), matrices[:, :3, 3])


def in_world(sequence: Sequence, camera: Rigid) -> Sequence:
    """The sequence of a moving camera in the world's frame, in which the object's missing poses are
    interpolated."""
    there = replace(placed(sequence, camera), camera_to_world=None)
    return replace(there, object=fill_object(there.object, there.object.observed))
