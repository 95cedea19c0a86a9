"""An articulated object from its files to the stages: whose frame, and whose contact points."""

from dataclasses import replace

import pytest
import torch
import trees

from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.stages import run


@pytest.fixture(scope="module")
def regions(arctic):
    """The contact points of each hand as the first stage sees them, the left one mirrored."""
    moving = [arctic.object.mirrored() if h.side == "left" else arctic.object for h in arctic.hands]
    return list(zip(regions_of(arctic), moving, strict=True))


def regions_of(sequence):
    """The contact points of each hand of a sequence."""
    found, real = [], run.denoise_motion

    def spy(denoiser, hand, context, *rest, **options):
        found.append(context.region(hand.joints))
        return real(denoiser, hand, context, *rest, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(run, "denoise_motion", spy)
        denoise(sequence, Options(preset="fast"))
    return found


def test_the_canonical_frame_turns_with_the_first_part(regions):
    assert len(regions) == 2
    for region, moving in regions:
        torch.testing.assert_close(region.rotation[0], moving.rotation[:, 0])
        apart = (region.rotation[0] - moving.rotation[:, 1]).abs().amax((1, 2))
        assert float(apart.min()) > 0.1  # the lid stands open, and its frame is another one


def test_the_canonical_frame_is_not_that_of_what_the_other_hand_holds(arctic):
    hand, held = arctic.hand("right")[:4], arctic.object[:4]
    turning = axis_angle_to_matrix(torch.linspace(0, 1, 4)[:, None, None] * torch.ones(3))
    both = replace(
        held,
        meshes=(held.meshes[1], *held.meshes),
        rotation=torch.cat([turning, held.rotation], 1),
        translation=torch.cat([held.translation[:, :1] + 0.5, held.translation], 1),
    )
    (region,) = regions_of(replace(arctic, hands=(hand,), object=both))
    torch.testing.assert_close(region.rotation[0], held.rotation[:, 0])


def test_contact_points_lie_on_all_parts_and_each_moves_with_its_own(regions):
    for region, moving in regions:
        world = region.points[0]
        local = torch.einsum(
            "tqij,tkqi->tkqj", moving.rotation, world[:, :, None] - moving.translation[:, None]
        )
        still = (local - local[:1]).norm(dim=-1).amax(0) < 1e-5
        assert bool((still.sum(-1) == 1).all())
        assert bool(still.any(0).all())


def test_the_frames_origin_is_the_middle_of_the_contact_points_of_all_parts(regions):
    for region, _ in regions:
        torch.testing.assert_close(region.center, region.points.mean(-2))


def test_the_first_part_is_the_one_that_the_whole_object_moves_with(arctic):
    s = trees.scene()
    bottom, top = arctic.object.meshes
    torch.testing.assert_close(arctic.object.rotation[:, 0].double(), torch.from_numpy(s.rotation))
    assert float(bottom.verts[:, 1].max()) < float(top.verts[:, 1].max())
