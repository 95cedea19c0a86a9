"""The layouts of npz files that people have at hand: their fields, and how to tell them apart.

A file that could be in two of them is refused, never guessed about.
"""

import difflib
from collections.abc import Iterable
from typing import Literal

from geneoh.errors import InputError
from geneoh.readers.fields import Fields

Layout = Literal["geneoh-sequence", "smplx", "taco", "joints"]

FORMAT, VERSION = "geneoh-sequence", 1

HAND_FIELDS = ("pose", "wrist", "betas", "joints", "valid", "confidence", "joint_spread")
OBJECT_FIELDS = ("object_rotation", "object_translation", "obj_pose")
LAYOUTS: dict[Layout, tuple[str, ...]] = {
    "geneoh-sequence": (
        *("format", "version", "fps", "hand_model", "source"),
        *(f"{side}_{name}" for side in ("right", "left") for name in HAND_FIELDS),
    ),
    "smplx": (
        *("global_orient", "hand_pose", "transl", "betas", "flat_hand_mean"),
        *("joints", "valid", "confidence", "side", "fps"),
    ),
    "taco": (
        *("hand_pose", "hand_trans", "hand_shape", "hand_joints", "hand_valid"),
        *("side", "fps"),
    ),
    "joints": ("joints", "valid", "confidence", "side", "fps"),
}
"""The fields that each layout knows, object fields aside; all layouts share those."""

MARKS: dict[Layout, tuple[str, ...]] = {
    "smplx": ("global_orient", "transl"),
    "taco": ("hand_trans", "hand_joints", "hand_shape", "hand_valid"),
}
"""Fields that only this layout has."""

TYPO_CUTOFF = 0.85
"""Similarity above which an unknown field name is taken for a slip of a known one."""


def layout_of(fields: Fields) -> Layout:
    """The one layout that a file is in.

    Raises:
        InputError: none fits, or more than one does.
    """
    if "format" in fields:
        return refuse_format(fields)
    sided = [f"{side}_{name}" for side in ("right", "left") for name in HAND_FIELDS]
    if any(name in fields for name in sided):
        raise InputError(
            f"{fields.file}: has fields of the geneoh-sequence layout, got no 'format'; "
            f"add format='{FORMAT}' and version={VERSION}"
        )
    found: dict[Layout, list[str]] = {
        layout: [name for name in marks if name in fields] for layout, marks in MARKS.items()
    }
    # `joints` may complete the smplx names, which carry none; the TACO names have their own.
    if "joints" in fields and not found["smplx"]:
        found["joints"] = ["joints"]
    found = {layout: names for layout, names in found.items() if names}
    if len(found) == 1:
        return next(iter(found))
    if not found:
        raise InputError(
            f"{fields.file}: expected a hand as 'right_joints' or 'right_pose' (geneoh-sequence), "
            "'global_orient' (smplx), 'hand_trans' (TACO) or 'joints', got "
            f"{quoted(fields.arrays) or 'no field at all'}; rename the fields"
        )
    choices = " or ".join(f"{quoted(names)} ({layout})" for layout, names in found.items())
    raise InputError(
        f"{fields.file}: the hand must come in one layout, got the fields of {len(found)}; "
        f"remove {choices}"
    )


def refuse_format(fields: Fields) -> Layout:
    """Our own layout, once its name and version are ones that can be read."""
    if fields.text("format") != FORMAT:
        raise fields.refuse("format", f"'{FORMAT}'", "remove it to have the other fields read")
    if "version" not in fields or fields.number("version") != VERSION:
        version = fields.number("version")
        raise InputError(
            f"{fields.file}: 'version' must be {VERSION}, got "
            f"{'none' if version is None else f'{version:g}'}; write it with this geneoh, "
            "or install the geneoh that wrote it"
        )
    return FORMAT


def slips(fields: Fields, layout: Layout) -> list[str]:
    """Unknown fields that look like a slip of a known one that the file lacks, with that one."""
    known = {*LAYOUTS[layout], *OBJECT_FIELDS}
    missing = sorted(known - set(fields.arrays))
    close = {
        name: difflib.get_close_matches(name, missing, 1, TYPO_CUTOFF)
        for name in fields.arrays
        if name not in known
    }
    return [f"'{name}' is not read; is it '{match[0]}'?" for name, match in close.items() if match]


def quoted(names: Iterable[str]) -> str:
    """Field names for a message."""
    return ", ".join(f"'{name}'" for name in names)
