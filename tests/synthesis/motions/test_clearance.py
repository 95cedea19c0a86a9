from dataclasses import replace

import pytest
import torch
from draws import seeded
from torch import Tensor

from geneoh.errors import ConfigError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.synthesis.attempts import draw_attempts, tried_grasps
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.grasping.bimanual import grasp_directions
from geneoh.synthesis.motions.clearance import ClearanceConfig, MovingSolids, clear_ways
from geneoh.synthesis.motions.hand_motion import HandPath
from geneoh.synthesis.motions.motion import AnimationConfig, animate
from geneoh.synthesis.shapes.objects import draw_objects

FRAMES = 12
BESIDE = 0.5
"""A hand is this far from the box when it is beside it, metres."""


def hands_at(*places: float) -> HandPath:
    """Flat hands that stay at places along x, one for each."""
    wrist = torch.zeros(len(places), FRAMES, 3)
    wrist[..., 0] = torch.tensor(places)[:, None]
    turn = torch.eye(3).expand(len(places), FRAMES, 3, 3)
    return HandPath(wrist, turn, torch.zeros(len(places), FRAMES, 15, 3))


def boxes(count: int) -> tuple[MovingSolids, Tensor]:
    """Boxes at rest around the origin, and the bones of the hands at them."""
    solids = draw_objects(["box"] * count, generator=seeded(3))
    rotation = torch.eye(3).expand(count, FRAMES, 2, 3, 3)
    objects = MovingSolids(solids, rotation, torch.zeros(count, FRAMES, 2, 3))
    return objects, load_hand("right").shaped(torch.zeros(count, 10)).offsets


def test_a_hand_in_a_box_is_deep_and_one_beside_it_is_not():
    objects, offsets = boxes(2)
    depth = objects.depth(hands_at(0.08, BESIDE), offsets)
    assert (depth[0] > 0.005).all()
    assert (depth[1] < -0.2).all()


def test_the_depth_is_the_same_wherever_hand_and_object_are_carried():
    objects, offsets = boxes(2)
    hands = hands_at(0.08, 0.15)
    turn = axis_angle_to_matrix(torch.tensor([0.3, -0.8, 1.1])).expand(2, FRAMES, 3, 3)
    shift = torch.linspace(0, 1, 2 * FRAMES * 3).view(2, FRAMES, 3)
    carried = replace(
        objects,
        rotation=turn[:, :, None].expand(2, FRAMES, 2, 3, 3),
        translation=shift[:, :, None].expand(2, FRAMES, 2, 3),
    )
    there = carried.depth(hands.moved(turn, shift), offsets)
    torch.testing.assert_close(there, objects.depth(hands, offsets), atol=1e-5, rtol=0)


def test_a_hand_meets_the_part_that_a_joint_has_moved_to_it():
    solids = draw_objects(["drawer"], generator=seeded(3))
    rotation = torch.eye(3).expand(1, FRAMES, 2, 3, 3)
    translation = torch.zeros(1, FRAMES, 2, 3)
    translation[:, FRAMES // 2 :, 1, 0] = BESIDE
    offsets = load_hand("right").shaped(torch.zeros(1, 10)).offsets
    objects = MovingSolids(solids, rotation, translation)
    depth = objects.depth(hands_at(BESIDE + 0.08), offsets)[0]
    assert (depth[: FRAMES // 2] < -0.1).all()
    assert (depth[FRAMES // 2 :] > depth[: FRAMES // 2].max() + 0.1).all()


def test_only_hands_that_are_deep_get_another_way_and_that_until_it_is_clear():
    objects, offsets = boxes(3)
    asked: list[list[int]] = []
    ways = iter([(0.08, BESIDE, 0.08), (BESIDE, 0.08), (BESIDE,)])

    def draw(clips: Tensor) -> HandPath:
        asked.append(clips.tolist())
        return hands_at(*next(ways))

    hands = clear_ways(draw, objects, offsets, ClearanceConfig())
    assert asked == [[0, 1, 2], [0, 2], [2]]
    assert (hands.wrist[..., 0] == BESIDE).all()


def test_the_shallowest_way_is_taken_where_none_is_clear():
    objects, offsets = boxes(1)
    places = [0.08, 0.0, 0.1, 0.05]
    depth = [float(objects.depth(hands_at(place), offsets).amax()) for place in places]
    assert min(depth) > ClearanceConfig().depth
    ways = iter(places)
    hands = clear_ways(
        lambda _: hands_at(next(ways)), objects, offsets, ClearanceConfig(draws=len(places))
    )
    assert float(hands.wrist[0, 0, 0]) == torch.tensor(places)[depth.index(min(depth))]


def test_hands_of_made_clips_seldom_lead_through_the_object():
    config = SynthesisConfig()
    generator = seeded(5)
    tried = draw_attempts(config, list(config.common), 32, generator=generator)
    grasps = tried_grasps(tried, config, grasp_directions(tried.solids, tried.shared), generator)
    kept, solids = grasps.take(grasps.kept, "B"), tried.solids.take(grasps.kept, "B")

    def deepest(draws: int) -> Tensor:
        """Depth of the deepest sphere of each hand when so many ways are drawn, metres."""
        animation = AnimationConfig(clearance=ClearanceConfig(draws=draws))
        clips = animate(kept, solids, 120, 16, animation, generator=seeded(6))
        objects = MovingSolids(solids, clips.rotation, clips.translation)
        hands = HandPath(
            clips.wrist, axis_angle_to_matrix(clips.pose[:, :, 0]), clips.pose[:, :, 1:]
        )
        return objects.depth(hands, clips.offsets).amax(1)

    once, often = deepest(1), deepest(8)
    # depths are measured at every second frame, so that a way may be a little deeper between
    assert (often <= once + 0.001).all()
    assert (once > 0.01).sum() > 8
    assert (often > 0.01).sum() <= (once > 0.01).sum() / 2


@pytest.mark.parametrize("wrong", [{"every": 0}, {"draws": 0}, {"depth": -0.001}])
def test_impossible_settings_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        ClearanceConfig(**wrong)
