"""Synthetic interactions to learn from: made and scanned objects, grasps, motion, shards on disk.

docs/training.md tells how close they are to a real recording. They have no fingers that work
scissors or pliers (a hand that holds both parts keeps them still). A hand that shifts from grip to
grip goes straight from one to the next, and one that comes or goes may pass through the object by
more than 5 mm in some frames. Truth is exact: the jitter of annotations is no part of it.
"""
