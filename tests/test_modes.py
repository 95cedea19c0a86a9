"""No call of the library heeds the modes of torch that its caller set, or draws of its numbers."""

from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
import quick_generation
import torch
from torch import Tensor

import geneoh
from geneoh.evaluation.options import ProtocolOptions
from geneoh.modes import default_float32

EXAMPLES = Path(__file__).parents[1] / "examples"
OBJ = EXAMPLES / "taco_object.obj"


@contextmanager
def another_default_dtype():
    torch.set_default_dtype(torch.float64)
    try:
        yield
        assert torch.get_default_dtype() == torch.float64
    finally:
        torch.set_default_dtype(torch.float32)


MODES = {
    "autocast": lambda: torch.autocast("cpu", dtype=torch.bfloat16),
    "another default dtype": another_default_dtype,
    "inference mode": torch.inference_mode,
    "another default device": lambda: torch.device("meta"),
}


def loaded(folder: Path) -> Tensor:
    return geneoh.load(EXAMPLES / "taco_noisy.npz", obj=OBJ)[:6].hands[0].joints


def of_arrays(folder: Path) -> Tensor:
    with np.load(EXAMPLES / "taco_noisy.npz") as file:
        names = ("left_joints", "object_rotation", "object_translation")
        arrays = {name: file[name][:6] for name in names}
    return geneoh.from_arrays(**arrays, fps=30, meshes=OBJ).hands[0].joints


def read(folder: Path) -> Tensor:
    np.save(folder / "points.npy", np.load(EXAMPLES / "taco_noisy.npz")["left_joints"][:6])
    return geneoh.read("keypoints", folder / "points.npy", side="left", fps=30).hands[0].joints


def cleaned(folder: Path) -> Tensor:
    short = geneoh.load(EXAMPLES / "taco_noisy.npz", obj=OBJ)[:30]
    result = geneoh.denoise(short, preset="fast", steps=1)
    geneoh.view(result, folder / "page.html")
    return result.sequence.hands[0].joints


def streamed(folder: Path) -> Tensor:
    stream = geneoh.Stream(OBJ, samples=1, steps=1, lag=0.1)
    points = np.load(EXAMPLES / "taco_noisy.npz")["left_joints"][:2]
    for joints in points * np.array([-1, 1, 1]):
        stream.push(joints, np.eye(4))
    return stream.flush()[0].hand.joints


def generated(folder: Path) -> Tensor:
    options = geneoh.GenerateOptions(frames=10, steps=1, draws=1)
    made = geneoh.generate("press the mug with the left hand", OBJ, options)
    return made.sequence.hands[0].joints


def made_on_body(folder: Path) -> Tensor:
    body = {"global_orient": (10, 3), "body_pose": (10, 63), "transl": (10, 3)}
    np.savez(folder / "walk.npz", fps=30, **{name: np.zeros(size) for name, size in body.items()})
    options = geneoh.BodyOptions(steps=1)
    made = geneoh.generate_on_body("the right hand waves", folder / "walk.npz", options)
    return made.sequence.hands[0].joints


def scored(folder: Path) -> Tensor:
    asked = {"noises": ("gauss",), "limit": 1, "protocol": ProtocolOptions(frames=6)}
    options = geneoh.EvaluationOptions("synthetic", methods=("input",), **asked)
    made = geneoh.evaluate(options, folder / "scores", fresh=True)
    return torch.tensor([made.scores[0].values["mpjpe_mm"]], dtype=torch.float32, device="cpu")


def assert_undisturbed(call, modes, folder: Path) -> None:
    """The call gives the same in all of these modes at once as in none."""
    expected, before = call(folder), torch.get_rng_state()
    with ExitStack() as entered:
        for mode in modes:
            entered.enter_context(mode())
        found = call(folder)
    # a device that was set, even the CPU, makes torch choose other kernels, which round otherwise
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-5, equal_nan=True)
    assert torch.equal(torch.get_rng_state(), before)


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("call", [loaded, of_arrays])
def test_a_mode_of_the_caller_changes_nothing(call, mode, tmp_path):
    assert_undisturbed(call, [MODES[mode]], tmp_path)


def test_what_is_loaded_within_inference_mode_takes_part_in_gradients(tmp_path):
    with torch.inference_mode():
        made = [of_arrays(tmp_path), geneoh.load_mesh(OBJ).verts, loaded(tmp_path)]
    assert not any(values.is_inference() for values in made)


@pytest.mark.slow
@pytest.mark.parametrize("call", [read, cleaned, streamed, generated, made_on_body, scored])
def test_no_call_heeds_the_modes_of_its_caller_or_draws_its_random_numbers(
    call, tmp_path, monkeypatch
):
    quick_generation.use(monkeypatch)
    assert_undisturbed(call, MODES.values(), tmp_path)


def test_the_last_of_several_computations_sets_the_default_dtype_back():
    first, second = default_float32(), default_float32()
    with another_default_dtype():
        first.__enter__()
        second.__enter__()
        first.__exit__(None, None, None)
        assert torch.get_default_dtype() == torch.float32
        second.__exit__(None, None, None)


def test_errors_of_numpy_that_the_caller_asked_for_are_not_those_of_geneoh(tmp_path):
    short = geneoh.load(EXAMPLES / "taco_noisy.npz", obj=OBJ)[:2]
    with np.errstate(all="raise"):
        geneoh.view(short, tmp_path / "strip.png", cell=64)
