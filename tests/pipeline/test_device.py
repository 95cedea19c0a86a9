"""The whole way on another device: a pretended one, and CUDA where there is a GPU."""

import time
from dataclasses import fields, replace
from typing import get_args

import numpy as np
import pytest
import quick_presets
import torch
from pretended_device import DEVICE
from torch import Tensor

import geneoh
from geneoh.bundle import Bundle
from geneoh.choices import PresetName
from geneoh.denoisers import library
from geneoh.geometry.distance import WARP
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.results import Denoised, save
from geneoh.sequence.sequence import Sequence

TOLERANCE = 1e-4
TURN = 2e-4 if WARP else TOLERANCE
"""Metres, and radians of joints, by which CUDA may differ from the CPU: every keypoint before the
fit, and all else in the mean. Warp rounds distances to float32. Where the object is thin, rounding
may decide on which side of it a finger is fitted, so that single frames differ by more. The
pretended device gives the numbers of the CPU."""


MEAN_CHANGE = 5e-4
"""Metres by which a keypoint differs in the mean where networks multiply in bfloat16."""
A_WINDOW_WITHIN = 1.0
"""Seconds in which a GPU cleans 60 frames with 100 samples."""


def multiply_in(precision: torch.dtype, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the networks multiply matrices in this type on every device."""
    monkeypatch.setattr(library, "cleaning_precision", lambda device: precision)


@pytest.fixture(autouse=True)
def _few_steps_in_full(monkeypatch):
    quick_presets.use(monkeypatch)
    multiply_in(torch.float32, monkeypatch)


@pytest.fixture(scope="module")
def short(noisy) -> Sequence:
    """A left hand that touches the object."""
    return noisy[56:64]


def tensors_of(result: Denoised) -> dict[str, Tensor]:
    """Every tensor of a result by side and name."""
    found = {}
    for side, hand in result.hands.items():
        own = {f.name: getattr(hand.track, f.name) for f in fields(hand.track)}
        own |= {"filled": hand.filled, "samples": hand.samples}
        found |= {f"{side} {name}": v for name, v in own.items() if isinstance(v, Tensor)}
    return found


def assert_same(here: Denoised, there: Denoised, exact: bool) -> None:
    """Results that are equal or close, both on the CPU."""
    want, got = tensors_of(here), tensors_of(there)
    assert want.keys() == got.keys()
    for name, tensor in got.items():
        assert tensor.device.type == "cpu", name
        if exact:
            assert torch.equal(tensor, want[name]), name
            continue
        apart = (tensor.double() - want[name].double()).abs()
        within = TURN if name.endswith("pose") else TOLERANCE
        assert float(apart.max() if "samples" in name else apart.mean()) < within, name
    if exact:
        for side, hand in there.hands.items():
            before = here.hands[side].after.as_dict()
            assert hand.after.as_dict() == pytest.approx(before, nan_ok=True)


def both_ways(sequence: Sequence, options: Options, device: torch.device) -> None:
    here = denoise(sequence, options)
    there = denoise(sequence, replace(options, device=str(device)))
    assert_same(here, there, exact=device == DEVICE)


@pytest.mark.parametrize("name", get_args(PresetName))
def test_a_left_hand_is_cleaned_alike_on_every_device(short, device, name):
    both_ways(short, Options(preset=name), device)


def test_a_right_hand_of_keypoints_alone_with_gaps_is_cleaned_alike(short, device):
    hand = short.hands[0].mirrored()
    hand = replace(hand, pose=None, wrist=None, betas=None, hand_model=None)
    hand = replace(hand, valid=torch.arange(8) != 3, confidence=torch.full((8, 21), 0.5))
    right = replace(short, hands=(hand,), object=short.object.mirrored())
    both_ways(right, Options(preset="fast"), device)


def test_both_hands_at_an_object_of_two_parts_are_cleaned_alike(arctic, device):
    both_ways(arctic[:8], Options(preset="fast"), device)


def test_another_frame_rate_is_resampled_on_the_device_of_the_sequence(short, device):
    slow = replace(short, fps=20.0)
    here = denoise(slow, Options(preset="fast"))
    there = denoise(slow.to(device), Options(preset="fast", device=str(device)))
    assert all(tensor.device.type == device.type for tensor in tensors_of(there).values())
    moved = {side: hand.to("cpu") for side, hand in there.hands.items()}
    assert_same(here, replace(there, hands=moved), exact=device == DEVICE)


@pytest.mark.parametrize("change", [{"meshes": ()}, {"valid": torch.zeros(8, 1).bool()}])
def test_a_sequence_of_the_device_without_a_usable_object_is_cleaned_alike(short, device, change):
    bare = replace(short, object=replace(short.object, **change))
    here = denoise(bare, Options(preset="fast"))
    there = denoise(bare.to(device), Options(preset="fast", device=str(device)))
    moved = {side: hand.to("cpu") for side, hand in there.hands.items()}
    assert_same(here, replace(there, hands=moved), exact=device == DEVICE)


@pytest.mark.parametrize("setting", [{"fps": 60.0}, {"trust_object": True}])
def test_a_stream_works_on_the_device(short, device, setting):
    hand, motion = short.hands[0], short.object
    stream = geneoh.Stream(motion.meshes[0], side=hand.side, lag=0.1, device=str(device), **setting)
    made = [
        stream.push(hand.joints[t], (motion.rotation[t, 0], motion.translation[t, 0]))
        for t in range(8)
    ]
    frames = [*filter(None, made), *stream.flush()]
    assert len(frames) == 8
    assert all(frame.hand.joints.isfinite().all() for frame in frames)


@pytest.mark.parametrize("at_work", ["cpu", "there"])
def test_results_are_on_the_device_of_the_sequence_and_can_be_saved(
    short, device, at_work, tmp_path
):
    options = Options(preset="fast", device="cpu" if at_work == "cpu" else str(device))
    result = denoise(short.to(device), options)
    assert all(tensor.device.type == device.type for tensor in tensors_of(result).values())
    save(result, tmp_path / "clean.npz")
    loaded = geneoh.load(tmp_path / "clean.npz")
    torch.testing.assert_close(loaded.hands[0].joints, result.sequence.hands[0].joints.cpu())
    with np.load(tmp_path / "clean.npz") as arrays:
        assert arrays["left_filled"].shape == (8,)


def test_bundles_move_whole(short, device):
    moved = short.to(device)
    assert all(mesh.verts.device.type == device.type for mesh in moved.object.meshes)
    assert moved.hands[0].joints.device.type == device.type
    assert isinstance(moved, Bundle)
    torch.testing.assert_close(moved.to("cpu").object.rotation, short.object.rotation)


@pytest.mark.gpu
def test_cuda_and_the_cpu_agree_on_the_whole_recording(noisy, monkeypatch):
    if not torch.cuda.is_available():
        pytest.skip("needs a CUDA device")
    monkeypatch.undo()
    multiply_in(torch.float32, monkeypatch)
    here, there = (denoise(noisy, Options(device=name)) for name in ("cpu", "cuda"))
    assert_same(here, there, exact=False)


@pytest.mark.slow
def test_products_in_bfloat16_change_a_clean_hand_little(noisy, monkeypatch):
    monkeypatch.undo()
    found = {}
    for precision in (torch.float32, torch.bfloat16):
        multiply_in(precision, monkeypatch)
        found[precision] = tensors_of(denoise(noisy, Options(preset="fast")))
    plain, less = found.values()
    for name, tensor in less.items():
        assert tensor.dtype == plain[name].dtype, name
        assert tensor.isfinite().all(), name
    apart = (less["left joints"] - plain["left joints"]).norm(dim=-1)
    assert 0 < float(apart.mean()) < MEAN_CHANGE


@pytest.mark.gpu
def test_cuda_cleans_a_window_of_many_samples_within_a_second(noisy, monkeypatch):
    if not torch.cuda.is_available():
        pytest.skip("needs a CUDA device")
    monkeypatch.undo()
    options = Options(device="cuda", samples=100)
    denoise(noisy[:60], options)  # kernels are loaded, and compiled where need be
    began = time.perf_counter()
    denoise(noisy[:60], options)
    assert time.perf_counter() - began < A_WINDOW_WITHIN
