"""Base of the frozen dataclasses whose tensors travel together: hands, objects, sequences, batches.

The shape annotations name the axes of each field, so that every new field of a bundle is sliced and
concatenated with the others: `Float[Tensor, "T 21 3"]` has its frames first,
`Float[Tensor, "*B T 3"]` has them second to last, `Float[Tensor, " 10"]` has none.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from itertools import count
from typing import Any, TypeVar, get_args, get_type_hints

import numpy as np
import torch
from jaxtyping import AbstractArray, Bool, Int
from torch import Tensor

from geneoh.errors import InputError

FRAMES = "T"  # name of the frame axis in the annotations

Index = slice | Tensor | np.ndarray | list
"""Entries along one axis: a slice, a mask or indices; the axis stays."""

Axes = tuple[str, ...]
"""Names of a tensor's axes as its annotation has them; empty where it has no such annotation."""

Leaf = Tensor | np.ndarray

AnyBundle = TypeVar("AnyBundle", bound="Bundle")


@dataclass(frozen=True, eq=False)
class Bundle:
    """Tensors and numpy arrays that share axes; fields may be bundles, tuples or dicts of them."""

    def map(
        self: AnyBundle, function: Callable[[Tensor], Tensor], axis: str | None = None
    ) -> AnyBundle:
        """The bundle with the same function applied to every tensor, or to those with one axis."""

        def mapped(value: Leaf, axes: Axes) -> Leaf:
            if axis is not None and position(axis, axes, value.ndim) is None:
                return value
            return function(value) if isinstance(value, Tensor) else value

        return self._changed(mapped)

    def to(self: AnyBundle, device: torch.device | str) -> AnyBundle:
        """The same tensors on another device; numpy arrays stay where they are."""
        return self.map(lambda value: value.to(device))

    def __getitem__(self: AnyBundle, frames: Index) -> AnyBundle:
        """The chosen frames of every field that has frames; other fields stay as they are."""
        return self.take(frames, FRAMES)

    def take(self: AnyBundle, index: Index, axis: str) -> AnyBundle:
        """The chosen entries along an axis of the annotations, of every field that has this axis.

        "B" also stands for the first axis of `*B`.

        Raises:
            TypeError: the index is a single number, which would remove the axis, or a tensor's
                annotation does not name its axes.
            ValueError: a slice runs backward, which tensors do not support.
        """
        if not isinstance(index, Index):
            raise TypeError(
                f"{type(self).__name__} takes a slice, a mask or indices along {axis}, "
                f"got {index!r}; one entry n is n : n + 1"
            )

        if isinstance(index, slice) and (index.step or 1) < 0:
            raise ValueError(
                f"{type(self).__name__} takes slices that run forward along {axis}, got {index!r}; "
                "indices may run backward, such as torch.arange(n - 1, -1, -1) of n entries"
            )
        if not isinstance(index, slice | Tensor):
            entries = np.array(index)  # a copy, as torch takes no reversed array
            index = torch.from_numpy(entries if entries.size else entries.astype(np.int64))
        # numpy takes a tensor of one entry for a number, which would remove the axis
        of_array = index.cpu().numpy() if isinstance(index, Tensor) else index

        def cut(value: Leaf, axes: Axes) -> Any:
            place = position(axis, axes, value.ndim)
            own = index if isinstance(value, Tensor) else of_array
            return value if place is None else value[(slice(None),) * place + (own,)]

        return self._changed(cut)

    def _changed(self: AnyBundle, change: Callable[[Leaf, Axes], Leaf]) -> AnyBundle:
        """The bundle with `change` applied to every tensor and array and the names of its axes."""
        kinds = _annotations(type(self))
        changed = {
            field.name: _change(getattr(self, field.name), kinds[field.name], change)
            for field in fields(self)
        }
        return replace(self, **changed)


class ByValue:
    """Base of dataclasses with tensors that are declared with eq=False and repr=False, because the
    generated methods would fail to compare tensors, and would print all of their numbers."""

    def __eq__(self, other: object) -> bool:
        """Whether all compared fields are equal, tensors in every number; NaN in a tensor equals
        nothing."""
        return _same(self, other) if type(self) is type(other) else NotImplemented

    def __repr__(self: Any) -> str:
        """The fields, with the shapes of tensors."""
        each = (f"{field.name}={_shown(getattr(self, field.name))}" for field in fields(self))
        return f"{type(self).__name__}({', '.join(each)})"


