from dataclasses import fields, replace

import pytest
import torch
from draws import seeded
from hypothesis import given
from hypothesis import strategies as st

from geneoh.denoisers.base import POINTS
from geneoh.denoisers.spatial import TRACK_CUES
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.skeleton import bone_lengths
from geneoh.representation.nearest_surface import nearest_points
from geneoh.representation.parameters import HandParameters
from geneoh.sequence.gaps import observed_around
from geneoh.streamed import Streamed
from geneoh.synthesis.draws import Draws
from geneoh.synthesis.motions.motion import Interactions
from geneoh.training.augmentation import AugmentationConfig, KeptContactConfig
from geneoh.training.batches import Batch, after_motion, draw_batch
from geneoh.training.config import TrainConfig
from geneoh.training.stages import build_model
from geneoh.training.windows import WindowConfig, filled

WINDOW, CONFIG = WindowConfig().frames, TrainConfig()


def drawn(interactions: Interactions, size: int, config: TrainConfig = CONFIG, **how) -> Batch:
    """A batch of one shard."""
    return draw_batch(Streamed.of([interactions]), size, config, **how)


def tensors(batch: Batch) -> list[torch.Tensor]:
    motion = batch.motion
    parts = (batch, batch.region, batch.observation, batch.hand, motion, motion.hand)
    found = [getattr(part, f.name) for part in parts for f in fields(part)]
    return [value for value in found if isinstance(value, torch.Tensor)]


masks = st.lists(st.booleans(), min_size=1, max_size=9).filter(any)


@given(masks, masks)
def test_gaps_are_filled_as_a_sequences_gaps_are(first, second):
    frames = max(len(first), len(second))
    keep = torch.tensor([(mask * 9)[:frames] for mask in (first, second)])
    generator = seeded()
    hand = HandParameters(
        torch.randn(2, frames, 3, generator=generator),
        axis_angle_to_matrix(torch.randn(2, frames, 3, generator=generator)),
        torch.randn(2, frames, 15, 3, generator=generator),
        torch.randn(2, 20, 3, generator=generator),
    )
    got = filled(hand, keep)
    for b, mask in enumerate(keep):
        around = observed_around(mask)
        want = around.points(hand.wrist[b])
        torch.testing.assert_close(got.wrist[b], want, atol=1e-6, rtol=0)
        want = around.points(hand.fingers[b].flatten(1))
        torch.testing.assert_close(got.fingers[b].flatten(1), want, atol=1e-6, rtol=0)
        want = around.rotations(hand.turn[b][:, None])
        torch.testing.assert_close(got.turn[b][:, None], want, atol=1e-4, rtol=0)
        assert torch.equal(got.turn[b][mask], hand.turn[b][mask])
        assert torch.equal(got.wrist[b][mask], hand.wrist[b][mask])


@pytest.fixture(scope="module")
def batch(interactions) -> Batch:
    """One with full windows."""
    made = (drawn(interactions, 3, generator=seeded(i)) for i in range(20))
    return next(b for b in made if b.clean.shape[1] == WINDOW)


def test_a_batch_has_windows_contact_points_and_an_observation(batch):
    assert batch.clean.shape == batch.noisy.shape == (3, WINDOW, 21, 3)
    assert batch.region.points.shape == (3, WINDOW, POINTS, 3)
    assert batch.observation.trust.shape == (3, WINDOW, 21)
    assert all(bool(value.isfinite().all()) for value in tensors(batch))


def test_clean_hands_have_the_skeletons_of_the_data(batch, interactions):
    bones = bone_lengths(batch.clean)
    torch.testing.assert_close(bones, bones[:, :1].expand_as(bones), atol=1e-5, rtol=0)
    for offsets in batch.hand.offsets:
        assert any(torch.equal(offsets, known) for known in interactions.offsets)


def test_without_augmentation_clean_hands_are_those_of_the_data(interactions):
    config = TrainConfig(augmentation=AugmentationConfig(share=0.0, style_share=0.0))
    batch = drawn(interactions, 3, config, generator=seeded())
    wrists = interactions.wrist.flatten(0, 1)
    apart = (batch.clean[:, :, 0].flatten(0, 1)[:, None] - wrists).norm(dim=-1).amin(1)
    assert float(apart.max()) < 1e-5


def test_the_observation_is_the_noisy_hand_around_its_own_contact_points(batch):
    region = batch.region
    torch.testing.assert_close(batch.observation.joints, region.to_canon(batch.noisy))
    torch.testing.assert_close(region.to_world(batch.clean_canon), batch.clean)
    apart = (batch.noisy - batch.clean).norm(dim=-1)
    assert float(apart.mean()) > 1e-3


