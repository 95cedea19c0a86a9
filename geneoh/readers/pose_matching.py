"""Poses of an object or a camera, and how they are matched with the frames of a hand."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from geneoh.choices import Unit
from geneoh.errors import InputError, numbered
from geneoh.geometry.mesh import Mesh
from geneoh.readers.clock import EVEN, GAP_FRAMES, Clock
from geneoh.readers.records import Array, Notes, Record, float32
from geneoh.readers.transforms import refuse_other_matrices
from geneoh.sequence.gaps import unset
from geneoh.sequence.sequence import ObjectTrack


@dataclass(frozen=True)
class PoseTrack:
    """The caller's poses over time, with frame numbers or times: of the object, to the hand's
    frame, or of the camera, to the world."""

    matrices: Array
    """(T, 4, 4) or (T, Q, 4, 4), NaN where it was lost."""
    number: int | None = None
    """Frame number of the first pose, where it is known."""
    times: Array | None = None
    """(T,) seconds, where they are known."""
    unit: Unit | None = None
    """Unit of the lengths, where the format fixes it; the caller's where it does not."""
    owner: str = "object"
    """What has the poses, in messages."""

    @property
    def first(self) -> int:
        """Frame number of the first pose, 0 where it is unknown."""
        return self.number or 0

    def without_unset(self, meshes: Iterable[Mesh]) -> "PoseTrack":
        """The poses of an object, with NaN in place of those that were never set (`unset`).

        Interpolated between times, or in another frame, they would look like any others.
        """
        parts = self.matrices.reshape(len(self.matrices), -1, 4, 4)
        rotation, translation = float32(parts[..., :3, :3]), float32(parts[..., :3, 3])
        lost = unset(ObjectTrack(tuple(meshes), rotation, translation)).numpy()
        return replace(self, matrices=np.where(lost[..., None, None], np.nan, parts))

    def of_frames(
        self, frames: int, where: str, clock: Clock | None, first: int = 0
    ) -> tuple[Array, Notes]:
        """The poses at a hand's frames, the first of which has the number `first`, and notes.

        They are matched by timestamps if both have them. Else there is one pose per frame, a single
        pose for all frames, or those of a whole video, which are matched by frame number; numbered
        poses may lack the first and the last frames. `InputError` for times that do not overlap,
        and for a number of poses that fits none of these cases.
        """
        if len(self.matrices) == 1 < frames:
            about = (
                f"the {self.owner}'s one pose was taken for all frames, in which it does not move"
            )
            return np.repeat(self.matrices, frames, axis=0), (about,)
        if self.times is not None and clock is not None and clock.is_of_times:
            return self.at_times(clock.values, where)
        if len(self.matrices) == frames:
            return self.matrices, self._about_one_each(clock, first)
        if (found := self._by_number(frames, clock, first)) is not None:
            return found
        raise self._other_number(frames, where, clock, first)

    def _by_number(
        self, frames: int, clock: Clock | None, first: int
    ) -> tuple[Array, Notes] | None:
        """The poses that have the numbers of the hand's frames, and a note.

        None unless all of these frames have one, or all numbered poses are of these frames.
        """
        rows, is_timed = first - self.first + np.arange(frames), False
        if clock is not None and not (is_timed := clock.is_of_times):
            rows = np.rint(clock.values).astype(int) - self.first
        known = (rows >= 0) & (rows < len(self.matrices))
        is_part = (first or rows[-1] >= frames) and known.all()
        is_whole = self.number is not None and known.sum() == len(self.matrices) and not is_timed
        if not (is_part or is_whole):
            return None
        poses = np.full((frames, *self.matrices.shape[1:]), np.nan)
        poses[known] = self.matrices[rows[known]]
        own = f"{self.first} to {self.first + len(self.matrices) - 1}"
        start, stop = rows[[0, -1]] + self.first
        if is_part:
            count = len(self.matrices)
            which = f"of the {self.owner}'s {count} poses those of frames {start} to {stop}"
            which += ", counted from 0" * (self.number is None)
        else:
            which = f"the {self.owner}'s poses are of frames {own}, the hand of {start} to {stop}"
        return poses, (which,)

    def _about_one_each(self, clock: Clock | None, first: int) -> Notes:
        """A note where poses are taken one for each frame although times or numbers are known."""
        number = first if clock is None else round(clock.values[0])
        is_numbered = clock is not None or first > 0
        if clock is not None and clock.is_of_times:
            known = f"the hand has times and the {self.owner}'s poses none"
        elif self.times is not None:
            known = f"the {self.owner}'s poses have times and the hand none"
        elif self.first and is_numbered and number != self.first:
            known = (
                f"the {self.owner}'s poses begin with frame {self.first} and the hand with {number}"
            )
        else:
            return ()
        return (f"{known}: taken one for each frame",)

    def _other_number(self, frames: int, where: str, clock: Clock | None, first: int) -> InputError:
        """The error for a number of poses that does not fit the frames."""
        which = f", which are numbers {first} to {first + frames - 1}," if first else ","
        got = f"{len(self.matrices)}" + (f" from number {self.first} on" if self.first else "")
        cure = "cut them to the same frames"
        if len(self.matrices) < frames and self.owner == "object":
            cure += ", or write NaN for the first or last ones where the object was not found"
        if self.times is not None:
            cure += ", or save the times of the hand's frames, too, as 'timestamps'"
        elif clock is not None and clock.is_of_times:
            cure += ", or save the times of the poses, too, as numbers in a column 'timestamp'"
        return InputError(
            f"{where}: the {self.owner}'s poses must be one for each of the {frames} frames{which} "
            f"got {got}; {cure}"
        )

    def at_times(self, seconds: Array, where: str) -> tuple[Array, Notes]:
        """The poses at (N,) times, interpolated between near ones, NaN where none is near."""
        assert self.times is not None
        parts = self.matrices.reshape(len(self.times), -1, 4, 4)
        record = Record(where, {}, f"correct the {self.owner}'s poses")
        refuse_other_matrices(record, f"{self.owner}_pose", parts[..., :3, :3])
        found = [pose_at(seconds, self.times, parts[:, part]) for part in range(parts.shape[1])]
        poses = np.stack(found, axis=1).reshape(len(seconds), *self.matrices.shape[1:])
        lost = np.isnan(poses).any(tuple(range(1, poses.ndim)))
        if lost.all():
            raise InputError(
                f"{where}: the {self.owner}'s poses must be of the times of the hand, "
                f"{seconds[0]:.12g} to {seconds[-1]:.12g} s, got {self.times[0]:.12g} to "
                f"{self.times[-1]:.12g} s; write both by one clock"
            )
        if len(seconds) == len(self.times) and np.allclose(seconds, self.times, 0, 1e-6):
            return poses, ()
        words = f"the {self.owner}'s {len(self.times)} poses were brought to the times of the hand"
        gaps = f", none of them near {numbered(int(lost.sum()), 'frame')}"
        return poses, (words + gaps * bool(lost.any()),)


