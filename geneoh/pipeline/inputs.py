"""The input of `geneoh.denoise`: loaded, checked, and detached from the caller's gradients."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

from torch import Tensor

from geneoh.errors import InputError, numbered
from geneoh.geometry.mesh import Mesh, checked_mesh, size_warning, tidied
from geneoh.geometry.mesh_files import meshes_of
from geneoh.readers.meshes import with_parts
from geneoh.readers.npz.files import load
from geneoh.sequence.gaps import fill_object, without_placeholders
from geneoh.sequence.sequence import Sequence, without_unseen
from geneoh.sequence.validation import check_sequence, collapsed, without_collapsed


def as_sequence(
    given: Sequence | Path | str, obj: Path | str | Iterable[Path | str] | None
) -> Sequence:
    """A sequence passed directly or loaded from a file, with the meshes of its object.

    Raises:
        InputError: the argument is neither, or the file cannot be read.
    """
    if isinstance(given, Path | str):
        return load(given, obj=obj)
    if not isinstance(given, Sequence):
        raise InputError(
            f"geneoh.denoise takes a Sequence or the npz file of one, got {type(given).__name__}; "
            "geneoh.from_arrays makes a Sequence of arrays, and a result has one in .sequence"
        )
    motion = given.object if obj is None else replace(given.object, meshes=meshes_of(obj))
    given = replace(given, object=with_parts(motion)[0])
    found: list[bool] = []
    copy = given.map(lambda values: own(values, found))
    return copy if any(found) else given


def own(values: Tensor, found: list[bool]) -> Tensor:
    """The values detached from autograd and out of inference mode; appends to `found` whether they
    needed it."""
    found.append(values.requires_grad or values.is_inference())
    return values.clone() if values.is_inference() else values.detach()


def checked_interaction(sequence: Sequence) -> Sequence:
    """The sequence with missing object poses filled, and without placeholders of keypoints, hand
    frames of no confidence, collapsed to a point or all zero, hands in no frame, and unused
    vertices.

    Raises:
        InputError: the first fault that is found: a mesh without a surface or in another unit than
            metres, or values that cannot be an interaction.
    """
    sequence = without_unseen(sequence)
    motion = sequence.object
    if (meshes := checked_meshes(motion.meshes, sequence.source)) != motion.meshes:
        motion = replace(motion, meshes=meshes)
    seen = (replace(hand, valid=hand.observed) for hand in sequence.hands)
    hands = tuple(without_collapsed(without_placeholders(hand)) for hand in seen)
    sequence = replace(sequence, hands=hands, object=fill_object(motion))
    check_sequence(sequence, sequence.source)
    return sequence


def checked_meshes(meshes: Iterable[Mesh], source: str = "") -> tuple[Mesh, ...]:
    """The meshes without unused vertices, which are in no file's mesh either.

    Raises `InputError` for one without a surface or in another unit than metres; `source` names the
    meshes in the message.
    """
    found = list[Mesh]()
    for mesh in meshes:
        name = str(mesh.source or source or "the mesh")
        found.append(tidied(checked_mesh(mesh, name)))
        if warning := size_warning(found[-1]):
            raise InputError(f"{name}: {warning}")
    return tuple(found)


def left_out(sequence: Sequence) -> Iterator[str]:
    """Sentences for the user about hands in no frame, and about hand frames that are collapsed to a
    point or all zero in spite of some confidence."""
    kept = without_unseen(sequence).hands
    yield from (
        f"the {hand.side} hand is in no frame and was left out"
        for hand in sequence.hands
        if hand not in kept
    )
    for hand in kept:
        if count := int((collapsed(hand) & hand.observed).sum()):
            yield (
                f"{numbered(count, 'frame')} in which all keypoints of the {hand.side} hand are in "
                "one place, or all its parameters zero, taken as missing; mark them by NaN or "
                "'valid'"
            )
