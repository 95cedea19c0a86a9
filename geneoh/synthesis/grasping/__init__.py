"""Hands that hold a solid."""
