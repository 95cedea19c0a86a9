"""The maker of the embedded hand: `python -m tools.hand_builder OUT.npz` writes the asset anew."""