def test_motion_sees_the_same_hands_as_parameters(batch):
    torch.testing.assert_close(batch.hand.joints, batch.clean_canon, atol=1e-5, rtol=0)
    seen = batch.motion.hand.joints - batch.observation.joints
    assert float(seen.norm(dim=-1).mean()) < 0.01, "apart by the keypoints' own jitter at most"
    surface = (batch.motion.nearest - batch.motion.hand.joints).norm(dim=-1)
    far = batch.observation.joints[..., None, :] - batch.region.points_canon[:, :, None]
    assert bool((surface <= far.norm(dim=-1).amin(-1) + 0.03).all()), "the nearest of all points"


def test_wrists_of_frames_without_trust_lie_on_straight_lines(interactions):
    made = [drawn(interactions, 3, generator=seeded(i)) for i in range(6)]
    inside = 0
    for b in made:
        trust = b.motion.trust
        noisy = b.region.to_world(b.motion.hand.wrist[..., None, :])
        lost = (trust[:, 1:-1] == 0) & (trust[:, 2:] == 0) & (trust[:, :-2] == 0)
        bend = noisy.diff(n=2, dim=1).norm(dim=-1).amax(-1)
        assert bool((bend[lost] < 1e-5).all())
        inside += int(lost.sum())
    assert inside > 0, "some frames should be lost"


def test_equal_generators_draw_equal_batches(interactions):
    first, second, other = (drawn(interactions, 2, generator=seeded(s)) for s in (3, 3, 4))
    assert all(torch.equal(a, b) for a, b in zip(tensors(first), tensors(second), strict=True))
    assert first.clean.shape != other.clean.shape or not torch.equal(first.clean, other.clean)


def test_a_stage_that_follows_motion_sees_what_motion_leaves(interactions, tiny):
    model = build_model("motion", tiny)
    plain, after = (
        drawn(interactions, 3, generator=seeded(5), motion_denoiser=before)
        for before in (None, model)
    )
    assert torch.equal(plain.clean, after.clean)
    assert torch.equal(plain.motion.hand.wrist, after.motion.hand.wrist)
    # an untrained network is the skip path: what it leaves is the hand and the noise it was given
    change = after_motion(plain.motion, model, tiny, Draws(3, seeded(6)))
    left = plain.motion.hand.moved(change).to_world(plain.region).joints
    apart = (left - plain.noisy).norm(dim=-1).mean()
    assert 0.001 < float((after.noisy - plain.noisy).norm(dim=-1).mean()) < 3 * float(apart)
    torch.testing.assert_close(after.observation.joints, after.region.to_canon(after.noisy))
    torch.testing.assert_close(bone_lengths(after.noisy), bone_lengths(after.clean))
    assert not bool(plain.evidence.track.equal(after.evidence.track))
    assert torch.equal(after.evidence.joints, after.noisy)
    assert after.evidence.track.shape == (3, TRACK_CUES)
    assert bool(after.evidence.track.isfinite().all())


def test_one_batch_in_five_has_short_windows(interactions):
    surface = ("points", "normals", "part")
    few = replace(interactions, **{name: getattr(interactions, name)[:, :8] for name in surface})
    frames = [drawn(few, 1, generator=seeded(s)).clean.shape[1] for s in range(16)]
    short = [f for f in frames if f < WINDOW]
    assert 1 <= len(short) <= 9
    assert min(short) >= 2


def test_clips_shorter_than_a_window_are_taken_whole_or_shorter(clips):
    frames = {draw_batch(clips, 1, CONFIG, generator=seeded(s)).clean.shape[1] for s in range(12)}
    assert max(frames) == 14
    assert min(frames) >= 2


def test_a_batch_can_be_moved(batch):
    moved = batch.to(torch.device("meta"))
    assert {value.device.type for value in tensors(moved)} == {"meta"}
    back = batch.to(torch.device("cpu"))
    assert all(torch.equal(a, b) for a, b in zip(tensors(batch), tensors(back), strict=True))


def test_hands_that_move_more_may_keep_their_contact(interactions):
    made, moved, kept = (
        drawn(interactions, 16, TrainConfig(augmentation=augmentation), generator=seeded())
        for augmentation in (
            AugmentationConfig(share=0.0, style_share=0.0),
            AugmentationConfig(),
            AugmentationConfig(contact=KeptContactConfig(share=1.0)),
        )
    )

    def heights(batch: Batch) -> torch.Tensor:
        """Of keypoints over the plane of the nearest contact point of the made hand, metres."""
        points, normals = nearest_points(made.clean, made.region.points, made.region.normals)
        return ((batch.clean - points) * normals).sum(-1)

    touching = heights(made).abs() < 0.01
    assert int(touching.sum()) > 100
    off = [(heights(batch) - heights(made)).abs()[touching].mean() for batch in (moved, kept)]
    assert float(off[1]) < 0.7 * float(off[0])
