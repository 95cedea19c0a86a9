"""Building blocks of networks, and their weights on disk."""
