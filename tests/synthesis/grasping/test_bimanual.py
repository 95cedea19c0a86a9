import torch
from draws import seeded
from made_grasps import grasps_at
from torch import Tensor

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.attempts import draw_attempts
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.grasping.bimanual import (
    BimanualConfig,
    bimanual_objects,
    grasp_directions,
    pair_hands,
)
from geneoh.synthesis.grasping.grasps import GraspConfig, Grasps, synthesize_grasps
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.solids import Solids

CONFIG = BimanualConfig()
FLIP = torch.tensor([-1.0, 1.0, 1.0])


def longest(solids: Solids) -> Tensor:
    points, _ = solids.surface_points(64, generator=seeded())
    return points.abs().amax((1, 2))


def test_second_hands_are_tried_on_the_largest_objects():
    names = ["coin", "carton", "ring", "board", "pen", "plate", "ball", "pan", "mouse", "phone"]
    solids = draw_objects(names, generator=seeded(1))
    lead = bimanual_objects(solids, len(names), CONFIG)
    assert len(lead) == int(CONFIG.share * len(names))
    extent = longest(solids)
    assert float(extent[lead].min()) > float(extent.median())


def test_two_hands_come_from_the_two_ends():
    solids = draw_objects(["hammer", "coin", "pan", "hammer", "pan"], generator=seeded(2))
    side = grasp_directions(solids, torch.tensor([0, 2]))
    want = torch.tensor([[0.0, 0, 1], [0, 0, 0], [1, 0, 0], [0, 0, -1], [1, 0, 0]])
    # along x the mirror turns the other end around once more
    assert torch.equal(side, want)


def hands(shift: Tensor) -> Grasps:
    """Two first hands and, as tried last, two second hands moved by so much along y."""
    wrist = torch.zeros(4, 3)
    wrist[2:, 1] = shift
    return grasps_at(wrist)


def test_hands_that_meet_are_no_pair():
    pairs = pair_hands(hands(torch.tensor([0.3, 0.0])), torch.tensor([0, 1]), CONFIG)
    assert pairs.first.tolist() == [-1, -1, 0, -1]


def test_a_pair_needs_both_hands_and_is_counted_among_those_kept():
    grasps = hands(torch.tensor([0.3, 0.3]))
    grasps.kept[0] = False
    # the second of the one that is gone is alone; the others have moved up by one
    assert pair_hands(grasps, torch.tensor([0, 1]), CONFIG).first.tolist() == [-1, -1, 0]


def test_two_hands_are_made_and_do_not_meet_in_the_world():
    families = ["hammer", "pan"]
    tried = draw_attempts(SynthesisConfig(), families, 46, generator=seeded(3))
    lead = bimanual_objects(tried.solids, 96, CONFIG)
    side = grasp_directions(tried.solids, lead)
    grasps = synthesize_grasps(
        tried.solids,
        tried.hands.offsets,
        GraspConfig(steps=90),
        generator=seeded(4),
        toward=side,
    )
    first = pair_hands(grasps, lead, CONFIG).first
    kept = grasps.take(grasps.kept, "B")
    turns = axis_angle_to_matrix(kept.pose)
    joints, _ = forward_kinematics(turns, kept.wrist, kept.offsets)
    pairs = [(int(first[i]), i) for i in torch.nonzero(first >= 0)[:, 0].tolist()]
    assert pairs, "some pairs are kept"
    for one, two in pairs:
        assert float(torch.cdist(joints[one], joints[two] * FLIP).min()) > CONFIG.gap
        bones = (kept.offsets[one].norm(dim=-1) / kept.offsets[two].norm(dim=-1) - 1).abs()
        assert 0 < float(bones.max()) < 0.03, "one person's hands, but not one hand"
    # the object of a second hand is the first one's in a mirror
    points = 0.05 * torch.randn(len(lead), 50, 3, generator=seeded(5))
    mirrored = tried.solids.take(torch.arange(96, 96 + len(lead)), "B")
    torch.testing.assert_close(
        mirrored.signed_distance(points * FLIP),
        tried.solids.take(lead, "B").signed_distance(points),
    )
