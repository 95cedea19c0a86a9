"""Holds that are looked for anew, on a ball that a drawn hand is stuck in."""

from dataclasses import replace

import pytest
import torch
import trimesh
from draws import seeded
from made_actions import box_actions, on_object

from geneoh.generators.text2hoi.physics import held_hands, settling
from geneoh.generators.text2hoi.physics.held_hands import FIRM, HeldHands, Holding, lifted, new_hold
from geneoh.generators.text2hoi.physics.settling import settled, solid_of
from geneoh.generators.text2hoi.physics.standing import stand_on_table
from geneoh.geometry.mesh_files import from_trimesh
from geneoh.synthesis.grasping.contact_pads import Obstacles, Table
from geneoh.synthesis.grasping.grasp_types import FINGER_MEAN

RADIUS = 0.035
TABLE = Table(torch.tensor([[0.0, 0.0, 1.0]]), torch.tensor([RADIUS]))
"""That the ball lies on, from its middle."""


@pytest.fixture(scope="module")
def ball():
    return stand_on_table(from_trimesh(trimesh.creation.icosphere(4, RADIUS)), generator=seeded())


@pytest.fixture(scope="module")
def grid(ball):
    return solid_of(ball)


@pytest.fixture(scope="module")
def solids(grid):
    return grid[0]


@pytest.fixture(scope="module")
def stuck():
    """A hand whose palm is in the middle of the ball, with its fingers beyond it."""
    pose = torch.cat([torch.zeros(1, 3), FINGER_MEAN])[None]
    return HeldHands(pose, torch.tensor([[0.09, 0.0, 0.0]]))


@pytest.fixture(scope="module")
def found(solids, stuck):
    return new_hold(solids, stuck, Obstacles(TABLE), seeded())


def test_a_new_hold_is_firm_and_on_the_side_of_the_drawn_hand(solids, stuck, found):
    assert Holding.of(solids, stuck).loose > FIRM
    assert Holding.of(solids, found).loose < FIRM
    centers, radii = found.spheres
    assert (radii - solids.signed_distance(centers)).max() < 0.004
    assert torch.nn.functional.cosine_similarity(found.wrist, stuck.wrist) > 0


def test_a_new_hold_is_over_the_table(stuck, found):
    assert TABLE.depth(*stuck.spheres).amax() > 0.01
    assert TABLE.depth(*found.spheres).amax() < 0.008


def test_a_new_hold_keeps_out_of_the_other_hand(solids, stuck, found):
    left = found.mirrored_spheres
    other = replace(left, centers=left.centers + torch.tensor([0.03, 0.0, 0.0]))
    assert other.depth(*found.spheres).max() > 0.006
    aside = new_hold(solids, stuck, Obstacles(TABLE, other), seeded())
    assert aside is not None
    assert other.depth(*aside.spheres).max() < 0.006


def test_an_object_that_no_hand_can_hold_gets_no_new_hold(ball, stuck):
    mesh = from_trimesh(trimesh.creation.icosphere(3, 0.9))
    solids = solid_of(replace(ball, mesh=mesh))[0]
    assert new_hold(solids, stuck, Obstacles(TABLE), seeded()) is None


def test_of_two_hands_one_may_hold_loosely_and_away_from_the_other(
    solids, stuck, found, monkeypatch
):
    other, asked = found.mirrored_spheres, []

    def loose(solids, toward, beside, generator):
        asked.append(toward.mean(0))
        each = found.take(torch.zeros(len(toward), dtype=torch.long), "N")
        return each, torch.full((len(toward),), len(asked) > 1)

    monkeypatch.setattr(held_hands, "new_grasps", loose)
    monkeypatch.setattr(held_hands, "FIRM", -1.0)
    assert new_hold(solids, stuck, Obstacles(TABLE, other), seeded()) is None
    asked.clear()
    taken = new_hold(solids, stuck, Obstacles(TABLE, other), seeded(), alone=False)
    assert torch.equal(taken.wrist, found.wrist)
    assert asked[1] @ other.centers[0].mean(0) < 0


def test_a_hand_that_is_stuck_in_what_it_lifts_holds_it(ball, grid, monkeypatch):
    monkeypatch.setattr(settling, "solid_of", lambda _: grid)
    before = on_object(box_actions(["lift"], frames=24, hands=(False, True)), ball)
    pose, wrist = torch.zeros(1, 2, 24, 16, 3), torch.zeros(1, 2, 24, 3)
    pose[:, 1, :, 1:] = FINGER_MEAN
    wrist[:, 1] = torch.tensor([0.09, 0.0, RADIUS]) + before.translation
    before, (solids, middle) = replace(before, pose=pose, wrist=wrist), grid
    after = settled(before, ball, generator=seeded())
    hand = HeldHands.of(after, 1, middle).take(slice(12, 13), "N")
    assert Holding.of(solids, hand).loose < FIRM
    assert lifted(before, torch.ones(24, dtype=torch.bool))
    # an object that stays at its height is pushed, which needs no hold
    pushed = before.translation.flip(-1)
    assert not lifted(replace(before, translation=pushed), torch.ones(24, dtype=torch.bool))
