"""Small networks with random weights, and observations to show them."""

from networks import draw, wake

__all__ = ["draw", "wake"]
