"""When the frames of a file were taken, from its timestamps or frame numbers.

Dropped or unevenly spaced frames must not be taken for evenly spaced ones: a hand would seem to
jump, or to move faster than it does.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from jaxtyping import Bool
from torch import Tensor

from geneoh.bundle import FRAMES
from geneoh.errors import InputError
from geneoh.readers.column_names import words_of
from geneoh.readers.records import Array, Notes, Record
from geneoh.sequence.resample import MOST_FRAMES, at_times
from geneoh.sequence.sequence import HandTrack, Sequence

FRAME_NAMES = ("frame", "frames", "frame_id", "frame_ids", "frame_idx", "frame_index")
FRAME_NAMES += ("frame_indices", "frame_number", "frame_numbers")
"""Fields that number the frames."""
UNITS = {"s": 1.0, "sec": 1.0, "seconds": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
STAMPS = ("time", "times", "timestamp", "timestamps", "stamp", "stamps")
TIME_NAMES = dict.fromkeys(STAMPS) | {
    f"{name}_{unit}": seconds
    for name in (*STAMPS, "tracking_timestamp")
    for unit, seconds in UNITS.items()
}
"""Names of timestamp fields, each with its unit in seconds, or None where the name has no unit."""
CLOCK_NAMES = (*TIME_NAMES, *FRAME_NAMES)
RATE_NAMES = ("fps", "frame_rate", "framerate", "mocap_frame_rate", "mocap_framerate")
"""Names of a frame rate, in the order of priority; case does not matter."""
ASSUMED_FPS = 30.0
"""Frame rate that is assumed, with a note, for a file without one: the most common rate."""
SLOWEST, FASTEST = 4.9, 260.0
"""Range of frame rates, from which the unit of timestamps without a unit in their name follows: 5
to 240, also by the median step of times that are rounded to milliseconds."""
EVEN = 0.1
"""Deviation in frames up to which frames are evenly spaced: cameras round, and milliseconds do."""
GAP_FRAMES = 1.5
"""Largest gap in frames between two frames across which values are interpolated."""
USUAL_STEPS = 0.6, 1.8
"""Bounds on the median step of uneven frames, in frames of the stated rate."""
SAME_RATE, OTHER_RATE = 0.01, 0.15
"""Relative differences of a stated frame rate from that of the timestamps: up to the first the two
agree, from the second on they contradict each other."""


@dataclass(frozen=True)
class Clock:
    """The times of T frames."""

    name: str
    """The field that they come from."""
    at: Array
    """(T,) times since the first frame, in frames: steps of about 1 where none was dropped."""
    fps: float | None
    """Rate of the evenly spaced frames; None where the clock comes from frame numbers."""
    values: Array
    """(T,) the file's own values: seconds, or frame numbers."""
    stride: float = 1.0
    """Usual step from one frame number to the next."""

    @property
    def is_of_times(self) -> bool:
        """Whether the clock comes from timestamps, and not from frame numbers."""
        return self.name in TIME_NAMES

    @property
    def instants(self) -> Array:
        """(T,) `at`, rounded to whole frames if the frames are evenly spaced apart from gaps."""
        whole = np.rint(self.at)
        return whole if np.abs(self.at - whole).max() < EVEN else self.at

    @property
    def observed(self) -> Array:
        """(N,) mask of the grid frames that are near a frame of the file, or between near ones."""
        at, grid = self.instants, self.grid
        before = at[np.searchsorted(at, grid, "right") - 1]
        after = at[np.searchsorted(at, grid).clip(max=len(at) - 1)]
        nearest = np.minimum(grid - before, np.abs(after - grid))
        return (nearest <= 0.5) | (after - before <= GAP_FRAMES)

    @property
    def grid(self) -> Array:
        """(N,) the evenly spaced frames, counted from the first one."""
        return np.arange(round(self.at[-1]) + 1)

    @property
    def notes(self) -> Notes:
        """Notes for the user on dropped or uneven frames."""
        notes, seen = [], self.observed
        if lost := int((~seen).sum()):
            notes.append(f"{lost} of {len(seen)} frames are left out by '{self.name}'")
        if self.instants is self.at:
            notes.append(f"the frames are not even by '{self.name}' and were interpolated")
        if self.stride != 1:
            notes.append(
                f"by '{self.name}' the file holds one frame in {self.stride:g}, and the frame rate "
                "counts all of them"
            )
        return tuple(notes)

    def even(self, sequence: Sequence) -> tuple[Sequence, Array]:
        """The sequence resampled to `grid`, NaN where unobserved, and the nearest old frames."""
        at, grid, seen = self.instants, self.grid, torch.from_numpy(self.observed)
        if len(at) == len(grid) and bool((at == grid).all()):
            return sequence, grid
        rows = np.interp(grid, at, np.arange(len(at)))
        found = at_times(sequence, torch.from_numpy(rows))
        hands = tuple(observed_in(hand, hand.valid & seen) for hand in found.hands)
        motion = found.object
        if not bool(seen.all()):
            motion = replace(motion, valid=seen[:, None] & motion.observed)
        return replace(found, hands=hands, object=motion), np.rint(rows).astype(int)


