"""Settings of every test run."""

import torch
from hypothesis import settings

# The tests' tensors are small: more threads only wait for each other.
torch.set_num_threads(1)

# The same examples in every run, and no deadline: the first call of a function pays its imports.
settings.register_profile("geneoh", derandomize=True, deadline=None, max_examples=30)
settings.load_profile("geneoh")
