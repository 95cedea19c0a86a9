"""Checks of a sequence that was read against geneoh's conventions."""
