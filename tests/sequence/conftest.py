"""Random numbers of a seed."""

from networks import draw

__all__ = ["draw"]
