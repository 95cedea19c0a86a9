from dataclasses import fields

import pytest
import torch
from draws import seeded

from geneoh.representation.parameters import HandParameters
from geneoh.synthesis.draws import Draws
from geneoh.training.corruption import Corruption, CorruptionConfig, draw_corruption

CONFIG = CorruptionConfig()


STEADY = CorruptionConfig(camera_share=0.0)


def drawn(batch: int, frames: int, seed: int = 0, config: CorruptionConfig = STEADY) -> Corruption:
    return draw_corruption(frames, Draws(batch, seeded(seed)), config)


@pytest.fixture(scope="module")
def many() -> Corruption:
    return drawn(1500, 12)


def test_some_sequences_keep_their_parameters(many):
    clean = (many.pose == 0).all(-1).all(-1).all(-1) & (many.translation == 0).all(-1).all(-1)
    # four standard errors of 1500 draws
    assert float(clean.float().mean()) == pytest.approx(CONFIG.clean_share, abs=0.031)


def test_deviations_lie_within_the_stated_range():
    """By the median, so without bursts; three channels leave a deviation uncertain by a factor."""
    noise = drawn(800, 40, seed=1)
    kinds = (noise.translation, noise.pose[:, :, 0], noise.pose[:, :, 1:].flatten(2))
    ranges = CONFIG.translation, CONFIG.rotation, CONFIG.fingers
    for values, (low, high) in zip(kinds, ranges, strict=True):
        size = 1.48 * values.abs().flatten(1).median(1).values  # a normal's deviation
        size = size[size > 0]
        assert low < float(size.median()) < high
        assert float(size.quantile(0.999)) < 2.5 * high
        assert float(size.max()) > high / 3, "the range should be used"


def test_every_axis_and_both_signs_are_disturbed(many):
    for values in (many.translation, many.pose.flatten(2), many.jitter.flatten(2)):
        positive = (values > 0).float().mean((0, 1))
        assert float(values.std((0, 1)).min()) > 0
        assert bool((positive > 0.02).all())
        assert bool((positive < 0.98).all())


def test_one_sided_noise_is_that_of_a_right_hand_or_of_a_mirrored_left_one(many):
    """Of the sequences whose finger joints all turn the same way, as under the paper's Beta noise,
    four in ten do so along all axes and four in ten as a left hand's mirror image."""
    mean = many.pose[:, :, 1:].mean(1)
    agree = mean.sign().mean(1)
    sure = (agree.abs() > 0.99).all(-1)
    assert int(sure.sum()) > 50
    right = (agree[sure] > 0).all(-1).float().mean()
    left = (agree[sure] * torch.tensor([1.0, -1.0, -1.0]) > 0).all(-1).float().mean()
    assert float(right) == pytest.approx(0.5, abs=0.15)
    assert float(left) == pytest.approx(0.5, abs=0.15)


def test_a_third_of_the_sequences_lose_frames_and_none_loses_all(many):
    lost = ~many.keep
    assert bool(many.keep.any(1).all())
    assert 0.2 < float(lost.any(1).float().mean()) < 0.4


def test_every_kind_of_error_can_be_left_out():
    config = CorruptionConfig(
        clean_share=1.0,
        gap_share=0.0,
        jitter_share=0.0,
        camera_share=0.0,
        shaky_share=0.0,
        lasting_turn=0.0,
        lasting_shift=0.0,
    )
    none = drawn(50, 9, config=config)
    assert bool(none.keep.all())
    assert not any(bool(values.any()) for values in (none.translation, none.pose, none.jitter))
    assert not any(bool(values.any()) for values in (none.object_turn, none.object_shift))


def test_lost_frames_come_in_runs():
    keep = drawn(400, 60, seed=3).keep
    lost = (~keep).int()
    starts = (lost[:, 1:] > lost[:, :-1]).sum(1)
    assert int(starts.max()) <= 3
    alone = (lost[:, 1:-1] == 1) & (lost[:, :-2] == 0) & (lost[:, 2:] == 0)
    assert not bool(alone.any())
    assert int(lost.sum(1).max()) <= 30


