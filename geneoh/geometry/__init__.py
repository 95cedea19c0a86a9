"""Rotations, rigid motions, meshes and their files, and distances to surfaces."""
