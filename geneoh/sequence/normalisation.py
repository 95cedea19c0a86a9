"""Normalisation to right hands at 30 frames a second, as the networks learned them, and back."""

from dataclasses import dataclass

from jaxtyping import Float, Shaped
from torch import Tensor

from geneoh.bundle import Bundle
from geneoh.choices import Side
from geneoh.geometry.mirror import mirror_points
from geneoh.hand.model import HandModel
from geneoh.sequence.resample import at_rate, averaged, hand_over_frames, nearest_frames
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence

NETWORK_FPS = 30.0
"""Frame rate of all training data of the networks."""


@dataclass(frozen=True)
class NormalisedHand(Bundle):
    """One hand of a sequence and its object, as a right hand at 30 frames a second.

    Left hands are mirrored with their object, x -> -x, and other frame rates are resampled. The
    `to_user` methods transform results back to the side and the frames of the sequence.
    """

    track: HandTrack
    object: ObjectTrack
    fps: float
    """Exact frame rate after resampling: 30, or near it, as the number of frames is whole."""
    side: Side
    """Side of the hand in the sequence."""
    user_frames: int
    """Number of frames of the sequence."""

    @property
    def mirrored(self) -> bool:
        """Whether the hand is a left one in the sequence."""
        return self.side == "left"

    def right_model(self, model: HandModel) -> HandModel:
        """A hand model of the sequence's side as the model of a right hand."""
        return model.mirrored() if self.mirrored else model

    def track_to_user(self, track: HandTrack) -> HandTrack:
        """A resulting track, mirrored and resampled back to the sequence."""
        back = hand_over_frames(track, self.user_frames)
        return back.mirrored() if self.mirrored else back

    def points_to_user(self, points: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3"]:
        """Points, mirrored back to the side of the sequence but not resampled."""
        return mirror_points(points) if self.mirrored else points

    def frames_to_user(self, values: Shaped[Tensor, "N ..."]) -> Shaped[Tensor, "T ..."]:
        """For each frame of the sequence the value of the nearest resampled frame."""
        return values[nearest_frames(len(values), self.user_frames)]


def normalised_hands(sequence: Sequence, fps: float = NETWORK_FPS) -> tuple[NormalisedHand, ...]:
    """Every hand of a sequence, normalised for the networks; both share the resampled frames.

    Frames of a higher rate are averaged and not dropped.
    """
    paced, found = at_rate(averaged(sequence, fps), fps), []
    for hand in paced.hands:
        left = hand.side == "left"
        track = hand.mirrored() if left else hand
        motion = paced.object.mirrored() if left else paced.object
        found.append(NormalisedHand(track, motion, paced.fps, hand.side, sequence.frames))
    return tuple(found)
