"""Temporal consistency of a pose track: find frames that jump, and undo symmetry flips."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Float64, Int
from scipy.spatial.transform import Rotation

from geneoh.objects.smoothing import increments
from geneoh.objects.symmetry import Symmetry
from geneoh.sequence.shots import COMPARED_STEPS, CUT_RATIO

SKIPPED, TURNED, USED_SYMMETRY = 0.02, 0.3, 0.25
"""Costs of a chain: per skipped frame, for a rotation as large as the limit, and per change of the
mesh symmetry that is applied. Each kept frame has a value of 1."""
TRUSTED_SHARE = 2 / 3  # share of all kept frames from which on a stretch between jumps is trusted
START_SPEED = 4.0  # largest speed at the start of a track, metres per second


@dataclass(frozen=True)
class Chain:
    """Frames of a track that are connected by possible motion."""

    kept: Bool[np.ndarray, " T"]
    onto_itself: Float64[np.ndarray, "T 3 3"]
    """Symmetry rotation of the mesh that makes each kept frame consistent with the one before."""
    jumps: tuple[int, ...]  # kept frames that no possible motion reaches from the kept frame before

    def stretches(self) -> list[slice]:
        """The stretches of frames between jumps."""
        edges = [0, *self.jumps, len(self.kept)]
        return [slice(start, stop) for start, stop in pairwise(edges)]

    @property
    def doubted(self) -> Bool[np.ndarray, " T"]:
        """Frames that may be wrong because of a jump: all but a stretch with most kept frames.

        One side of a jump must be wrong, and nothing shows which.
        """
        found = np.full(len(self.kept), bool(self.jumps))
        for stretch in self.stretches():
            if self.kept[stretch].sum() >= TRUSTED_SHARE * self.kept.sum():
                found[stretch] = False
        return found


def longest_chain(
    rotations: Rotation, limit: float, symmetry: Symmetry, fps: float, lasting: float
) -> Chain:
    """The chain with most frames and fewest jumps, by dynamic programming.

    The prediction for the next frame of the chain is rest or constant angular velocity. A step is
    possible if a frame is within `limit` (radians, for one frame) times the square root of the
    number of frames from either prediction, if need be after a symmetry rotation of the mesh; any
    other step is a jump. So fast motion is no jump if it accelerates over several frames. An
    orientation beyond a jump is left out if the track leaves it within `lasting` seconds, else it
    is kept.
    """
    matrices = rotations.as_matrix()
    count = len(matrices)
    onto, aligned = np.tile(np.eye(3), (count, 1, 1)), matrices.copy()
    if largest_bend(increments(rotations)) < limit:
        return Chain(np.ones(count, dtype=bool), onto, ())
    chains, jumped = Chains(count, limit, lasting * fps), np.zeros(count, dtype=bool)
    rate = np.zeros((count, 3))
    for frame in range(1, count):
        earlier = chains.earlier(frame)
        apart = frame - earlier
        ahead = Rotation.from_rotvec(rate[earlier] * apart[:, None]).as_matrix()
        rest = aligned[earlier]
        # prefer the symmetry rotation of the earlier frame
        reach, carried = limit * np.sqrt(apart), onto[earlier]
        found = nearest_turn(matrices[frame], (rest, rest @ ahead), carried, reach, symmetry)
        angle, changed, turned = found
        best = chains.extend(frame, angle, reach, changed)
        if best is not None:
            jumped[frame] = angle[best] >= reach[best]
            onto[frame] = turned[best]
            aligned[frame] = matrices[frame] @ onto[frame]
            step = Rotation.from_matrix(rest[best].T @ aligned[frame])
            rate[frame] = 0 if jumped[frame] else step.as_rotvec() / apart[best]
    kept = chains.longest()
    onto[kept] = onto[kept] @ commonest(onto[kept]).T
    onto[~kept] = np.eye(3)
    return Chain(kept, onto, tuple(np.flatnonzero(kept & jumped).tolist()))


def possible_places(
    places: Float64[np.ndarray, "T 3"], limit: float, fps: float, lasting: float
) -> Bool[np.ndarray, " T"]:
    """The frames of the longest chain of a point's positions, metres; see `longest_chain`.

    The prediction is rest or constant velocity, within `limit` (metres, for one frame) times the
    square root of the number of frames. At the start of a chain, where the velocity is unknown, any
    speed up to `START_SPEED` is possible.
    """
    steps, at_start = np.diff(places, axis=0), max(limit, START_SPEED / fps)
    if np.linalg.norm(steps[:1]) < at_start and largest_bend(steps) < limit:
        return np.ones(len(places), dtype=bool)
    chains, rate = Chains(len(places), limit, lasting * fps), np.zeros((len(places), 3))
    for frame in range(1, len(places)):
        earlier = chains.earlier(frame)
        apart = frame - earlier
        moved = places[frame] - places[earlier]
        ahead = moved - rate[earlier] * apart[:, None]
        deviation = np.minimum(np.linalg.norm(moved, axis=1), np.linalg.norm(ahead, axis=1))
        reach = np.where(chains.before[earlier] < 0, at_start, limit) * np.sqrt(apart)
        best = chains.extend(frame, deviation, reach)
        if best is not None:
            rate[frame] = moved[best] / apart[best] if deviation[best] < reach[best] else 0
    return chains.longest()


def there_and_back(
    places: Float64[np.ndarray, "T 3"], leap: float, fps: float, lasting: float
) -> Bool[np.ndarray, " T"]:
    """Frames between a leap of a point and the leap back at most `lasting` seconds later, each of
    more than `leap` metres at 30 frames a second.

    A leap that is possible within a few frames is no fault for `possible_places`: these leaps are
    told by the calm before, between and after them.
    """
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    found = np.zeros(len(places), dtype=bool)
    leaps = np.flatnonzero(steps > leap * max(1.0, 30 / fps)).tolist()
    for leave, back in pairwise(leaps):
        apart = float(np.linalg.norm(places[back + 1] - places[leave]))
        if back - leave <= lasting * fps and is_there_and_back(apart, steps, leave, back):
            found[leave + 1 : back + 1] = True
    return found


def turned_there_and_back(
    rotations: Rotation, leap: float, fps: float, lasting: float
) -> Bool[np.ndarray, " T"]:
    """Frames between a sudden turn of more than `leap` radians and the turn back at most `lasting`
    seconds later; of turns to and fro, those of the rarer of the two orientations.

    A turn that is possible within a few frames is no fault for `longest_chain`, which then leaves
    out the frames beside it: these turns are told by the calm before, between and after them.
    """
    steps = np.linalg.norm(increments(rotations), axis=1)
    leaps = np.flatnonzero(steps > leap).tolist()
    groups = [leaps[:1]]  # leaps of which each leads back from where the one before led
    for leave, back in pairwise(leaps):
        apart = float((rotations[leave].inv() * rotations[back + 1]).magnitude())
        calm = np.where(steps > leap, 0.0, steps)
        calm[[leave, back]] = steps[[leave, back]]
        if back - leave <= lasting * fps and is_there_and_back(apart, calm, leave, back):
            groups[-1].append(back)
        else:
            groups.append([back])
    frames = np.arange(len(steps) + 1)
    found = np.zeros(len(frames), dtype=bool)
    for group in filter(None, groups):
        turned = np.searchsorted(group, frames) % 2 == 1
        rarer = turned if 2 * turned.sum() < len(frames) else ~turned
        found |= rarer & (frames > group[0]) & (frames <= group[-1])
    return found


def is_there_and_back(
    apart: float, steps: Float64[np.ndarray, " N"], leave: int, back: int
) -> bool:
    """Whether the steps after the frames `leave` and `back` lead away and back: both are larger
    than those around them, with which a track gets from the one side to the other, which are
    `apart`, in that time."""
    start = max(leave - COMPARED_STEPS, 0)
    around = np.delete(steps[start : back + 1 + COMPARED_STEPS], [leave - start, back - start])
    usual, leaps = around.max(initial=0.0), steps[[leave, back]]
    possible = apart <= min(leaps.mean(), usual * (back - leave + 1))
    return bool(possible and leaps.min() > CUT_RATIO * usual)


def largest_bend(steps: Float[np.ndarray, "N 3"]) -> float:
    """Largest change between consecutive steps, radians or metres. If it is below the limit, the
    longest chain keeps all frames."""
    return float(np.linalg.norm(np.diff(steps, axis=0), axis=1).max(initial=0))


class Chains:
    """Dynamic program: the value of the best chain to each frame, and its predecessor, or -1.

    A frame may follow any of the `lasting` frames before it. A jump costs `lasting / 2`, so two
    jumps cost as much as the value of `lasting` frames between them.
    """

    def __init__(self, count: int, limit: float, lasting: float):
        self.limit, self.lasting = limit, lasting
        self.value, self.before = np.zeros(count), np.full(count, -1)

    def earlier(self, frame: int) -> Int[np.ndarray, " N"]:
        """The possible predecessors of a frame."""
        return np.arange(max(0, frame - max(1, round(self.lasting))), frame)

    def extend(
        self,
        frame: int,
        deviation: Float64[np.ndarray, " N"],
        reach: Float64[np.ndarray, " N"],
        changed: Bool[np.ndarray, " N"] | bool = False,
    ) -> int | None:
        """Append a frame to the best earlier chain, if that is better than to start a new one.

        `deviation` is that from the prediction after each earlier frame, a jump from `reach` on;
        `changed` is whether the symmetry rotation changes. Returns the index among the earlier
        frames; None if a new chain starts.
        """
        earlier = self.earlier(frame)
        worth = self.value[earlier] + 1 - SKIPPED * (frame - earlier - 1)
        worth -= USED_SYMMETRY * np.asarray(changed)
        worth -= np.where(deviation < reach, TURNED * deviation / self.limit, self.lasting / 2)
        best = int(worth.argmax())
        if worth[best] <= self.value[frame]:
            return None
        self.value[frame], self.before[frame] = worth[best], earlier[best]
        return best

    def longest(self) -> Bool[np.ndarray, " T"]:
        """Mask of the frames of the best chain."""
        kept = np.zeros(len(self.value), dtype=bool)
        frame = int(self.value.argmax())
        while frame >= 0:
            kept[frame], frame = True, int(self.before[frame])
        return kept


def nearest_turn(
    matrix: Float64[np.ndarray, "3 3"],
    expected: tuple[Float64[np.ndarray, "N 3 3"], Float64[np.ndarray, "N 3 3"]],
    carried: Float64[np.ndarray, "N 3 3"],
    reach: Float64[np.ndarray, " N"],
    symmetry: Symmetry,
) -> tuple[Float64[np.ndarray, " N"], Bool[np.ndarray, " N"], Float64[np.ndarray, "N 3 3"]]:
    """Compare a rotation with the two predictions (rest, constant velocity) after N earlier frames.

    Returns the least angle to a prediction, radians; whether another symmetry rotation than
    `carried` was needed to come within `reach`; and the symmetry rotation that was applied."""
    plain = np.minimum(*(angles(turn, matrix @ carried) for turn in expected))
    other, least = symmetry.nearest(matrix, expected[0])
    changed = (plain >= reach) & (least < reach)
    onto = np.where(changed[:, None, None], other, carried)
    return np.where(changed, least, plain), changed, onto


def angles(
    one: Float64[np.ndarray, "N 3 3"], other: Float64[np.ndarray, "N 3 3"]
) -> Float64[np.ndarray, " N"]:
    """Angles between rotations, radians."""
    return np.arccos(((np.einsum("nij,nij->n", one, other) - 1) / 2).clip(-1, 1))


def commonest(rotations: Float64[np.ndarray, "N 3 3"]) -> Float64[np.ndarray, "3 3"]:
    """The most frequent rotation, up to rounding: poses with it are left unchanged."""
    _, first, count = np.unique(
        rotations.round(3).reshape(-1, 9) + 0.0, axis=0, return_index=True, return_counts=True
    )
    return rotations[first[count.argmax()]]
