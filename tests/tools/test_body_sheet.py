import torch

from geneoh.body.skeleton import embedded_skeleton
from tools.body_sheet import body_of


def test_the_hand_that_is_asked_for_waves_on_a_body_of_other_proportions():
    body = body_of("rest", "wave", 0)
    assert (body.frames, body.fps) == (150, 30.0)
    assert not torch.equal(body.skeleton.offsets, embedded_skeleton().offsets)
    moved = (
        (body.motion.rotations[1:, 18:20] - body.motion.rotations[:-1, 18:20]).abs().mean((0, 2, 3))
    )
    assert moved[1] > 2 * moved[0]  # the right elbow and the left one