@pytest.mark.parametrize("frames", [1, 2, 61])
def test_any_number_of_frames_can_be_corrupted(frames):
    noise = drawn(5, frames)
    assert noise.pose.shape == (5, frames, 16, 3)
    assert noise.jitter.shape == (5, frames, 21, 3)
    assert bool(noise.pose.isfinite().all())
    assert bool(noise.keep.any(1).all())


def test_corruption_depends_on_the_generator_alone():
    first, second, other = (drawn(4, 9, seed) for seed in (5, 5, 6))
    for field in fields(Corruption):
        assert torch.equal(getattr(first, field.name), getattr(second, field.name))
    assert not torch.equal(first.pose, other.pose)


def sizes_of(noise: Corruption) -> torch.Tensor:
    """Root mean squares (B, 3) of the errors of translation, rotation and fingers."""
    kinds = (noise.translation, noise.pose[:, :, 0], noise.pose[:, :, 1:])
    return torch.stack([values.flatten(1).square().mean(1).sqrt() for values in kinds], -1)


def test_translation_rotation_and_fingers_may_err_apart():
    """Each in its own size and in its own course over time, and some not at all."""
    settings = {"clean_share": 0.0, "camera_share": 0.0, "joint_scatter": 0.0}
    apart, alike = (
        drawn(1500, 30, seed=8, config=CorruptionConfig(apart_share=share, **settings))
        for share in (1.0, 0.0)
    )
    exact = sizes_of(apart) == 0
    assert float(exact.float().mean()) == pytest.approx(CONFIG.exact_share, abs=0.05)
    assert not bool((sizes_of(alike) == 0).any())
    both = sizes_of(apart)[(~exact[:, :2]).all(-1)]
    assert float(torch.corrcoef(sizes_of(alike).log().mT)[0, 1]) > 0.5
    assert abs(float(torch.corrcoef(both.log().mT)[0, 1])) < 0.15

    def steadiness(values: torch.Tensor) -> torch.Tensor:
        return values.diff(dim=1).square().mean((1, 2)) / values.square().mean((1, 2))

    def agreement(noise: Corruption, rows: torch.Tensor) -> float:
        pair = (steadiness(noise.translation[rows]), steadiness(noise.pose[rows, :, 0]))
        return float(torch.corrcoef(torch.stack(pair))[0, 1])

    everyone = torch.ones(1500, dtype=torch.bool)
    assert agreement(alike, everyone) > 0.7
    assert abs(agreement(apart, (~exact[:, :2]).all(-1))) < 0.2


ONLY_CAMERA = CorruptionConfig(
    clean_share=1.0, camera_share=1.0, ray_share=1.0, blunder_share=0.0, across=0.0
)


def test_a_camera_errs_along_its_ray_and_the_error_lasts():
    noise = drawn(300, 40, seed=4, config=ONLY_CAMERA)
    along = (noise.translation * noise.ray[:, None]).sum(-1)
    across = noise.translation - along[..., None] * noise.ray[:, None]
    assert float(across.norm(dim=-1).max()) < 1e-6
    lasting = along.mean(1)
    low, high = CONFIG.depth
    assert low < float(lasting.abs().median()) < high
    assert float((along - lasting[:, None]).std()) < float(lasting.std())


def test_the_ray_is_told_in_the_shares_asked_for():
    noise = drawn(1500, 2, seed=5, config=CONFIG)
    told = noise.ray.norm(dim=-1)
    assert bool(((told - 1).abs() < 1e-5)[told > 0].all())
    share = CONFIG.camera_share * CONFIG.ray_share
    share += (1 - CONFIG.camera_share) * CONFIG.other_ray_share
    assert float((told > 0).float().mean()) == pytest.approx(share, abs=0.05)