def observed_in(hand: HandTrack, valid: Bool[Tensor, " T"]) -> HandTrack:
    """The track with NaN in all frames outside the mask `valid`."""

    def masked(values: Tensor) -> Tensor:
        lost = ~valid.view(-1, *[1] * (values.ndim - 1))
        return values.masked_fill(lost, torch.nan) if values.is_floating_point() else valid

    # the ray of the camera is known in frames without a hand, too
    return replace(hand.map(masked, FRAMES), camera_ray=hand.camera_ray)


def rate_of(stored: float | None, given: float | None, where: str) -> tuple[float, Notes]:
    """Frame rate of the file, else of the caller, else assumed with a note; both must agree."""
    if stored is not None and given is not None and stored != given:
        raise InputError(
            f"{where}: the file says {stored:g} frames a second, got --fps {given:g}; drop one of "
            "the two"
        )
    rate = stored if given is None else given
    if rate is not None:
        return rate, ()
    return ASSUMED_FPS, (f"{ASSUMED_FPS:g} frames a second assumed; --fps says otherwise",)


def timing_of(
    record: Record, frames: int, given: float | None
) -> tuple[float, Clock | None, Notes]:
    """Frame rate by file or caller, the clock if the file has one, and notes for the user."""
    record = replace(record, values=dict(record.values) | dates_in(record))
    name = next(iter(rate_fields(record.values)), "fps")
    stored = record.optional_number(name, "save it as fps=30.0")
    known = given if stored is None else stored
    clock = clock_of(record, frames, known)
    about = unread_times(record, frames) if clock is None else clock.notes
    if known is None and clock is not None and clock.fps is not None:
        return clock.fps, clock, about
    rate, notes = rate_of(stored, given, record.where)
    if clock is not None:
        rate = rate / clock.stride if clock.fps is None else clock.fps
    return rate, clock, (*about, *notes)


def rate_fields(names: Iterable[Any]) -> list[str]:
    """The names that are those of a frame rate, by priority."""
    found = {"_".join(words_of(name)): name for name in map(str, names)}
    return [found[name] for name in RATE_NAMES if name in found]


def dates_in(record: Record) -> dict[str, Array]:
    """Timestamps stored as dates or durations of numpy, as numbers since the first one."""
    found = {}
    for name, unit in TIME_NAMES.items():
        value = record.values.get(name)
        if isinstance(value, Array) and value.dtype.kind in "mM" and value.size:
            found[name] = (value - value.flat[0]) / np.timedelta64(1, "s") / (unit or 1.0)
    return found


def clock_of(record: Record, frames: int, known: float | None) -> Clock | None:
    """The clock from a file's timestamps or else frame numbers; `known` is the known frame rate."""
    columns = (name for name in CLOCK_NAMES if is_column(record.values.get(name), frames))
    name = next(columns, None) if frames > 1 else None
    if name is None:
        return None
    clock = clock_from(record, name, known)
    # at a high rate an hour has more frames; a wrong time must not fill the memory with gaps
    if not clock.at[-1] < (most := max(MOST_FRAMES, 2 * frames)):
        expected = f"less than {most} frames from first to last"
        raise record.refuse(name, expected, "cut the recording")
    return clock


def unread_times(record: Record, frames: int) -> Notes:
    """Notes on fields of times that were skipped because they are not one number per frame."""
    return tuple(
        f"'{name}' is not one number a frame and was not read"
        for name in CLOCK_NAMES
        if frames > 1 and length_of(record.values.get(name)) > 1
    )


def length_of(value: Any) -> int:
    """Number of entries of a list or an array; 0 for anything else."""
    return len(value) if isinstance(value, list) or (isinstance(value, Array) and value.ndim) else 0


