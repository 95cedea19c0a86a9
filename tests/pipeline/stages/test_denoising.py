"""Cutting scenes into windows and blending them back."""

import torch

from geneoh.diffusion.posterior import Posterior
from geneoh.pipeline.stages.context import StageContext
from geneoh.pipeline.stages.denoising import _width_of_place
from geneoh.pipeline.stages.paper import _closest


def scene_of(frames: int, parts: int = 2) -> StageContext:
    generator = torch.Generator().manual_seed(0)
    return StageContext(
        points=torch.randn(40, 3, generator=generator) * 0.03,
        normals=torch.nn.functional.normalize(torch.randn(40, 3, generator=generator), dim=-1),
        part=torch.arange(40) % parts,
        rotation=torch.eye(3).expand(frames, parts, 3, 3),
        translation=torch.zeros(frames, parts, 3),
        trust=torch.ones(frames, 21),
        fps=30.0,
    )


def test_blend_undoes_windows():
    for frames in (1, 20, 60, 61, 146):
        joints = torch.randn(3, frames, 21, 3)
        context = scene_of(frames)
        assert torch.allclose(context.blend(context.windows(joints)), joints, atol=1e-6)


def test_cut_takes_the_frames_that_its_starts_name():
    context = scene_of(146)
    values = torch.arange(146.0)[:, None, None].expand(-1, 2, 3)
    cut = context.cut(values, 0)
    assert cut.shape == (len(context.starts), 60, 2, 3)
    for window, start in enumerate(context.starts):
        assert torch.equal(cut[window], values[start : start + 60])


def test_each_sample_has_contact_points_of_its_own_hand():
    context = scene_of(20)
    hands = torch.zeros(2, 20, 21, 3)
    hands[1] += 0.05
    region = context.region(hands)
    alone = context.region(hands[1:])
    assert region.points.shape[0] == 2
    assert torch.equal(region.points[1], alone.points[0])
    assert not torch.equal(region.points[0], region.points[1])


def test_the_closest_chain_is_that_where_the_hand_was_seen():
    given, chains = torch.zeros(1, 6, 21, 3), torch.zeros(2, 1, 6, 21, 3)
    chains[0, 0, :4] = 0.02  # off where the hand was seen
    chains[1, 0, 4:] = 0.06  # off the straight line through a gap
    trust = (torch.arange(6) < 4).float()[None, :, None].expand(1, 6, 21)
    assert torch.equal(_closest(chains, given, trust, 1)[0], chains[1])


def test_the_width_of_a_place_leaves_out_the_ray_of_a_camera_that_is_known():
    """Two windows, whose places are much wider along x than across it."""
    root = torch.diag(torch.tensor([0.05, 0.004, 0.004, 0.05, 0.006, 0.006]))
    found = [Posterior(torch.zeros(1, 6), root[None])]
    ray = torch.tensor([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    width = _width_of_place(found, ray)
    expected = [3**0.5 * 0.004, (0.05**2 + 2 * 0.006**2) ** 0.5]
    torch.testing.assert_close(width, torch.tensor(expected))
