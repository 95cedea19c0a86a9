import pytest
import torch
from draws import normal

from geneoh.denoisers.temporal import TemporalEvidence
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.region import ObjectSurface

FRAMES = 6


def surface() -> ObjectSurface:
    """Two balls that move by themselves, each a part."""
    normals = torch.nn.functional.normalize(normal(1, 80, 3), dim=-1)
    part = (torch.arange(80) % 2)[None]
    return ObjectSurface(
        0.03 * normals,
        normals,
        part,
        axis_angle_to_matrix(0.3 * normal(1, FRAMES, 2, 3, seed=1)),
        torch.tensor([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]) + 0.02 * normal(1, FRAMES, 2, 3, seed=2),
    )


def held_by(part: int, seed: int = 3) -> torch.Tensor:
    """Keypoints that stand still on the ball of a part, in the world."""
    local = 0.032 * torch.nn.functional.normalize(normal(1, 1, 21, 3, seed=seed), dim=-1)
    there = surface()
    return local @ there.rotation[:, :, part].mT + there.translation[:, :, part, None]


def motion_of(joints: torch.Tensor, there: ObjectSurface) -> TemporalEvidence:
    return TemporalEvidence.at(there, joints, joints, torch.ones(1, FRAMES))


@pytest.mark.parametrize("part", [0, 1])
def test_what_moves_with_a_part_makes_no_step_over_it(part):
    motion = motion_of(held_by(part), surface())
    assert float(motion.steps.abs().max()) < 1e-6
    still = motion.joints.diff(dim=1).norm(dim=-1)
    assert (float(still.max()) < 1e-6) == (part == 0)


@pytest.mark.parametrize("part", [0, 1])
def test_a_step_over_a_part_is_the_motion_seen_from_it(part):
    there, push = surface(), 0.002 * normal(1, FRAMES, 21, 3, seed=5)
    moved = held_by(part) + push @ there.rotation[:, :, part].mT
    steps = motion_of(moved, there).steps[:, :-1]
    torch.testing.assert_close(steps.norm(dim=-1), push.diff(dim=1).norm(dim=-1), atol=1e-6, rtol=0)


def test_the_last_frame_has_no_step():
    motion = motion_of(held_by(0) + 0.01 * normal(1, FRAMES, 21, 3), surface())
    assert bool((motion.steps[:, -1] == 0).all())


def test_it_does_not_depend_on_where_the_scene_is():
    there, joints = surface(), held_by(1) + 0.004 * normal(1, FRAMES, 21, 3, seed=7)
    turn, shift = axis_angle_to_matrix(torch.tensor([0.3, -0.8, 0.5])), torch.tensor([0.4, 1, -0.2])
    moved = ObjectSurface(
        there.points,
        there.normals,
        there.part,
        turn @ there.rotation,
        there.translation @ turn.mT + shift,
    )
    here = motion_of(joints, there)
    other = motion_of(joints @ turn.mT + shift, moved)
    for name in ("joints", "nearest", "normals", "carried"):
        torch.testing.assert_close(getattr(other, name), getattr(here, name), atol=1e-5, rtol=0)
    torch.testing.assert_close(other.from_world(joints @ turn.mT + shift), here.joints)


def test_the_last_frame_of_a_window_has_no_step_on_a_part_that_moves():
    whole = motion_of(held_by(1), surface())
    window = whole.map(lambda values: values[:, :3])
    assert bool((window.steps[:, -1] == 0).all())
    torch.testing.assert_close(window.steps[:, :-1], whole.steps[:, :2])
