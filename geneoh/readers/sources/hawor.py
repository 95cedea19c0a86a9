"""HaWoR's world results: world_space_res.pth, a joblib dump of five arrays, hand 0 left, hand 1
right.

trans (2, T, 3) of MANO's origin, rot (2, T, 3), hand_pose (2, T, 45) absolute, betas (2, T, 10),
valid (2, T); the world of its camera tracking, metres. Left poses are a left hand's, for MANO_LEFT
with mirrored shape directions. Frames that HaWoR filled in are marked valid like those that it saw.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from geneoh.choices import Side
from geneoh.errors import InputError
from geneoh.files.values import read_values
from geneoh.hand.mano import MENDED
from geneoh.readers.base import ReaderOptions, SourceClip
from geneoh.readers.builders import ManoConvention, ManoParameters
from geneoh.readers.dataset_reader import ClipParts, DatasetReader
from geneoh.readers.records import FRAME_LIMIT, Record

FIELDS = ("trans", "rot", "hand_pose", "betas", "valid")
WIDTHS = (3, 3, 45, 10)
"""Numbers of each field but the last, which has one."""
SIDES: tuple[Side, Side] = ("left", "right")


class HaworReader(DatasetReader):
    """Up to two hands in the world."""

    patterns = ("world_space_res.pth",)
    name_parts = 2
    fps_assumed = True
    convention = ManoConvention("origin", left_hand=MENDED)

    def find(self, path: Path) -> list[SourceClip]:
        """Every world result; a file may have any name."""
        return [self.clip_at(path)] if path.is_file() else super().find(path)

    def parts(self, clip: SourceClip, options: ReaderOptions) -> Iterator[ClipParts]:
        """The one interaction of a video, with the caller's object."""
        values = read_values(clip.path)
        if not isinstance(values, list | tuple) or len(values) != len(FIELDS):
            raise InputError(f"{clip.path}: expected the five arrays of HaWoR's world result")
        record = Record(str(clip.path), dict(zip(FIELDS, values, strict=True)))
        *parameters, valid = (
            record.array(name, (2, "T", *width))
            for name, width in zip(FIELDS, [*[(n,) for n in WIDTHS], ()], strict=True)
        )
        frames = valid.shape[1]
        if frames > FRAME_LIMIT or any(array.shape[1] != frames for array in parameters):
            raise record.refuse(
                "valid", f"as many frames as the other arrays, {FRAME_LIMIT} at most"
            )
        trans, rot, fingers, betas = parameters
        hands = []
        for index, side in enumerate(SIDES):
            seen = valid[index] > 0.5
            if seen.any():
                pose = np.concatenate([rot[index], fingers[index]], axis=1)
                pose[~seen] = np.nan
                hands.append(ManoParameters(side, pose, trans[index], betas[index, seen].mean(0)))
        note = "frames that HaWoR filled in count as seen: it marks them so"
        yield ClipParts(f"HaWoR {clip.name}", hands, notes=(note,))


READER = HaworReader()
