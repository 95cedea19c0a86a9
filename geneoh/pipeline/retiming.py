"""Resample a result at other times and measure it again."""

from dataclasses import replace

from jaxtyping import Float
from torch import Tensor

from geneoh.fitting.terms import HandState
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.metrics.report import InteractionReport
from geneoh.pipeline.results import Denoised, HandResult
from geneoh.pipeline.stages.alone import measure_hand
from geneoh.pipeline.touch import EXACT_WITHIN
from geneoh.sequence.resample import at_times, instants
from geneoh.sequence.sequence import HandTrack, Sequence


def result_at_times(result: Denoised, time: Float[Tensor, " N"]) -> Denoised:
    """The result resampled at `time`, the position of each new frame in frames of the old result.

    `after` is measured again; other measures stay. The hands must be of the embedded model, at 30
    frames a second.
    """
    sequence = at_times(result.sequence, time)
    nearest = instants(time, result.sequence.frames).nearest

    def of_hand(hand: HandResult) -> HandResult:
        track = sequence.hand(hand.track.side)
        return replace(
            hand,
            track=track,
            after=_measured(track, sequence),
            filled=hand.filled[nearest],
            contact=None if hand.contact is None else hand.contact[nearest],
            evidence=hand.evidence[nearest],
        )

    hands = {side: of_hand(hand) for side, hand in result.hands.items()}
    return replace(result, sequence=sequence, hands=hands)


def _measured(track: HandTrack, sequence: Sequence) -> InteractionReport:
    """The report of a clean hand against the object of its sequence."""
    motion = sequence.object
    if track.side == "left":
        track, motion = track.mirrored(), motion.mirrored()
    assert track.pose is not None, "a clean hand has a pose"
    assert track.wrist is not None, "a clean hand has a wrist"
    assert track.joints is not None, "a clean hand has joints"
    assert track.betas is not None, "a clean hand has betas"
    state = HandState(axis_angle_to_matrix(track.pose)[None], track.wrist[None])
    shaped = load_hand("right").shaped(track.betas)
    surface = motion.surface() if motion.meshes else None
    found, _ = measure_hand(
        state, shaped, track.joints, surface, sequence.fps, track.valid, within=EXACT_WITHIN
    )
    return found
