"""BOTH2Hands (Zhang et al., CVPR 2024): a moving body and a sentence become two hands."""
