"""`geneoh denoise --stream`: frames as JSON lines or msgpack in, clean ones out, as they come."""

import dataclasses
import json
import logging
import sys
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import click
import msgpack
import numpy as np

from geneoh.choices import SIDES, Side
from geneoh.errors import InputError, numbered
from geneoh.geometry.mesh_files import meshes_of
from geneoh.pipeline.options import Options
from geneoh.pipeline.streaming.first_look import SECONDS
from geneoh.pipeline.streaming.frame_reader import FOUND
from geneoh.pipeline.streaming.stream import CleanFrame, Stream
from geneoh.readers.clock import ASSUMED_FPS, CLOCK_NAMES, clock_of
from geneoh.readers.npz.files import hand_arrays
from geneoh.readers.npz.layouts import (
    CAMERA_FIELDS,
    CAMERA_POSES,
    FORMAT,
    HAND_FIELDS,
    misspelt_fields,
)
from geneoh.readers.records import Record

from . import options
from .frame_input import Fields, frames_in

LOG = logging.getLogger(__name__)

DECIMALS = 6
"""Decimals of the numbers that are written: micrometres and microradians."""


def clean_stream(obj: tuple[Path, ...], mano: Path | None, chosen: dict[str, Any]) -> None:
    """`geneoh denoise --stream` with the options of the command.

    Raises:
        UsageError: an option is given that a stream does not have.
        GeneOHError: options, a mesh or weights that cannot be used, or frames; see `clean_frames`.
    """
    given = options.on_command_line()
    settings = {field.name for field in dataclasses.fields(Options)} | {"lag", "fps"}
    taken = settings | {"stream", "obj", "unit", "mano", "side"}
    if wrong := [option for name, option in given.items() if name not in taken]:
        raise click.UsageError(
            f"--stream reads standard input and writes standard output; drop {', '.join(wrong)}"
        )
    options.refuse_unit_without(obj)
    meshes = meshes_of(obj, chosen["unit"])
    kept = {n: chosen[n] for n in given.keys() & settings}  # others have the defaults of `Stream`

    def begin(**about: Any) -> Stream:
        return Stream(meshes, mano_dir=mano, **about, **kept)

    side = chosen["side"]
    # fail before the first frame; a hand model is checked later if that frame decides its side
    known = kept if side else {n: value for n, value in kept.items() if n != "hand"}
    Stream(meshes, mano_dir=mano, side=side or "right", **known)
    clean_frames(*ends(), begin, side, kept.get("fps", ASSUMED_FPS))


def ends() -> tuple[BinaryIO, BinaryIO]:
    """The binary streams that frames are read from and written to."""
    return sys.stdin.buffer, sys.stdout.buffer


@contextmanager
def without_echoes() -> Iterator[None]:
    """Log once what the streams of two hands both say of their object."""
    said: set[str] = set()

    def is_new(record: logging.LogRecord) -> bool:
        words = record.getMessage()
        return not (words in said or said.add(words))

    log = logging.getLogger(Stream.__module__)
    log.addFilter(is_new)
    try:
        yield
    finally:
        log.removeFilter(is_new)


@without_echoes()
def clean_frames(
    source: BinaryIO, sink: BinaryIO, begin: Callable[..., Stream], side: Side | None, fps: float
) -> None:
    """Clean the frames of `source` and write each to `sink` as soon as its result is available.

    Frames are JSON lines or consecutive msgpack maps, with the fields of the file format for one
    frame, at the frame rate `fps`. `begin` makes the stream of one hand, from `side`, `betas` and
    `hand_model`. Without `side`, the hands that the first frame names are cleaned.

    Raises:
        InputError: a frame cannot be read, which the message names; or there is no frame.
    """
    streams: dict[Side, Stream] = {}
    poses: deque[Fields] = deque()
    packed, frames = frames_in(source)

    def write(frames: dict[Side, CleanFrame]) -> None:
        fields = _fields_of(frames, poses.popleft())
        if packed:
            msgpack.pack(fields, sink)
        else:
            sink.write(json.dumps(fields, separators=(",", ":")).encode() + b"\n")
        sink.flush()

    for where, fields in watched(frames, side, fps):
        if not streams:
            streams = {
                side: begin(
                    side=side,
                    betas=fields.get(f"{side}_betas"),
                    hand_model=fields.get("hand_model"),
                    source=where.rsplit(",", 1)[0],
                )
                for side in sides_in(fields, side, where)
            }
        poses.append({name: value for name, value in fields.items() if name in KEPT_FIELDS})
        made: dict[Side, CleanFrame] = {}
        for each, stream in streams.items():
            frame = stream.push(
                hand_in(fields, each),
                pose_in(fields, where),
                camera_to_world=fields.get(CAMERA_POSES),
                where=where,
            )
            if frame is not None:
                made[each] = frame
        if made:
            write(made)
    if not streams:
        raise InputError(
            "standard input: expected the frames of a hand, one JSON object a line or one msgpack "
            "map after the other, got none; pipe a tracker's frames in"
        )
    for left in zip(*(stream.flush() for stream in streams.values()), strict=True):
        write(dict(zip(streams, left, strict=True)))


POSE_FIELDS = ("object_rotation", "object_translation", "obj_pose")
"""The object's pose in a line: the first two, or the third."""
KEPT_FIELDS = (*POSE_FIELDS, CAMERA_POSES)
"""Fields of a line that are written as they came."""


