"""Whether a mesh is closed, and what a closed one holds."""

import torch

from geneoh.geometry.mesh import Mesh, welded
from geneoh.geometry.openings import open_edges


def is_watertight(mesh: Mesh) -> bool:
    """Whether no face has an open edge; seams between doubled vertices are no openings."""
    return not bool(open_edges(welded(mesh).faces).any())


def volume(mesh: Mesh) -> float:
    """What a closed mesh holds, cubic metres; negative where its faces look inward."""
    a, b, c = mesh.corners().double().unbind(-2)
    return float((a * torch.linalg.cross(b, c)).sum() / 6)
