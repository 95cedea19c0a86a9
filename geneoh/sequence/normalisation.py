"""Normalisation to what the networks have learned, right hands at 30 frames a second, and back."""

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
"""Frames a second of all data that the networks learn from."""


@dataclass(frozen=True)
class NormalisedHand(Bundle):
    """One hand of a sequence and its object, as a right hand at 30 frames a second.

    Left hands are mirrored with their object, x -> -x, and other frame rates are resampled. The
    `to_user` methods take results back to the side and the frames of the sequence.
    """

    track: HandTrack
    object: ObjectTrack
    fps: float
    """Exact rate of the resampled frames: 30, or near it where the length is no whole number."""
    side: Side
    """Side of the hand in the sequence."""
    user_frames: int
    """Number of frames of the sequence."""

    @property
    def mirrored(self) -> bool:
        """Whether the hand is a left one in the sequence."""
        return self.side == "left"

    def right_model(self, model: HandModel) -> HandModel:
        """The model of the user's side as that of a right hand."""
        return model.mirrored() if self.mirrored else model

    def track_to_user(self, track: HandTrack) -> HandTrack:
        """A result on the side and in the frames of the sequence."""
        back = hand_over_frames(track, self.user_frames)
        return back.mirrored() if self.mirrored else back

    def points_to_user(self, points: Float[Tensor, "*B 3"]) -> Float[Tensor, "*B 3"]:
        """Points on the side of the sequence; their frames stay those of the networks."""
        return mirror_points(points) if self.mirrored else points

    def frames_to_user(self, values: Shaped[Tensor, "N ..."]) -> Shaped[Tensor, "T ..."]:
        """For each frame of the sequence the value of the nearest resampled frame."""
        return values[nearest_frames(len(values), self.user_frames)]


def normalised_hands(sequence: Sequence, fps: float = NETWORK_FPS) -> tuple[NormalisedHand, ...]:
    """Every hand of a sequence as the networks know hands; both share the resampled frames.

    Of a higher rate every frame has a say: those of the networks are means.
    """
    paced, found = at_rate(averaged(sequence, fps), fps), []
    for hand in paced.hands:
        left = hand.side == "left"
        track = hand.mirrored() if left else hand
        motion = paced.object.mirrored() if left else paced.object
        found.append(NormalisedHand(track, motion, paced.fps, hand.side, sequence.frames))
    return tuple(found)