def watched(
    frames: Iterator[tuple[str, Fields]], side: Side | None, fps: float
) -> Iterator[tuple[str, Fields]]:
    """Yield the same frames, and log warnings: for fields of the first frame that look misspelt,
    for a hand that it does not name, and for times or frame numbers of the first seconds that
    contradict a constant frame rate `fps`.
    """
    expected: set[Side] = set() if side is None else set(SIDES)
    first: list[Fields] = []
    wanted = round(SECONDS * fps)
    for number, (where, fields) in enumerate(frames):
        if number == 0:
            expected |= {*named_in(fields, SIDES)}
            for words in unread(fields, where):
                LOG.warning("%s: %s", where, words)
        for late in SIDES:
            if late in expected or not hand_in(fields, late):
                continue
            expected.add(late)
            LOG.warning(
                "%s: the %s hand is left out, which the first frame does not name; name it there, "
                "null where it is lost",
                where,
                late,
            )
        if len(first) < wanted:
            first.append(fields)
            if len(first) == wanted:
                warn_of_times(first, fps)
        yield where, fields
    if 0 < len(first) < wanted:
        warn_of_times(first, fps)


def unread(fields: Fields, where: str) -> Iterator[str]:
    """Warnings for fields of a frame that are not read although they are meant to be."""
    yield from misspelt_fields(Record(where, fields), FORMAT)
    if CAMERA_FIELDS[1] in fields:
        yield "'camera_position' is not read in a stream; give the direction camera_ray"


def warn_of_times(frames: list[Fields], fps: float) -> None:
    """Log a warning where times or numbers of frames contradict a constant frame rate `fps`."""
    stamps = {
        name: [each.get(name) for each in frames] for name in CLOCK_NAMES if name in frames[0]
    }
    try:
        clock = clock_of(Record("standard input", stamps, "correct it"), len(frames), fps)
    except InputError as error:
        LOG.warning("%s", error)
        return
    if clock is not None and (lost := int((~clock.observed).sum())):
        LOG.warning(
            "standard input: '%s' leaves out %s of the first %g seconds, and a stream takes all as "
            "evenly apart; give one without hands for each that the tracker dropped",
            clock.name,
            numbered(lost, "frame"),
            SECONDS,
        )


def sides_in(fields: Fields, chosen: Side | None, where: str) -> list[Side]:
    """The sides to clean: all that the first frame names, even as null, or `chosen` alone."""
    found = named_in(fields, SIDES if chosen is None else (chosen,))
    if not found:
        cure = "add one" if chosen is None else f"add one, or correct --side {chosen}"
        raise InputError(
            f"{where}: the first frame must name its hands by fields such as "
            f"'{chosen or 'right'}_joints', null where a hand is lost, got "
            f"{', '.join(map(repr, [*fields][:10])) or 'none'}; {cure}"
        )
    return found


def named_in(fields: Fields, sides: Sequence[Side]) -> list[Side]:
    """The sides of which a frame names a field that places the hand, even as null."""
    return [side for side in sides if any(f"{side}_{name}" in fields for name in FOUND)]


def hand_in(fields: Fields, side: Side) -> Fields | None:
    """The fields of a hand without the side in their names, None for those that are null or not
    there; None where all are."""
    names = {name: fields.get(f"{side}_{name}") for name in HAND_FIELDS if name != "betas"}
    found = {name: None if is_null(value) else value for name, value in names.items()}
    if all(value is None for value in found.values()):
        return None
    ray = fields.get(CAMERA_FIELDS[0])
    if found["camera_ray"] is None and not is_null(ray):
        found["camera_ray"] = ray
    return found


def is_null(value: Any) -> bool:
    """Whether a value is null, or a nested list of nulls only."""
    return value is None or (isinstance(value, list) and all(map(is_null, value)))


def pose_in(fields: Fields, where: str) -> Any:
    """The object's pose as a stream takes it; None where it is lost."""
    if fields.get("obj_pose") is not None:
        return fields["obj_pose"]
    rotation, translation = (fields.get(name) for name in POSE_FIELDS[:2])
    if is_null(rotation) and is_null(translation):
        return None
    if (rotation is None) != (translation is None):
        raise InputError(
            f"{where}: expected 'object_rotation' together with 'object_translation', got one of "
            "the two; add the other, or leave both out where the object is lost"
        )
    return rotation, translation


def _fields_of(frames: dict[Side, CleanFrame], poses: Fields) -> Fields:
    """The fields of one clean frame: its hands, null where one is lost, and the pose as it came."""
    found: Fields = {"frame": next(iter(frames.values())).index}
    for side, frame in frames.items():
        found[f"{side}_filled"] = frame.filled
        if frame.hand is None:
            found[f"{side}_joints"] = None
            continue
        arrays = hand_arrays(frame.hand)
        del arrays[f"{side}_valid"]
        for name, values in arrays.items():
            shared = name.endswith("_betas")
            found[name] = np.round(np.float64(values if shared else values[0]), DECIMALS).tolist()
        if frame.contact is not None:
            found[f"{side}_finger_contact"] = np.round(frame.contact.numpy(), DECIMALS).tolist()
        found["hand_model"] = frame.hand.hand_model
    return {**found, **poses}