def show_text(self: Any, printer: Any, cycle: bool) -> None:
    """Show the text of a result, and not all of its fields, at the end of a notebook's cell. It is
    the `_repr_pretty_` of results, which IPython calls."""
    printer.text(repr(self) if cycle else str(self))


def conform(bundle: Bundle, name: str) -> None:
    """Convert arrays, lists and numbers in fields of a new bundle to tensors; floats to float32.

    Call it from `__post_init__`.

    Raises:
        InputError: a field is no array of numbers, or its shape differs from its annotation.
    """
    sizes: dict[str, int] = {}
    for field, kind in _annotations(type(bundle)).items():
        value, axes = getattr(bundle, field), _axes(kind)
        if not axes or (value is None and type(None) in get_args(kind)):
            continue
        tensor = _as_tensor(value, kind)
        fits = tensor is not None and len(axes) == tensor.ndim
        pairs = zip(axes, tensor.shape, strict=True) if fits and tensor is not None else ()
        if not fits or any(
            size != (int(axis) if axis.isdecimal() else sizes.setdefault(axis, size))
            for axis, size in pairs
        ):
            wanted = ", ".join(axes) + "," * (len(axes) == 1)
            known = " and ".join(f"{axis} = {size}" for axis, size in sizes.items() if axis in axes)
            got, cure = type(value).__name__, "reshape or correct it"
            if tensor is not None:
                got = tuple(tensor.shape)
            elif isinstance(value, np.ndarray) and value.dtype == object:
                got, cure = "an array of objects", "make numbers of it with astype(float)"
            raise InputError(
                f"{name}: '{field}' must be numbers of shape ({wanted})"
                f"{known and f' with {known}'}, got {got}; {cure}"
            )
        if tensor is not value:
            object.__setattr__(bundle, field, tensor)


def concatenated(parts: Iterable[AnyBundle], axis: str = FRAMES) -> AnyBundle:
    """Bundles of one type joined along an axis; fields without this axis are those of the first."""
    first, *others = parts
    rest = [_leaves(part) for part in others]
    counted = iter(range(len(_leaves(first))))

    def join(value: Leaf, axes: Axes) -> Leaf:
        index = next(counted)
        place = position(axis, axes, value.ndim)
        if place is None:
            return value
        joined = [value, *(leaves[index] for leaves in rest)]
        if isinstance(value, np.ndarray):
            return np.concatenate(joined, axis=place)
        return torch.cat(joined, dim=place)  # pyright: ignore

    return first._changed(join)


def where(mask: Bool[Tensor, "..."], new: AnyBundle, old: AnyBundle) -> AnyBundle:
    """Bundles of tensors alone: `new` where `mask`, whose axes all tensors begin with, is true, and
    `old` elsewhere."""

    def chosen(name: str) -> Tensor:
        one, other = getattr(new, name), getattr(old, name)
        return torch.where(mask.view(*mask.shape, *[1] * (one.ndim - mask.ndim)), one, other)

    return replace(old, **{field.name: chosen(field.name) for field in fields(old)})


def gathered(parts: Sequence[AnyBundle], places: Int[Tensor, "N 2"]) -> AnyBundle:
    """Copies of N entries along the first axis, which all fields of the bundles share. A row of
    `places` is the index of a bundle in `parts`, and the index of an entry of it."""
    chosen = places.tolist()
    leaves = {number: _leaves(parts[number]) for number, _ in chosen}
    counted = count()

    def gather(value: Leaf, _: Axes) -> Leaf:
        index = next(counted)
        rows = [leaves[number][index][row] for number, row in chosen]
        return np.stack(rows) if isinstance(value, np.ndarray) else torch.stack(rows)

    return parts[chosen[0][0]]._changed(gather)


def spread(total: int, count: int) -> Int[Tensor, " C"]:
    """Indices of `count` of `total` entries, evenly from the first to the last."""
    return torch.linspace(0, total - 1, count).round().long()


