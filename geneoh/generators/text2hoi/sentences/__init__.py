"""The meaning of a user's sentence, and the training sentences of the networks."""
