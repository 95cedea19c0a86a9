"""Synthetic clips in which hands perform a verb with an object."""
