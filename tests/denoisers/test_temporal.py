import pytest
import torch
from draws import normal

from geneoh.denoisers.temporal import (
    TEMPORAL_FEATURES,
    TemporalConfig,
    TemporalDenoiser,
    TemporalEvidence,
    gaussian_means,
)
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.representation.region import ObjectSurface

TINY = TemporalConfig(width=16, depth=1, heads=2)


def evidence(frames: int = 5, turn: torch.Tensor | None = None) -> TemporalEvidence:
    """Two hands near a ball; `turn` chooses other axes for the ball's own frame."""
    normals = torch.nn.functional.normalize(normal(2, 60, 3), dim=-1)
    rotation = axis_angle_to_matrix(0.3 * normal(2, frames, 1, 3, seed=1))
    translation = 0.05 * normal(2, frames, 1, 3, seed=2)
    joints = 0.06 * normal(2, 1, 21, 3, seed=3) + 0.004 * normal(2, frames, 21, 3, seed=4)
    joints = joints @ rotation[:, :, 0].mT + translation
    if turn is not None:
        normals, rotation = normals @ turn, rotation @ turn
    surface = ObjectSurface(
        0.04 * normals, normals, torch.zeros(2, 60, dtype=torch.long), rotation, translation
    )
    observed = joints + 0.01 * normal(*joints.shape, seed=5)
    return TemporalEvidence.at(surface, joints, observed, torch.ones(2, frames))


@pytest.fixture(scope="module")
def model(wake):
    return wake(TemporalDenoiser(TINY))


@pytest.mark.parametrize("frames", [2, 3, 7])
def test_a_correction_per_frame_and_keypoint_comes_out(model, frames):
    seen = evidence(frames)
    assert seen.features(torch.eye(3).expand(2, 3, 3)).shape == (2, frames, TEMPORAL_FEATURES)
    answer = model(seen)
    assert answer.change.shape == (2, frames, 21, 3)
    assert answer.steps.shape == answer.places.shape == (2, frames, 21)
    assert bool(answer.change.isfinite().all())
    for of_frames in (answer.change, answer.steps, answer.places):
        assert torch.equal(of_frames[:, -1], of_frames[:, -2])


def test_an_untrained_network_changes_nothing():
    answer = TemporalDenoiser(TINY)(evidence())
    assert float(answer.change.detach().abs().max()) == 0
    assert float(answer.steps.detach().abs().max()) == 0


def test_an_untrained_network_holds_on_to_a_hand_that_motiondiff_hardly_changed():
    """Places weigh as much as usual where the input shook by 8 mm, and more where it did not."""
    seen = evidence()
    for shaking, weight in ((0.05, 1.0), (0.002, 256.0), (0.0, 160000.0)):
        sway = torch.tensor([1.0, -1.0, 0.0, 1.0, -1.0])[:, None, None] * torch.tensor([1.0, 0, 0])
        off = 0.03 + shaking * (5 / 4) ** 0.5 * sway  # a lasting offset does not count
        given = TemporalEvidence(**(vars(seen) | {"observed": seen.joints + off}))
        with torch.no_grad():
            places = TemporalDenoiser(TINY)(given).places
        torch.testing.assert_close(places.exp(), torch.full_like(places, weight), rtol=1e-3, atol=0)


def test_the_answer_turns_with_the_axes_of_the_object(model):
    turn = axis_angle_to_matrix(torch.tensor([0.4, -0.9, 0.2]))
    plain, turned = model(evidence()), model(evidence(turn=turn))
    assert float(plain.change.abs().max()) > 1e-4
    torch.testing.assert_close(turned.change, plain.change @ turn, atol=1e-5, rtol=0)
    torch.testing.assert_close(turned.steps, plain.steps, atol=1e-4, rtol=0)


@pytest.mark.parametrize("name", ["joints", "nearest", "normals", "carried", "observed", "trust"])
def test_the_network_sees_every_field(model, name):
    seen = evidence()
    values = dict(vars(seen)) | {name: getattr(seen, name) + 0.01 * normal(1, 5, 1, 1).squeeze(0)}
    if name == "trust":
        values[name] = torch.tensor([[1.0, 0.0, 1.0, 1.0, 1.0]]).expand(2, 5)
    other = model(TemporalEvidence(**values))
    assert not torch.allclose(other.change, model(seen).change, atol=1e-6)


def test_the_clips_of_a_batch_do_not_influence_each_other(model):
    seen = evidence()
    whole, alone = model(seen), model(seen.take(slice(1, 2), "B"))
    torch.testing.assert_close(alone.change, whole.change[1:], atol=1e-6, rtol=0)


def test_smoothing_keeps_what_is_constant_and_the_mean_of_many_is_even():
    constant = normal(1, 1, 21, 3).expand(2, 9, 21, 3)
    torch.testing.assert_close(gaussian_means(constant, 2.5), constant)
    rough = normal(1, 9, 21, 3)
    torch.testing.assert_close(
        gaussian_means(rough, 1e4), rough.mean(1, keepdim=True).expand_as(rough)
    )
    assert float(gaussian_means(rough, 1.0).std()) < 0.7 * float(rough.std())
