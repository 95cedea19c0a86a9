"""Small networks with random weights, and observations to show them."""

from networks import draw, make_observation, wake

__all__ = ["draw", "make_observation", "wake"]
