"""A body's motion out of any file of one, by the file's ending and its fields."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

from geneoh.choices import Axis
from geneoh.errors import InputError
from geneoh.readers.bodies.base import BodyRecording
from geneoh.readers.bodies.bvh import read_bvh
from geneoh.readers.bodies.smpl import read_smpl


def read_bodies(
    path: Path | str,
    *,
    fps: float | None = None,
    up: Axis | None = None,
    model: Path | None = None,
) -> Iterator[BodyRecording]:
    """The bodies in a file, metres, y up, at its own frame rate: one, but for lists of BOTH57M.

    Args:
        path: npz by smplx names or of AMASS, npy of Motion-X, joblib list of BOTH57M, BVH, or what
            `geneoh generate --body` wrote. Nothing in it is run.
        fps: frames a second, where the file does not say.
        up: axis of the file's world that points up, where neither its layout nor the body says.
        model: the user's SMPL-H or SMPL-X model, for the skeleton of SMPL parameters.

    Raises:
        InputError: the file holds no body that can be read; the message says why.
    """
    path = Path(path)
    if path.suffix.lower() == ".bvh":
        return iter((read_bvh(path, fps=fps, up=up),))
    return read_smpl(path, fps=fps, up=up, model=model)


def read_body(
    path: Path | str,
    *,
    clip: int | None = None,
    fps: float | None = None,
    up: Axis | None = None,
    model: Path | None = None,
) -> BodyRecording:
    """One body of a file; see `read_bodies`.

    `clip` is its place in the list of a file with several, from 0; without it the first, noted.
    """
    index = clip or 0
    bodies = list(islice(read_bodies(path, fps=fps, up=up, model=model), index, index + 2))
    if not bodies:
        raise InputError(f"{path}: expected a clip number {index}, got fewer; lower --clip")
    body = bodies[0]
    if clip is None and len(bodies) > 1:
        note = "the first of several clips; --clip takes another"
        return replace(body, notes=(*body.notes, note))
    return body
