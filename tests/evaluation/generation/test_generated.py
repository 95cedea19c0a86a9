from dataclasses import replace

import torch
from made_actions import box_actions

from geneoh.evaluation.generation import generated
from geneoh.generators.text2hoi.library import load_networks
from geneoh.generators.text2hoi.samples import ActionData
from geneoh.streamed import Streamed


def test_clips_that_are_drawn_apart_may_differ_in_length(monkeypatch):
    monkeypatch.setattr(generated, "AT_ONCE", 1)
    clips = box_actions(["lift", "carry"], frames=40, points=256)
    clips = replace(clips, length=torch.tensor([40, 24])).ended()
    data = ActionData(Streamed.of([clips]), ("box", "mug"))
    drawn = generated.draw_clips(load_networks(), data, generator=torch.Generator().manual_seed(0))
    assert drawn.actions.length.tolist() == [40, 24]
    assert drawn.actions.joint.shape == (2, 40)
    assert torch.equal(drawn.actions.wrist, drawn.actions.ended().wrist)
