"""Objects of one solid, placed by hand."""

import pytest
import torch

from geneoh.synthesis.shapes.solids import FAR_AWAY, SOLIDS, Solids


def solid(
    kind: int,
    size: tuple[float, float, float],
    rounding: float = 0.0,
    center: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> Solids:
    """One upright solid; the other places are parked far away, as `draw_objects` does."""
    away = torch.full((1, SOLIDS, 3), FAR_AWAY)
    away[0, 0] = torch.tensor(center)
    sizes = torch.full((1, SOLIDS, 3), 0.01)
    sizes[0, 0] = torch.tensor(size)
    rounded = torch.zeros(1, SOLIDS)
    rounded[0, 0] = rounding
    kinds = torch.zeros(1, SOLIDS, dtype=torch.long)
    kinds[0, 0] = kind
    return Solids(
        kinds,
        sizes,
        rounded,
        away,
        torch.eye(3).expand(1, SOLIDS, 3, 3),
        part=torch.zeros(1, SOLIDS, dtype=torch.long),
        axis=torch.tensor([[0.0, 0.0, 1.0]]),
        pivot=torch.zeros(1, 3),
        slides=torch.zeros(1, dtype=torch.bool),
        travel=torch.zeros(1, 2),
    )


@pytest.fixture(scope="session")
def make_solid():
    return solid
