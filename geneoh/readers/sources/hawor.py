"""HaWoR's world results: world_space_res.pth, a joblib dump of five arrays, hand 0 left, hand 1
right.

trans (2, T, 3) of convention O, rot (2, T, 3), hand_pose (2, T, 45) absolute, betas (2, T, 10),
valid (2, T); the world of its camera tracking, metres. Left poses are a left hand's, for MANO_LEFT
with mirrored shape directions. Frames that HaWoR filled in are marked valid like those that it saw.
"""

from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.hand.mano import MENDED
from geneoh.pickles.files import read_values
from geneoh.readers.base import ReaderOptions, Recording, SourceClip, clip_name
from geneoh.readers.builders import (
    ManoConvention,
    ManoParameters,
    mano_track,
    object_of,
    recordings,
    sequence_of,
)
from geneoh.readers.records import FRAME_LIMIT, Array, Record

CONVENTION = ManoConvention(origin=True, hand=MENDED)
FPS = 30.0
FIELDS = (("trans", 3), ("rot", 3), ("hand_pose", 45), ("betas", 10), ("valid", None))
SIDES: tuple[Side, Side] = ("left", "right")


def find(path: Path) -> list[SourceClip]:
    """Every world result."""
    if path.is_file():
        return [SourceClip(clip_name(path, 2), path)]
    return [SourceClip(clip_name(p, 2), p) for p in sorted(path.rglob("world_space_res.pth"))]


def read(clip: SourceClip, known: ReaderOptions) -> list[Recording]:
    """Up to two hands in the world."""
    values = read_values(clip.path)
    if not isinstance(values, list | tuple) or len(values) != len(FIELDS):
        raise InputError(f"{clip.path}: expected the five arrays of HaWoR's world result")
    record = Record(str(clip.path), {n: v for (n, _), v in zip(FIELDS, values, strict=True)})
    arrays: dict[str, Array] = {
        name: record.array(name, (2, "T") if width is None else (2, "T", width))
        for name, width in FIELDS
    }
    frames = arrays["valid"].shape[1]
    if frames > FRAME_LIMIT or any(array.shape[1] != frames for array in arrays.values()):
        raise record.refuse("valid", f"as many frames as the other arrays, {FRAME_LIMIT} at most")
    tracks = []
    for index, side in enumerate(SIDES):
        seen = arrays["valid"][index] > 0.5
        if not seen.any():
            continue
        pose = np.concatenate([arrays["rot"][index], arrays["hand_pose"][index]], axis=1)
        pose[~seen] = np.nan
        betas = arrays["betas"][index, seen].mean(0)
        numbers = ManoParameters(side, pose, arrays["trans"][index], betas)
        tracks.append(mano_track(numbers, CONVENTION, known, f"{clip.path} {side}"))
    motion, notes = object_of(known, frames, str(clip.path))
    said = ["frames that HaWoR filled in count as seen: it marks them so"]
    if known.fps is None:
        said.append(f"{FPS:g} frames a second assumed; --fps says otherwise")
    sequence = sequence_of(tracks, motion, known.rate(FPS), f"HaWoR {clip.name}", *notes, *said)
    names = tuple(f"{clip.path.stem}_{index}" for index in range(len(motion.meshes)))
    everywhere = np.ones(frames, dtype=bool)
    return recordings(clip.name, sequence, object_known=everywhere, mesh_names=names)
