"""Synthetic interactions to learn from: made and scanned objects, grasps, motion, shards on disk.

docs/training.md tells how close they are to a real recording. No fingers work scissors or pliers,
and a hand that comes or goes may pass through the object by more than 5 mm in some frames.
"""
