"""Builds the embedded hand: `python -m tools.hand_builder OUT.npz` writes its asset."""
