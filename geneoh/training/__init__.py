"""Training of all networks: the loop, its tasks, and the data that they learn from."""
