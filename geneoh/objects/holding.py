"""Models of rest for `geneoh.objects.refine`: an object lies in the world, or a hand holds it.

In a loose grip the object stays near one pose in the hand, with the variance of its observed motion
in the hand beyond the noise.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy.ndimage import uniform_filter1d
from scipy.spatial.transform import Rotation

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.objects.examination import EXACT_ROTATION, EXACT_TRANSLATION
from geneoh.objects.smoothing import WINDOW, interpolated
from geneoh.sequence.keypoints import KNUCKLES
from geneoh.sequence.sequence import HandTrack, ObjectTrack
from geneoh.sequence.windows import runs

HOLDING_REACH = 0.05
"""Largest distance of a hand's keypoints to the bounding box of a held part, metres."""
REST_LAG = 8
"""Frames between two poses in the test for rest: in this time drift moves the object by about as
much as the noise, and motion by more."""
MOTION_RATIO = 4.0
"""Mean squared displacement over `REST_LAG`, in units of that by drift, from which it is motion."""
WORLD_STEPS, HAND_STEPS = (0.006, 0.00005), (0.006, 0.0004)
"""Scale of the step per frame, metres, of rest in the world and in a hand, each in the first and in
the last round of reweighting. It shrinks from round to round, so that steps of motion lose their
weight before they distort the others."""
RADIANS_PER_METRE = 6.0  # conversion of these scales to rotations: 0.35 degrees per millimetre
CHI3_SHARE = 0.789  # median of the mean square of three standard normal variables
LEAST_GRIP = 0.0025  # floor of the standard deviation in a grip per axis, metres: error of hands
WELL_HELD = 0.01  # largest standard deviation of a grip that initialises unseen poses, metres
GRIP_FRAMES = 6.0  # correlation time of motion in a grip, frames
GRIP_OUTLIER = 4.0  # squared standard deviations from which on an object is not in its grip
SHORTEST_GRIP = 10  # least number of known frames near a hand for an estimate of the grip
REWEIGHTINGS = 8  # rounds of reweighting

Track = Float64[np.ndarray, "T 3"]


@dataclass(frozen=True)
class PartTrack:
    """The smooth track of one part, and its noise."""

    turns: Rotation
    places: Track
    noise: tuple[float, float]  # standard deviation of white noise per axis, radians and metres
    drift: tuple[float, float]  # standard deviation of drift per axis, radians and metres
    known: Bool[np.ndarray, " T"]  # False in frames that are filled or left out


@dataclass(frozen=True)
class Frame:
    """Frame of reference in which an object may rest, the world or a hand, over T frames."""

    rotation: Float64[np.ndarray, "T 3 3"]
    origin: Track
    near: Bool[np.ndarray, " N"]  # whether the object may rest in it between neighbouring frames
    scale: tuple[float, float] = HAND_STEPS

    @classmethod
    def of_world(cls, frames: int) -> "Frame":
        """The world frame, in which an object may rest at any time."""
        upright, origin = np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, 3))
        return cls(upright, origin, np.ones(frames - 1, dtype=bool), WORLD_STEPS)

    def step(
        self, start: Int[np.ndarray, " N"], lag: int = 1
    ) -> tuple[Float64[np.ndarray, "N 3 3"], Float64[np.ndarray, "N 3"]]:
        """Rigid motion x -> turn @ x + shift of this frame of reference, from the frames `start` to
        `lag` frames later."""
        turn = self.rotation[start + lag] @ self.rotation[start].swapaxes(1, 2)
        return turn, self.origin[start + lag] - _moved(turn, self.origin[start])

    def left(
        self, turns: Rotation, places: Track, start: Int[np.ndarray, " N"], lag: int = 1
    ) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3"]]:
        """Residual motion of an object relative to `step`: axis-angle in radians, and metres."""
        turn, shift = self.step(start, lag)
        matrices = turns.as_matrix()
        besides = matrices[start + lag] @ matrices[start].swapaxes(1, 2) @ turn.swapaxes(1, 2)
        return (
            Rotation.from_matrix(besides).as_rotvec(),
            places[start + lag] - _moved(turn, places[start]) - shift,
        )


@dataclass(frozen=True)
class Grip:
    """Poses of an object that does not move in a hand, world frame, with weights."""

    turns: Rotation
    places: Track
    weights: Float64[np.ndarray, "2 T"]  # precisions, 1/rad^2 and 1/m^2; 0 where not held

    def taken(
        self, start: tuple[Rotation, Track], lost: Bool[np.ndarray, " T"]
    ) -> tuple[Rotation, Track]:
        """The track `start` with the poses of this grip in lost frames in which it is firm."""
        held = (lost & (self.weights[1] * GRIP_FRAMES > WELL_HELD**-2))[:, None]
        turns = np.where(held[..., None], self.turns.as_matrix(), start[0].as_matrix())
        return Rotation.from_matrix(turns), np.where(held, self.places, start[1])


