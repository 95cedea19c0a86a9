"""Diffusion of any tensors: noise levels, samplers, preconditioning; it knows nothing of hands."""
