"""Checks of output paths before the work begins, so that no file of the user is overwritten.

The functions of `os.path` are asked what is there: those of pathlib raise in a folder without
permission, which is reported where the file is opened.
"""

import os
import zipfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from geneoh.errors import InputError
from geneoh.files.atomic import replaceable
from geneoh.files.journal import is_journal
from geneoh.files.npz import OWN_ATTRIBUTES, decode_array
from geneoh.files.reading import DAMAGE

SEQUENCE_FORMAT: Final = "geneoh-sequence"
"""The field `format` of a geneoh-sequence npz."""
SMPLX_NAMES = (
    ("side", "hand_model", "flat_hand_mean", "transl", "joints", "valid"),
    ("body_pose", "left_hand_pose", "right_hand_pose", "mocap_frame_rate", "body_offsets"),
)
SMPLX_MARKS = [{f"{name}.npy" for name in names} for names in SMPLX_NAMES]
"""Archive members that together occur only in our npz files under smplx names: of hands, of
bodies."""
HEAD_MARKS = {
    ".html": b'<meta name="generator" content="geneoh">',
    ".png": b"tEXtSoftware\0geneoh",
    ".glb": b'"generator":"geneoh"',
    ".json": b'"generator": "geneoh ',
}
"""A mark in the first `MARK_BYTES` bytes of every file that geneoh writes, by its ending."""
TAIL_MARKS = {
    ".mp4": b"\0\0\0\x0efreegeneoh",  # a box that players skip
    ".gif": b"\x21\xfe\x06geneoh\0;",  # a comment, and the end of the GIF
}
"""The last bytes of each film that geneoh writes."""
MARK_BYTES = 4096
"""Bytes at the start of a file that are searched for its mark; most bytes of a `format` field."""


def check_ending(path: Path, endings: Iterable[str]) -> None:
    """`InputError` for a path whose ending is not one of `endings`."""
    if path.suffix.lower() not in endings:
        raise InputError(f"{path}: expected {', '.join(endings)}, got {path.suffix!r}; name it so")


def check_outputs(
    files: Iterable[Path],
    *,
    endings: Iterable[str] = (),
    folders: Iterable[Path] = (),
    inputs: Iterable[Path | None] = (),
    overwrite: bool = False,
    remedy: str = "pass --overwrite to replace it, or choose another name",
) -> None:
    """Refuse outputs that cannot be written or would replace a file that geneoh did not write.

    Links are followed.

    Args:
        files: files to write, each in a folder that exists.
        endings: endings that the files may have; empty for any.
        folders: new folders to make.
        inputs: files and folders that are read; in them only files of geneoh are replaced.
        overwrite: whether files that geneoh did not write may be replaced; inputs never are.
        remedy: advice for the message about such a file.
    """
    read = [path for path in inputs if path is not None]
    taken: set[Path] = set()
    for path in (files := [*files]):
        if endings:
            check_ending(path, endings)
    for path in files + [*folders]:
        is_new_folder = path not in files
        if is_new_folder:
            refuse_folder(path)
        _check_folder(path, missing=is_new_folder)
        place = Path(os.path.realpath(replaceable(path)))
        refuse_inputs(path, place, read)
        if place in taken:
            raise InputError(f"{path}: is the name of two outputs; give each its own")
        taken.add(place)
        if not overwrite:
            keep_others(path, remedy=remedy)


def _check_folder(path: Path, *, missing: bool) -> None:
    """Refuse an output whose folder cannot be written to; with `missing`, it may be made later."""
    folder = replaceable(path).parent
    while missing and not os.path.lexists(folder):
        folder = folder.parent
    if not os.path.isdir(folder):
        why = f"there is no folder {folder}"
    elif not os.access(folder, os.W_OK | os.X_OK):
        why = f"no permission to write to {folder}"
    else:
        return
    raise InputError(f"{path}: cannot be written ({why}); choose another place")


def refuse_folder(path: Path) -> None:
    """Refuse an output folder that exists already, because its files may belong to other work."""
    if os.path.isdir(path):
        raise InputError(
            f"{path}: expected a new folder, got one that is there; remove it, or choose another "
            "name"
        )


def refuse_inputs(path: Path, place: Path, inputs: Iterable[Path]) -> None:
    """Refuse an output that is an input or a foreign file in one; `place` is its real path."""
    for given in inputs if os.path.exists(place) else ():
        within = place.is_relative_to(os.path.realpath(given)) and not is_ours(place)
        if os.path.exists(given) and (given.samefile(place) or within):
            where = "" if given.samefile(place) else f"lies in {given}, which "
            raise InputError(f"{path}: {where}is an input and never replaced; choose another name")


def lies_within(path: Path, folder: Path) -> bool:
    """Whether a path is `folder` or lies in it, after `..` and links are resolved."""
    return path.resolve().is_relative_to(folder.resolve())


def keep_others(*paths: Path, remedy: str = "choose another folder") -> None:
    """`InputError` for a folder, and for a file that is not empty and that geneoh did not write."""
    for path in paths:
        if os.path.isdir(path):
            raise InputError(
                f"{path}: expected the name of a file, got a folder; choose another name"
            )
        if os.path.exists(path) and path.stat().st_size and not is_ours(path):
            raise InputError(f"{path}: is there already and was not written by geneoh; {remedy}")


def is_ours(path: Path) -> bool:
    """Whether geneoh wrote this regular file, judged by a few bytes; False when in doubt."""
    ending = path.suffix.lower()
    with suppress(OSError):
        if ending == ".npz":
            return _is_our_archive(path)
        if ending == ".jsonl":
            return is_journal(path)
        with path.open("rb") as file:
            if ending in HEAD_MARKS:
                return HEAD_MARKS[ending] in file.read(MARK_BYTES)
            if mark := TAIL_MARKS.get(ending):
                file.seek(-len(mark), os.SEEK_END)
                return file.read() == mark
    return False


def _is_our_archive(path: Path) -> bool:
    """Whether an npz is a geneoh-sequence or our own parameters under smplx names."""
    try:
        with zipfile.ZipFile(path) as archive:
            names = set(archive.namelist())
            # users write our formats as well, by numpy
            if any(each.external_attr != OWN_ATTRIBUTES for each in archive.infolist()):
                return False
            if any(names >= mark for mark in SMPLX_MARKS):
                return True
            if "format.npy" not in names or archive.getinfo("format.npy").file_size > MARK_BYTES:
                return False
            value = decode_array(archive.read("format.npy"), f"{path}: 'format'")
    except (InputError, *DAMAGE):
        return False
    return value.dtype.kind == "U" and str(value) == SEQUENCE_FORMAT
