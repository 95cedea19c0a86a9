"""Keypoints of hands in JSON and in tables."""
