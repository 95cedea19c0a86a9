"""Training data and training tasks of the networks of Text2HOI."""
