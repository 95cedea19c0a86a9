from dataclasses import replace

import pytest
import torch
from draws import seeded
from made_grasps import grasps_at
from torch import Tensor

from geneoh.errors import ConfigError
from geneoh.evaluation.generation.measures import measure_clips
from geneoh.geometry.mirror import mirror_points
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import forward_kinematics
from geneoh.synthesis.actions.acting import ActingConfig, act, overlap_of_hands
from geneoh.synthesis.actions.action import LONGEST, VERBS, Actions
from geneoh.synthesis.actions.setups import CONTAINERS, SetupConfig, is_container
from geneoh.synthesis.grasping.grasps import Grasps
from geneoh.synthesis.motions.clearance import ClearanceConfig
from geneoh.synthesis.motions.hand_motion import HandMotionConfig
from geneoh.synthesis.shapes.families import FAMILIES
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shapes.solids import Solids

FAMILY = ["mug", "box", "bottle", "cylinder", "bowl", "hammer", "carton", "laptop"]
CALM = replace(ActingConfig().hand, tremor=0.0, open_tremor=0.0, shift_noise=0.0, turn_noise=0.0)


def held_from_above(count: int, kind: str = "power") -> tuple[Grasps, Solids, list[str]]:
    """Hands over objects; whether they touch is not what moves them."""
    generator = seeded()
    families = [FAMILY[i % len(FAMILY)] for i in range(count)]
    wrist = torch.tensor([0.08, 0.05, 0.25]) + 0.01 * torch.randn(count, 3, generator=generator)
    return grasps_at(wrist, kind=kind), draw_objects(families, generator=generator), families


def acted(config: ActingConfig, count: int = 24, overlap: float = 1.0, points: int = 64) -> Actions:
    """What they do; two of them may be in each other."""
    config = replace(config, overlap=overlap)
    grasps, solids, families = held_from_above(count)
    numbers = {name: index for index, name in enumerate(FAMILIES)}
    generator = seeded(1)
    return act(grasps, solids, families, numbers, points, config, generator=generator)


def in_the_object(actions: Actions, side: int) -> Tensor:
    """Wrists of one side in the frame of the object."""
    apart = actions.wrist[:, side] - actions.translation
    return (actions.rotation.mT @ apart[..., None])[..., 0]


def test_ways_that_lead_through_the_object_are_drawn_again():
    crossing = HandMotionConfig(away_std=0.25, away_distance=(0.0, 0.0), table_height=-1.0)

    def deepest(draws: int) -> Tensor:
        """How deep each clip's hands come into its object, millimetres."""
        clearance = ClearanceConfig(draws=draws)
        config = ActingConfig(hand=crossing, clearance=clearance)
        return measure_clips(acted(config, points=512)).deepest_mm

    once, often = deepest(1), deepest(8)
    assert (once > 12).sum() > 2
    assert (often < 12).all()


def test_objects_stand_on_the_table_with_their_middle_above_the_origin():
    points = acted(ActingConfig()).points
    assert points[..., 2].amin(1).abs().amax() < 1e-6
    assert points[..., :2].mean(1).abs().amax() < 1e-6


def test_a_hand_that_holds_stays_where_it_is_in_the_object_while_that_moves():
    actions = acted(ActingConfig(hand=CALM, setup=SetupConfig(image_share=0.0)))
    for index in range(len(actions.verb)):
        if VERBS[actions.verb[index]] in ("open", "close", "pass"):
            continue
        side = int(actions.hands[index].long().argmax())
        moves = actions.translation[index].diff(dim=0).norm(dim=-1) > 1e-6
        turned = actions.rotation[index].diff(dim=0).flatten(1).norm(dim=-1) > 1e-6
        place = in_the_object(actions, side)[index, 1:][moves | turned]
        if len(place):
            assert (place - place[0]).norm(dim=-1).amax() < 1e-4


def test_hands_and_objects_start_and_end_at_rest():
    actions = acted(ActingConfig(hand=CALM))
    for index, length in enumerate(actions.length.tolist()):
        for motion in (actions.wrist[index].transpose(0, 1), actions.translation[index]):
            speed = motion.diff(dim=0).flatten(1).norm(dim=-1)
            assert speed[0] < 2e-3
            assert speed[length - 2] < 2e-3


def test_actions_end_within_five_seconds_and_stay_as_they_ended():
    actions = acted(ActingConfig())
    assert actions.length.amin() >= 2
    assert actions.length.amax() <= LONGEST
    for index, length in enumerate(actions.length.tolist()):
        after = actions.wrist[index, :, length - 1 :]
        assert (after == after[:, :1]).all()
    assert torch.equal(actions.valid.sum(1), actions.length)


def test_a_mirror_image_is_of_the_other_hand_and_twice_the_same():
    actions = acted(ActingConfig(left=0.0, setup=SetupConfig(image_share=0.0)))
    image = actions.mirrored()
    assert torch.equal(image.hands, actions.hands.flip(1))
    again = image.mirrored()
    for name in ("pose", "wrist", "rotation", "translation", "points", "axis", "pivot"):
        assert torch.allclose(getattr(again, name), getattr(actions, name), atol=1e-6)
    right, left = load_hand("right"), load_hand("left")
    offsets = [hand.shaped(torch.zeros(1, 10)).offsets for hand in (left, right)]
    frames = [
        forward_kinematics(axis_angle_to_matrix(a.pose[:, s]), a.wrist[:, s], offsets[s])[0]
        for a, s in ((image, 0), (actions, 1))
    ]
    assert torch.allclose(frames[0], mirror_points(frames[1]), atol=1e-5)
    moved = (image.posed_points() @ image.rotation.mT) + image.translation[:, :, None]
    own = (actions.posed_points() @ actions.rotation.mT) + actions.translation[:, :, None]
    assert torch.allclose(moved, mirror_points(own), atol=1e-5)


