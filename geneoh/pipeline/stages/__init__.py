"""The three stages, and what they see of a sequence."""
