"""Faults of a track that are found before it is cleaned."""