def test_an_object_shakes_by_what_smoothing_leaves_of_its_noise():
    config = CorruptionConfig(shaky_share=1.0, lasting_turn=0.0, lasting_shift=0.0)
    noise = drawn(400, 60, seed=6, config=config)
    white = noise.object_noise[:, 0]
    assert config.object_turn[0] / 2 < float(white.min())
    assert float(white.max()) < config.object_turn[1]
    turn = noise.object_turn.flatten(1).std(1)
    steps = noise.object_turn.diff(n=2, dim=1).flatten(1).std(1)
    # slow: second differences are far smaller than those of white noise of the same size
    assert float((steps / turn).median()) < 1.0
    assert 0.4 < float((turn / white).median()) < 1.2


def without_noise(**settings: float | tuple[float, float]) -> CorruptionConfig:
    """A config whose parameters err by hardly more than what the settings say."""
    none = {"camera_share": 0.0, "jitter_share": 0.0, "gap_share": 0.0, "clean_share": 0.0}
    least = dict.fromkeys(("translation", "rotation", "fingers"), (1e-9, 1e-9))
    return CorruptionConfig(**{**none, "exact_share": 0.0, **least, **settings})


@pytest.fixture(scope="module")
def moving() -> HandParameters:
    """400 hands whose wrist and fingers move steadily over 12 frames."""
    time = torch.arange(12.0)
    wrist = (0.01 * time)[:, None].expand(400, 12, 3)
    fingers = (0.2 + 0.05 * time)[:, None, None].expand(400, 12, 15, 3)
    return HandParameters(
        wrist, torch.eye(3).expand(400, 12, 3, 3), fingers, torch.ones(400, 20, 3)
    )


def test_without_any_error_a_tracker_has_the_clean_hand(moving):
    tracked = drawn(400, 12, config=without_noise()).tracked(moving)
    assert torch.allclose(tracked.wrist, moving.wrist)
    assert torch.allclose(tracked.turn, moving.turn, atol=1e-6)
    assert torch.allclose(tracked.fingers, moving.fingers, atol=1e-6)


def test_fingers_bend_too_little_or_too_much(moving):
    config = without_noise(bent_share=1.0)
    tracked = drawn(400, 12, config=config).tracked(moving)
    assert torch.allclose(tracked.wrist, moving.wrist)
    factors = tracked.fingers / moving.fingers
    assert torch.allclose(factors, factors[:, :1, :, :1].expand_as(factors), atol=1e-5)
    factors = factors[:, 0, :, 0].unflatten(1, (5, 3))
    assert torch.allclose(factors, factors[..., :1].expand_as(factors), atol=1e-5)
    low, high = config.bend
    assert low <= float(factors.min()) < low + 0.1
    assert high >= float(factors.max()) > high - 0.1
    alike = (factors[:, :, 0].std(1) < 1e-5).float().mean()
    assert float(alike) == pytest.approx(1 - config.each_bent_share, abs=0.1)


def test_filtered_hands_come_late(moving):
    """By memory / (1 - memory) frames, once the filter has run in."""
    config = without_noise(filtered_share=1.0, filter_memory=(0.5, 0.5))
    tracked = drawn(400, 12, config=config).tracked(moving)
    late = (moving.wrist - tracked.wrist)[:, -1, 0] / 0.01
    assert torch.allclose(late, torch.ones(400), atol=0.01)
    fingers = (moving.fingers - tracked.fingers)[:, -1].flatten(1) / 0.05
    lag = fingers.mean(1)
    assert bool(((lag - 1).abs() < 0.01).logical_or(lag.abs() < 0.01).all())
    assert 0.4 < float((lag > 0.5).float().mean()) < 0.6
    assert torch.allclose(tracked.turn, moving.turn, atol=1e-6)


def test_clean_windows_are_neither_bent_nor_filtered(moving):
    config = without_noise(clean_share=1.0, bent_share=1.0, filtered_share=1.0)
    tracked = drawn(400, 12, config=config).tracked(moving)
    assert torch.allclose(tracked.wrist, moving.wrist)
    assert torch.allclose(tracked.fingers, moving.fingers, atol=1e-6)