def pose_at(seconds: Array, times: Array, poses: Array) -> Array:
    """(N, 4, 4) poses of one part at (N,) times, interpolated from (T, 4, 4) at (T,) times."""
    usual = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    known = np.isfinite(poses).all((-1, -2))
    times, poses = times[known], poses[known]
    result = np.full((len(seconds), 4, 4), np.nan)
    if not len(times):
        return result
    after = np.searchsorted(times, seconds).clip(max=len(times) - 1)
    before = (np.searchsorted(times, seconds, "right") - 1).clip(min=0)
    apart = np.minimum(np.abs(times[after] - seconds), np.abs(times[before] - seconds))
    between = (times[before] <= seconds) & (seconds <= times[after])
    seen = (apart <= EVEN * usual) | (
        between & (times[after] - times[before] <= GAP_FRAMES * usual)
    )
    at = seconds[seen].clip(times[0], times[-1])
    turns = Rotation.from_matrix(poses[:, :3, :3])
    result[seen, :3, :3] = (Slerp(times, turns)(at) if len(times) > 1 else turns).as_matrix()
    for axis in range(3):
        result[seen, axis, 3] = np.interp(at, times, poses[:, axis, 3])
    result[seen, 3] = [0.0, 0.0, 0.0, 1.0]
    return result
