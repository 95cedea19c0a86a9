"""Which frames of a pose track agree with one another: jumps and flips are left out or undone."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Float64, Int
from scipy.spatial.transform import Rotation

from geneoh.objects.smoothing import increments
from geneoh.objects.symmetry import Symmetry

SKIPPED, TURNED, USED_SYMMETRY = 0.02, 0.3, 0.25
"""What a chain pays for each frame that it skips, for a turn as large as the limit, and for each
change of the rotation of the mesh onto itself; each frame that it keeps is worth one."""
MOST = 2 / 3  # share of the kept frames from which on a stretch between jumps is taken as right
START_SPEED = 4.0  # up to which a track may begin in the middle of a motion, metres per second


@dataclass(frozen=True)
class Chain:
    """The frames of a track that follow from one another by possible motion."""

    kept: Bool[np.ndarray, " T"]
    onto_itself: Float64[np.ndarray, "T 3 3"]
    """Rotation of the mesh onto itself by which each kept frame agrees with the one before."""
    jumps: tuple[int, ...]  # kept frames that no possible motion reaches from the kept frame before

    def stretches(self) -> list[slice]:
        """The frames from each jump to the next."""
        edges = [0, *self.jumps, len(self.kept)]
        return [slice(start, stop) for start, stop in pairwise(edges)]

    @property
    def doubted(self) -> Bool[np.ndarray, " T"]:
        """The frames beside jumps that may be wrong: all but those of a stretch with most frames.

        No motion leads over a jump, so one side of it is wrong, and nothing tells which.
        """
        found = np.full(len(self.kept), bool(self.jumps))
        for stretch in self.stretches():
            if self.kept[stretch].sum() >= MOST * self.kept.sum():
                found[stretch] = False
        return found


def longest_chain(
    rotations: Rotation, limit: float, symmetry: Symmetry, fps: float, lasting: float
) -> Chain:
    """The chain of frames that keeps most of them and jumps least, by dynamic programming.

    From one frame of the chain to the next the part rests or keeps turning as before, each up to
    `limit` times the root of their distance, if need be after a rotation of the mesh onto itself;
    any other step is a jump. Fast motion is therefore no jump, as long as its speed grows over
    several frames. `limit` is in radians, of turns from one frame to the next. An orientation that
    no motion reaches is left out if it is given up within `lasting` seconds, else it is kept.
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
        # the track as it is, if the frames before needed no other change
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
    """The frames of the `longest_chain` of a point's places, metres; `lasting` as there.

    From one frame to the next the point rests or moves on as before, each up to `limit` times the
    root of their distance; at the start of the chain, where nothing tells how it moved before, it
    may have any speed up to `START_SPEED`.
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
        off = np.minimum(np.linalg.norm(moved, axis=1), np.linalg.norm(ahead, axis=1))
        reach = np.where(chains.before[earlier] < 0, at_start, limit) * np.sqrt(apart)
        best = chains.extend(frame, off, reach)
        if best is not None:
            rate[frame] = moved[best] / apart[best] if off[best] < reach[best] else 0
    return chains.longest()


def largest_bend(steps: Float[np.ndarray, "N 3"]) -> float:
    """How much a step differs most from the one before, radians or metres. Where that is less than
    the limit, a chain keeps all frames: to leave one out would only cost what it is worth."""
    return float(np.linalg.norm(np.diff(steps, axis=0), axis=1).max(initial=0))


class Chains:
    """What the best chain to each frame is worth, and the frame before it there, or -1.

    A frame may be reached from `lasting` frames before it, and a jump costs half as many frames:
    two jumps cost what is between them if that lasts so long.
    """

    def __init__(self, count: int, limit: float, lasting: float):
        self.limit, self.lasting = limit, lasting
        self.value, self.before = np.zeros(count), np.full(count, -1)

    def earlier(self, frame: int) -> Int[np.ndarray, " N"]:
        """The frames from which one may be reached."""
        return np.arange(max(0, frame - max(1, round(self.lasting))), frame)

    def extend(
        self,
        frame: int,
        off: Float64[np.ndarray, " N"],
        reach: Float64[np.ndarray, " N"],
        changed: Bool[np.ndarray, " N"] | bool = False,
    ) -> int | None:
        """Reach a frame from the best of the earlier ones, if that is worth more than to begin.

        `off` is how far it is from where it is expected after each of them, which is a jump from
        `reach` on; `changed` whether the rotation of the mesh onto itself changes. Returns the
        index among the earlier ones; None for none.
        """
        earlier = self.earlier(frame)
        worth = self.value[earlier] + 1 - SKIPPED * (frame - earlier - 1)
        worth -= USED_SYMMETRY * np.asarray(changed)
        worth -= np.where(off < reach, TURNED * off / self.limit, self.lasting / 2)
        best = int(worth.argmax())
        if worth[best] <= self.value[frame]:
            return None
        self.value[frame], self.before[frame] = worth[best], earlier[best]
        return best

    def longest(self) -> Bool[np.ndarray, " T"]:
        """The frames of the chain that is worth most."""
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
    """How far a rotation is from resting and from turning on, after a rotation onto itself,
    radians; whether a new one of these was needed to come within `reach`; and that rotation onto
    itself."""
    plain = np.minimum(*(angles(turn, matrix @ carried) for turn in expected))
    other, least = symmetry.nearest(matrix, expected[0])
    changed = (plain >= reach) & (least < reach)
    onto = np.where(changed[:, None, None], other, carried)
    return np.where(changed, least, plain), changed, onto


def angles(
    one: Float64[np.ndarray, "N 3 3"], other: Float64[np.ndarray, "N 3 3"]
) -> Float64[np.ndarray, " N"]:
    """Radians between rotations."""
    return np.arccos(((np.einsum("nij,nij->n", one, other) - 1) / 2).clip(-1, 1))


def commonest(rotations: Float64[np.ndarray, "N 3 3"]) -> Float64[np.ndarray, "3 3"]:
    """The rotation that occurs most often: what it stands for is left as the track has it."""
    _, first, count = np.unique(
        rotations.round(3).reshape(-1, 9) + 0.0, axis=0, return_index=True, return_counts=True
    )
    return rotations[first[count.argmax()]]
