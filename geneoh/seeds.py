"""Random generators with seeds from names, equal in every run and on every machine."""

import hashlib

import torch


def seed_of(*parts: object) -> int:
    """A 63-bit seed from any values."""
    digest = hashlib.sha256("/".join(map(str, parts)).encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 1


def seeded_generator(*parts: object) -> torch.Generator:
    """A random generator whose seed is `seed_of` these values."""
    return torch.Generator().manual_seed(seed_of(*parts))
