"""Diffusion of arbitrary tensors, independent of hands: schedules, samplers, preconditioning."""