def position(axis: str, axes: Axes, ndim: int) -> int | None:
    """Index of a named axis in a tensor of `ndim` axes; None where its annotation lacks the axis.

    Raises:
        TypeError: the annotation names no axes at all.
    """
    if not axes:
        raise TypeError("a tensor of a bundle needs an annotation with its axes, such as 'T 21 3'")
    names = [name.lstrip("*#") for name in axes]
    if axis not in names:
        return None
    index = names.index(axis)
    several = [name.startswith(("*", "...")) for name in axes]
    if several[index] and ndim < len(axes):
        return None  # `*B` stands for no axis here
    return ndim - len(axes) + index if any(several[:index]) else index


def _same(a: Any, b: Any) -> bool:
    """Whether two values are equal, with the tensors in them."""
    if type(a) is not type(b):
        return False
    if isinstance(a, Tensor):
        return a.device == b.device and torch.equal(a, b)
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b)
    if is_dataclass(a):
        return all(_same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a) if f.compare)
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(_same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(_same(a[key], b[key]) for key in a)
    return a == b or (a != a and b != b)


def _shown(value: Any) -> str:
    """The text of a value, with the shapes of the tensors in it."""
    if isinstance(value, Tensor | np.ndarray):
        return f"{type(value).__name__}{tuple(value.shape)}"
    if isinstance(value, tuple):
        return f"({', '.join(map(_shown, value))}{',' * (len(value) == 1)})"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key!r}: {_shown(each)}' for key, each in value.items())}}}"
    return repr(value)


def _leaves(bundle: Bundle) -> list[Any]:
    """All tensors and arrays of a bundle, in the order of the fields."""
    found: list[Leaf] = []

    def note(value: Leaf, _: Axes) -> Leaf:
        found.append(value)
        return value

    bundle._changed(note)
    return found


@cache
def _annotations(kind: type) -> dict[str, Any]:
    """The annotation of every field; evaluated only where a module keeps them as text."""
    found = {field.name: field.type for field in fields(kind)}
    return get_type_hints(kind) if any(isinstance(t, str) for t in found.values()) else found


def _change(value: Any, kind: Any, change: Callable[[Leaf, Axes], Leaf]) -> Any:
    """The value of a field that is annotated as `kind`, with every tensor in it changed."""
    if isinstance(value, Bundle):
        return value._changed(change)
    if isinstance(value, Leaf):
        return change(value, _axes(kind))
    if isinstance(value, tuple):
        return tuple(_change(each, kind, change) for each in value)
    if isinstance(value, dict):
        return {key: _change(each, kind, change) for key, each in value.items()}
    return value


def unmasked(value: Any) -> Any:
    """A masked array with NaN or False in masked entries; other values as they are."""
    if not np.ma.is_masked(value):
        return value
    return value.filled(False) if value.dtype == bool else value.astype(float).filled(np.nan)


def _as_tensor(value: Any, kind: Any) -> Tensor | None:
    """A value as a tensor with the dtype of an annotation; None if it is no array of numbers."""
    try:
        tensor = value if isinstance(value, Tensor) else torch.from_numpy(_native(value))
    except (TypeError, ValueError):
        return None
    names = _array(kind).dtypes
    whole = torch.int64 if "int64" in names else torch.float32
    return tensor.to(torch.bool if "bool" in names else whole)


def _native(value: Any) -> np.ndarray:
    """A copy of an array that torch can take: in this machine's byte order, and double at most."""
    array = np.array(unmasked(value))
    kinds = {"f": np.float64, "i": np.int64}
    return array.astype(kinds[array.dtype.kind]) if array.dtype.kind in kinds else array


@cache
def _axes(kind: Any) -> Axes:
    """The names of the axes in an annotation; those of the first array in it."""
    array = _array(kind)
    return () if array is None else tuple(array.dim_str.split())


def _array(kind: Any) -> Any:
    """The first array annotation within an annotation; None where there is none."""
    if isinstance(kind, type) and issubclass(kind, AbstractArray):
        return kind
    return next((array for part in get_args(kind) if (array := _array(part))), None)
