"""Text2HOI (Cha et al., CVPR 2024): a sentence and a mesh become two hands and a moving object."""
