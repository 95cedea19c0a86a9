import math

import pytest
import torch

from geneoh.geometry.forces import friction_cones, wrench_left


def test_edges_lie_on_the_cone_and_press_with_one_newton():
    generator = torch.Generator().manual_seed(0)
    normals = torch.nn.functional.normalize(torch.randn(5, 3, generator=generator), dim=-1)
    forces = friction_cones(torch.zeros(5, 3), normals, 0.5, edges=8)[..., :3]
    press = -(forces * normals[:, None]).sum(-1)
    aside = (forces + press[..., None] * normals[:, None]).norm(dim=-1)
    assert torch.allclose(press, torch.ones(5, 8), atol=1e-6)
    assert torch.allclose(aside, torch.full((5, 8), 0.5), atol=1e-6)


def test_torque_is_arm_times_force():
    arms, normals = torch.tensor([[0.0, 0.0, 2.0]]), torch.tensor([[-1.0, 0.0, 0.0]])
    (wrench,) = friction_cones(arms, normals, 0.0, edges=1)[0]
    assert wrench.tolist() == pytest.approx([1.0, 0.0, 0.0, 0.0, 2.0, 0.0])


def test_wrench_beyond_the_cone_leaves_its_distance_from_the_cone():
    spanned = torch.eye(6)[:2] + torch.eye(6)[1:3]  # along (1, 1, 0) and (0, 1, 1)
    inside, outside = spanned.sum(0), -torch.eye(6)[1]
    left = wrench_left(spanned[None], torch.stack([inside, outside])[None])[0].norm(dim=-1)
    assert left[0] < 2e-3
    assert left[1] == pytest.approx(1.0)


def test_rest_is_that_of_least_squares_without_negative_weights():
    from scipy.optimize import nnls

    generator = torch.Generator().manual_seed(1)
    spanned, wanted = torch.randn(9, 6, generator=generator), torch.randn(6, generator=generator)
    found = wrench_left(spanned[None], wanted[None, None], steps=400)[0, 0].norm()
    least = nnls(spanned.T.double().numpy(), wanted.double().numpy())[1]
    assert math.isclose(float(found), least, abs_tol=5e-3)
