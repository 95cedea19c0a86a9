"""Npz files: several layouts are read, geneoh's own is written."""
