import pytest
import torch

from geneoh.representation.touch import nearest_points


def draw(*shape: int, seed: int = 0) -> torch.Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize("away", [0.0, 3.0])
def test_the_nearest_point_is_that_of_a_slow_search(away):
    joints, points = 0.1 * draw(3, 7, 3) + away, 0.1 * draw(3, 50, 3, seed=1) + away
    normals = torch.nn.functional.normalize(draw(3, 50, 3, seed=2), dim=-1)
    nearest, outward = nearest_points(joints, points, normals)
    for b in range(3):
        for j in range(7):
            at = int((points[b].double() - joints[b, j].double()).norm(dim=-1).argmin())
            assert torch.equal(nearest[b, j], points[b, at])
            assert torch.equal(outward[b, j], normals[b, at])
