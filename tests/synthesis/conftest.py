"""Objects of one solid, placed by hand."""

import pytest
import torch

from geneoh.synthesis.objects import FAR, PARTS, Solids


def solid(
    kind: int,
    size: tuple[float, float, float],
    rounding: float = 0.0,
    center: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Solids:
    """One upright solid; the other places are parked far away, as `draw_objects` does."""
    away = torch.full((1, PARTS, 3), FAR)
    away[0, 0] = torch.tensor(center)
    sizes = torch.full((1, PARTS, 3), 0.01)
    sizes[0, 0] = torch.tensor(size)
    rounded = torch.zeros(1, PARTS)
    rounded[0, 0] = rounding
    kinds = torch.zeros(1, PARTS, dtype=torch.long)
    kinds[0, 0] = kind
    return Solids(kinds, sizes, rounded, away, torch.eye(3).expand(1, PARTS, 3, 3))


@pytest.fixture(scope="session")
def make_solid():
    return solid