def test_the_mirror_image_of_a_hand_on_a_symmetric_object_is_the_other_hand():
    actions = acted(
        ActingConfig(setup=SetupConfig(image_share=1.0, gap=0.0, both=1.0, under_table_both=9.0))
    )
    both = actions.hands.all(1)
    assert both.any()
    apart = (actions.wrist[both, 0] - actions.wrist[both, 1]).norm(dim=-1)
    assert (apart > 0.01).all()
    assert not (actions.verb[both] == VERBS.index("pass")).any()


def test_two_hands_that_meet_on_their_ways_do_nothing():
    config = ActingConfig(
        setup=SetupConfig(image_share=1.0, gap=0.0, both=1.0, under_table_both=9.0)
    )
    deep = overlap_of_hands(acted(config))
    kept = acted(config, overlap=float(deep.median()))
    assert torch.equal(overlap_of_hands(kept), deep[deep < deep.median()])


def test_the_overlap_of_two_hands_is_the_largest_over_all_frames():
    """Hands on the palms of each other meet as they come near, and one hand meets none."""
    away = acted(ActingConfig(left=0.0, setup=SetupConfig(image_share=0.0))).take(slice(2), "B")
    assert torch.equal(overlap_of_hands(away), torch.zeros(2))
    image = away.mirrored()
    both = replace(
        away,
        hands=torch.ones_like(away.hands),
        pose=away.pose + image.pose,
        wrist=away.wrist + image.wrist + torch.tensor([[0.0, 0, 0], [1.0, 0, 0]])[None, :, None],
    )
    assert torch.equal(overlap_of_hands(both), torch.zeros(2))
    near = both.wrist.clone()
    near[0, 0, 40] = near[0, 1, 40]
    assert (overlap_of_hands(replace(both, wrist=near)) > 0.005).tolist() == [True, False]


def test_what_is_passed_goes_from_one_hand_to_the_other():
    actions = acted(
        ActingConfig(setup=SetupConfig(image_share=1.0, gap=0.0, both=0.0, under_table_both=9.0))
    )
    passed = actions.verb == VERBS.index("pass")
    assert passed.any()
    assert actions.hands[passed].all()
    places = [in_the_object(actions, side)[passed] for side in range(2)]
    away = [place - place[:, 60:61] for place in places]
    start, end = (torch.stack([a[:, at].norm(dim=-1) for a in away], 1) for at in (0, -1))
    assert (start > 0.02).all()  # both come from elsewhere
    assert (end > 0.02).any(1).all()


def test_a_flat_hand_on_top_presses_and_moves_nothing():
    grasps, solids, families = held_from_above(8, "support")
    numbers = {name: index for index, name in enumerate(FAMILIES)}
    generator = seeded(1)
    actions = act(grasps, solids, families, numbers, 64, generator=generator)
    assert (actions.verb == VERBS.index("press")).all()
    assert (actions.translation.diff(dim=1).abs() < 1e-6).all()


def test_no_grasp_makes_no_action():
    grasps, solids, _ = held_from_above(8)
    none = torch.zeros(0, dtype=torch.long)
    generator = seeded(1)
    actions = act(grasps.take(none, "B"), solids.take(none, "B"), [], {}, 64, generator=generator)
    assert len(actions.verb) == 0


def test_hands_below_the_table_do_nothing():
    grasps, solids, families = held_from_above(8)
    below = replace(grasps, wrist=grasps.wrist * torch.tensor([1.0, 1.0, -1.0]))
    numbers = {name: index for index, name in enumerate(FAMILIES)}
    generator = seeded(1)
    upright = [i for i, name in enumerate(families) if name in ("mug", "bowl", "laptop")]
    which = torch.tensor(upright)
    actions = act(
        below.take(which, "B"),
        solids.take(which, "B"),
        [families[i] for i in upright],
        numbers,
        64,
        generator=generator,
    )
    assert len(actions.verb) == 0


@pytest.mark.parametrize("wrong", [{"leave": 112.0}, {"held": (8.0, 112.0)}, {"left": 1.5}])
def test_settings_with_which_no_action_can_be_made_are_refused(wrong):
    (name,) = wrong
    with pytest.raises(ConfigError, match=f"ActingConfig: .*'{name}'"):
        ActingConfig(**wrong)


@pytest.mark.parametrize(
    ("name", "holds"),
    [
        (CONTAINERS[0], True),
        ("ycb_065-a_cups.ply", True),
        ("ycb_005_tomato_soup_can", True),
        ("blue mug_2.obj", True),
        ("_.obj", False),
        ("box", False),
        ("gso_can_opener", False),
        ("ycb_028_skillet_lid", False),
    ],
)
def test_things_are_poured_from_containers(name, holds):
    assert is_container(name) == holds
