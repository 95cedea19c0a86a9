"""Synthetic interactions to learn from: made and scanned objects, grasps, motion, shards on disk.

docs/training.md tells how close they are to a real recording. No fingers work scissors or pliers,
and in a few clips a hand that comes or goes is more than 10 mm deep in the object.
"""
