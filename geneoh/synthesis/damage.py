"""What only damage makes of the numbers in shards."""

from collections.abc import Mapping

from jaxtyping import Int
from torch import Tensor

from geneoh.bundle import Bundle

LARGEST = 1000.0  # largest number in a shard, in metres or radians; larger ones are damage


def refuse_damage(clips: Bundle, ranges: Mapping[str, int]) -> None:
    """Refuse what only damage makes: no clips or points, numbers that are no index, or NaN.

    `ranges` has the number of things that a field of indices is about.
    """
    for name, value in vars(clips).items():
        if not isinstance(value, Tensor):
            continue
        if not value.numel():
            raise ValueError(f"nothing in '{name}'")
        if value.is_floating_point() and not bool((value.abs() <= LARGEST).all()):
            raise ValueError(f"numbers beyond {LARGEST:g} in '{name}'")  # or NaN
        if name in ranges and not bool(((value >= 0) & (value < ranges[name])).all()):
            raise ValueError(f"numbers in '{name}' that are not from 0 to {ranges[name] - 1}")


def refuse_lengths(length: Int[Tensor, " B"], frames: int) -> None:
    """Refuse clips of less than two frames, or of more than there are."""
    if not bool(((length >= 2) & (length <= frames)).all()):
        raise ValueError(f"numbers in 'length' that are not from 2 to {frames}")