def is_column(value: Any, frames: int) -> bool:
    """Whether a field holds one number for each frame."""
    if isinstance(value, list | tuple):
        return len(value) == frames and all(isinstance(each, int | float) for each in value)
    return isinstance(value, Array) and value.shape == (frames,) and value.dtype.kind in "fiu"


def clock_from(record: Record, name: str, known: float | None) -> Clock:
    """The clock from one field, whose values must increase; `known` is the known frame rate."""
    values = record.numbers(name)
    if len(wrong := np.flatnonzero(~(np.diff(values) > 0) | ~np.isfinite(values[1:]))):
        before, after = (f"{value:.15g}" for value in values[wrong[0] : wrong[0] + 2])
        raise InputError(
            f"{record.where}: '{name}' must be numbers that rise from frame to frame, got {after} "
            f"after {before} in frame {wrong[0] + 1}; {remedy_of(record, name)}"
        )
    stored, values = values, values - values[0]
    if name in TIME_NAMES:
        unit = TIME_NAMES[name] or unit_by_steps(np.diff(values), SLOWEST, FASTEST)
        if unit is None:
            cure = f"call the field '{name}_s', '{name}_ms', '{name}_us' or '{name}_ns'"
            raise record.refuse(name, "times in a unit that their steps tell", cure)
        return replace(clock_of_times(record, name, values * unit, known), values=stored * unit)
    stride, _ = usual_step(values)
    return Clock(name, values / stride, None, stored, stride)


def remedy_of(record: Record, name: str) -> str:
    """Remedy for timestamps or frame numbers that do not increase."""
    value = record.values[name]
    if isinstance(value, Array) and value.dtype == np.float32:
        steps, digit = np.diff(value.astype(np.float64)), np.spacing(np.nanmax(np.abs(value)))
        if np.nanmean(np.abs(steps)) < digit / EVEN:
            return "float32 has too few digits for them: save them as float64 or as integers"
    return (
        "leave out the frames that have none or that of the one before, cut the recording where "
        "they start again, or leave the field out"
    )


def clock_of_times(record: Record, name: str, seconds: Array, rate: float | None) -> Clock:
    """The clock of (T,) seconds from the first frame; `InputError` if the known `rate` differs."""
    step, multiples = usual_step(seconds)
    own = float(round(1 / step)) if abs(round(1 / step) * step - 1) < SAME_RATE else 1 / step
    rate = own if rate is None else rate
    difference = abs(rate / own - 1)
    if difference >= SAME_RATE and not may_be_rate(seconds, rate, multiples):
        if not (multiples and difference < OTHER_RATE):
            raise InputError(
                f"{record.where}: '{name}' says {own:.4g} frames a second, got {rate:g} as the "
                "frame rate; drop the wrong one of the two"
            )
        rate = own
    at = seconds / step if multiples and (rate == own or difference < SAME_RATE) else seconds * rate
    return Clock(name, at, rate, seconds)


def may_be_rate(seconds: Array, rate: float, multiples: bool) -> bool:
    """Whether (T,) seconds may be uneven frames of `rate`; `multiples` of another step must also
    lie near whole frames of it."""
    frames = seconds * rate
    usual, misfit = np.median(np.diff(frames)), np.abs(frames - np.rint(frames)).mean()
    near = not multiples or bool(misfit < 2 * EVEN)
    return bool(USUAL_STEPS[0] < usual < USUAL_STEPS[1]) and near


def unit_by_steps(steps: Array, slowest: float, fastest: float) -> float | None:
    """Unit in seconds in which the median step means `slowest` to `fastest` a second, if any."""
    rates = ((unit, 1 / (float(np.median(steps)) * unit)) for unit in UNITS.values())
    return next((unit for unit, rate in rates if slowest <= rate <= fastest), None)


def usual_step(values: Array) -> tuple[float, bool]:
    """The usual step of (T,) values that rise from 0, and whether they are multiples of it."""
    steps = np.diff(values)
    found = []
    for step in np.quantile(steps, [0.5, 0.25, 0.1], method="lower").tolist():
        for _ in range(3):  # refined, because a quantile of uneven steps may be too short
            step = float(steps.sum() / np.rint(steps / step).clip(min=1).sum())
        found.append((float(np.abs(values / step - np.rint(values / step)).mean()), step))
    misfit, step = min(found)
    if misfit < EVEN:
        return step, True
    return float(steps[steps <= GAP_FRAMES * np.median(steps)].mean()), False
