"""The named arrays of one file, taken out with their shape and kind checked.

Every refusal names the file and the field, what was expected and what came.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from geneoh.errors import InputError

Shape = tuple[int | str, ...]
"""Sizes of the axes: a number, or a letter for an axis of any size, which is at least 1."""


@dataclass(frozen=True)
class Fields:
    """The arrays of one npz; a field that is not there reads as None."""

    file: str
    """Name of the file, for the messages."""
    arrays: dict[str, np.ndarray]

    def __contains__(self, name: str) -> bool:
        return name in self.arrays

    def refuse(self, name: str, expected: str, cure: str) -> InputError:
        """The error for a field that is not what it should be; `expected` follows "must be"."""
        array = self.arrays[name]
        got = repr(array.item()) if array.ndim == 0 else f"{array.shape} of {array.dtype}"
        return InputError(f"{self.file}: '{name}' must be {expected}, got {got}; {cure}")

    def floats(self, name: str, *shapes: Shape, unit: str, cure: str = "") -> Tensor | None:
        """A float32 tensor of one of `shapes`; finiteness is for the caller, who knows the frames.

        Args:
            name: the field.
            shapes: those allowed, the first is the one that the message names.
            unit: what the numbers measure, as the message shows it, such as "in metres".
            cure: what to do about a wrong shape.
        """
        if name not in self.arrays:
            return None
        array = self.arrays[name]
        if array.dtype.kind not in "fiu":
            raise self.refuse(name, "numbers", "save it as float32")
        if not any(fits(array.shape, shape) for shape in shapes):
            wanted = f"({', '.join(map(str, shapes[0]))}{',' * (len(shapes[0]) == 1)}) {unit}"
            empty = "a sequence has at least one frame" if array.size == 0 else ""
            raise self.refuse(name, wanted, empty or cure or "reshape or re-export it")
        return torch.from_numpy(array.astype(np.float64)).float()

    def flags(self, name: str) -> Bool[Tensor, " T"] | None:
        """A mask over the frames, given as booleans or as zeros and ones."""
        if name not in self.arrays:
            return None
        array = self.arrays[name]
        if array.ndim != 1 or array.dtype.kind not in "biuf" or not np.isin(array, (0, 1)).all():
            raise self.refuse(name, "one boolean for each frame", "save it with dtype=bool")
        return torch.from_numpy(array.astype(bool))

    def text(self, name: str) -> str | None:
        """A single word or sentence."""
        if name not in self.arrays:
            return None
        array = self.arrays[name]
        if array.size != 1 or array.dtype.kind not in "US":
            raise self.refuse(name, "one piece of text", f"save it as {name}='...'")
        value = array.item()
        return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)

    def refuse_lengths(self, *names: str) -> None:
        """Refuse fields of one track that do not have the same number of frames."""
        lengths = {name: len(self.arrays[name]) for name in names if name in self.arrays}
        if len(set(lengths.values())) > 1:
            got = ", ".join(f"'{name}' with {length}" for name, length in lengths.items())
            raise InputError(
                f"{self.file}: fields of one track must have the same number of frames, "
                f"got {got}; cut them to the same frames"
            )

    def number(self, name: str) -> float | None:
        """A single number; true and false count as 1 and 0."""
        if name not in self.arrays:
            return None
        array = self.arrays[name]
        if array.size != 1 or array.dtype.kind not in "fiub":
            raise self.refuse(name, "one number", f"save it as {name}=30.0")
        return float(array.item())


def fits(shape: tuple[int, ...], pattern: Shape) -> bool:
    """Whether an array's shape matches; a letter stands for any size but zero."""
    return len(shape) == len(pattern) and all(
        size > 0 if isinstance(want, str) else size == want
        for size, want in zip(shape, pattern, strict=True)
    )


def all_finite(values: Float[Tensor, "T ..."]) -> Bool[Tensor, " T"]:
    """For each frame, whether all of its numbers are finite."""
    return values.isfinite().flatten(1).all(1) if values.ndim > 1 else values.isfinite()