def frame_of(
    hand: HandTrack, motion: ObjectTrack, part: int, known: Bool[np.ndarray, " T"]
) -> Frame:
    """The palm as a frame of reference, `near` where the hand is at the bounding box of a part."""
    assert hand.joints is not None, "clean hands have joints"
    assert hand.pose is not None, "clean hands have a pose"
    verts = motion.meshes[part].verts
    local = motion.seen_from(part, hand.joints)
    away = (local - local.clamp(verts.amin(0), verts.amax(0))).norm(dim=-1).amin(-1)
    return Frame(
        axis_angle_to_matrix(hand.pose[:, 0]).double().cpu().numpy(),
        hand.joints[:, list(KNUCKLES)].mean(1).double().cpu().numpy(),
        bridged(away.double().cpu().numpy(), known)[1:] < HOLDING_REACH,
    )


def grip_of(frame: Frame, smooth: PartTrack) -> Grip:
    """The grip in each run of frames in which a hand is near, with zero weight elsewhere."""
    back = frame.rotation.swapaxes(1, 2)
    turns = Rotation.from_matrix(back @ smooth.turns.as_matrix())
    places = _moved(back, smooth.places - frame.origin)
    held, weights = places.copy(), np.zeros((2, len(places)))
    onto = turns.as_matrix()
    for run in runs(np.append(frame.near, frame.near[-1])):
        if smooth.known[run].sum() >= SHORTEST_GRIP:
            found = usual_grip(turns[run], places[run], smooth.drift, smooth.known[run])
            onto[run], held[run], weights[:, run] = found
    return Grip(
        Rotation.from_matrix(frame.rotation @ onto),
        frame.origin + _moved(frame.rotation, held),
        weights,
    )


def usual_grip(
    turns: Rotation, places: Track, noise: tuple[float, float], known: Bool[np.ndarray, " T"]
) -> tuple[Float64[np.ndarray, "3 3"], Float64[np.ndarray, " 3"], Float64[np.ndarray, "2 T"]]:
    """Robust mean pose in the hand, and the precisions of rotations and positions about it."""
    sound = turns[known]  # pyright: ignore[reportArgumentType]  # arrays lack in scipy's stubs
    turn, place = sound.mean(), np.median(places[known], axis=0)
    usual, apart = np.square(noise), np.zeros(len(places))
    for _ in range(REWEIGHTINGS):
        residuals = np.stack([(turns * turn.inv()).as_rotvec(), places - place])
        squares = np.square(residuals).mean(2)
        usual = np.maximum(np.median(squares[:, known], axis=1) / CHI3_SHARE, np.square(noise))
        apart = (squares / usual[:, None]).mean(0) / GRIP_OUTLIER
        weight = known * (1 + apart) ** -2
        turn, place = turns.mean(weight), np.average(places, axis=0, weights=weight)
    least = LEAST_GRIP * np.array([RADIANS_PER_METRE, 1])
    beyond = np.maximum(usual - np.square(noise), least**2)
    sure = (1 + uniform_filter1d(bridged(apart, known), WINDOW, mode="nearest")) ** -4
    return turn.as_matrix(), place, sure / GRIP_FRAMES / beyond[:, None]


def could_rest(frame: Frame, smooth: PartTrack) -> Bool[np.ndarray, " N"]:
    """Whether drift alone explains the motion in a frame of reference, around each step."""
    steps = np.arange(len(smooth.places) - 1)
    least = np.full(len(steps), np.inf)
    for back in (0, REST_LAG // 2, REST_LAG - 1):
        start = (steps - back).clip(0, len(steps) - REST_LAG)
        found = frame.left(smooth.turns, smooth.places, start, REST_LAG)
        drift = np.hypot(smooth.drift, (EXACT_ROTATION, EXACT_TRANSLATION))
        units = [np.square(x).sum(1) / 3 / d**2 for x, d in zip(found, drift, strict=True)]
        both = smooth.known[start] & smooth.known[start + REST_LAG]
        least = np.where(both, np.minimum(least, sum(units)), least)
    return bridged(least, least < np.inf) < MOTION_RATIO


def bridged(values: np.ndarray, known: np.ndarray) -> Float64[np.ndarray, " N"]:
    """Values of a track with unknown ones interpolated; infinite if none is known."""
    return interpolated(values[:, None], known)[:, 0] if known.any() else values + np.inf


def _moved(turn: Float64[np.ndarray, "N 3 3"], points: np.ndarray) -> Float64[np.ndarray, "N 3"]:
    """Points, each rotated by its matrix."""
    return np.einsum("nij,nj->ni", turn, points)
