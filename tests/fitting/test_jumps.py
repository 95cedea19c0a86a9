"""Jumps of a fitted hand from one side of the object to the other are spread over some frames."""

from dataclasses import replace

import torch

from geneoh.fitting.fit_config import FitConfig
from geneoh.fitting.jumps import LARGEST_BEND, without_jumps


def bend(joints: torch.Tensor) -> float:
    return float(joints.diff(n=2, dim=1).norm(dim=-1).max())


def test_a_frame_that_leaves_by_the_other_side_is_calmed(shaped, make_state):
    still = make_state(frames=1)
    target = still.joints(shaped).expand(1, 30, -1, -1)
    wrist = still.wrist.expand(1, 30, -1).clone()
    wrist[:, 12] += torch.tensor([0.0, 0.016, 0.0])
    state = replace(still, rotations=still.rotations.expand(1, 30, -1, -1, -1), wrist=wrist)
    calm = without_jumps(state, target, shaped, FitConfig())
    assert bend(state.joints(shaped)) > 0.03
    assert bend(calm.joints(shaped)) < 0.004
    assert (calm.joints(shaped) - target).norm(dim=-1).max() < 0.004
    assert torch.equal(calm.wrist[:, 22:], state.wrist[:, 22:])


def test_a_hand_that_changes_its_side_for_good_does_so_within_some_frames(shaped, make_state):
    still = make_state(frames=1)
    target = still.joints(shaped).expand(1, 30, -1, -1)
    side = torch.where(torch.arange(30) < 15, 0.012, -0.012)
    wrist = still.wrist + side[:, None] * torch.tensor([0.0, 1.0, 0.0])
    state = replace(still, rotations=still.rotations.expand(1, 30, -1, -1, -1), wrist=wrist)
    calm = without_jumps(state, target, shaped, FitConfig())
    assert bend(state.joints(shaped)) > 0.02
    assert bend(calm.joints(shaped)) < 0.01
    torch.testing.assert_close(calm.wrist[:, [0, -1]], state.wrist[:, [0, -1]])


def test_a_short_track_is_calmed_too(shaped, make_state):
    still = make_state(frames=1)
    target = still.joints(shaped).expand(1, 8, -1, -1)
    wrist = still.wrist + 0.02 * (torch.arange(8) > 3)[:, None]
    state = replace(still, rotations=still.rotations.expand(1, 8, -1, -1, -1), wrist=wrist)
    calm = without_jumps(state, target, shaped, FitConfig())
    assert bend(calm.joints(shaped)) < 0.7 * bend(state.joints(shaped))


def test_a_hand_without_a_jump_stays_as_it_is(shaped, make_state):
    state = make_state(frames=1)
    state = replace(
        state,
        rotations=state.rotations.expand(1, 9, -1, -1, -1),
        wrist=state.wrist.expand(1, 9, -1),
    )
    target = state.joints(shaped) + 0.2 * LARGEST_BEND * torch.rand(1, 9, 21, 3)
    assert without_jumps(state, target, shaped, FitConfig()) is state
    wild = replace(state, wrist=state.wrist + 0.03 * torch.arange(9)[:, None].remainder(2))
    assert without_jumps(wild, target, shaped, FitConfig()) is wild
    short = state[:2]
    assert without_jumps(short, target[:, :2], shaped, FitConfig()) is short
