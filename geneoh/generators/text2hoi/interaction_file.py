"""Actions as sequences, which every other command of geneoh reads."""

import torch

from geneoh.choices import SIDES
from geneoh.geometry.mesh import Mesh
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.actions import FPS, Actions


def sequence_of(
    actions: Actions, index: int, meshes: tuple[Mesh, ...], source: str = ""
) -> Sequence:
    """One action as a sequence of its hands of the mean shape and its object.

    `meshes` are one for each part of the object, in the frame of `Actions`; with one mesh the
    joint is left out.
    """
    one = actions.take(slice(index, index + 1), "B")
    frames = slice(int(one.length[0]))
    hands = tuple(
        HandTrack(
            side=side,
            valid=torch.ones(int(one.length[0]), dtype=torch.bool),
            pose=one.pose[0, number, frames],
            wrist=one.wrist[0, number, frames],
            betas=torch.zeros(10),
            hand_model="embedded",
        )
        for number, side in enumerate(SIDES)
        if bool(one.hands[0, number])
    )
    rotation, translation = one.part_poses()
    parts = slice(len(meshes))
    track = ObjectTrack(meshes, rotation[0, frames, parts], translation[0, frames, parts])
    return Sequence(hands, track, FPS, source)
