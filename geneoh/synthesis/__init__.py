"""Synthetic training data: analytic and scanned objects, grasps, motion, shards on disk.

docs/training.md compares it with a real recording. Fingers never operate scissors or pliers, and in
a few clips an approaching or leaving hand penetrates the object by more than 10 mm.
"""
