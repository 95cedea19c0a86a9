"""Whether a mesh is closed."""

from geneoh.geometry.mesh import Mesh, welded
from geneoh.geometry.openings import open_edges


def is_watertight(mesh: Mesh) -> bool:
    """Whether no face has an open edge; seams between doubled vertices are no openings."""
    return not bool(open_edges(welded(mesh).faces).any())
