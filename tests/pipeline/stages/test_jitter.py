import torch
from ball_scenes import LONG, hands_at, scene
from draws import seeded

from geneoh.pipeline.stages.jitter import without_jitter_over_object


def test_jitter_of_a_fast_hand_over_its_object_is_taken_out():
    context, time = scene(LONG), torch.arange(LONG) / 30
    sweep = 0.08 * torch.stack([torch.cos(6 * time), torch.sin(6 * time), 0 * time], -1)
    truth = hands_at(context)[0] + sweep[:, None] @ context.rotation[:, 0].mT
    jitter = 0.005 * torch.randn(LONG, 21, 3, generator=seeded())
    left = (truth + 0.6 * jitter)[None]
    calm = without_jitter_over_object(context, left, truth + jitter)
    off = [float((points - truth).norm(dim=-1).mean()) for points in (left, calm)]
    assert off[1] < 0.75 * off[0]
    assert torch.equal(
        without_jitter_over_object(context, truth[None], truth + jitter), truth[None]
    )
    assert torch.equal(without_jitter_over_object(context, left, truth), left)
