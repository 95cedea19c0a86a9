"""What ablations leave out, and that nothing else changes."""

from dataclasses import replace
from pathlib import Path
from typing import get_args

import jaxtyping
import pytest

from geneoh.choices import Ablation
from geneoh.errors import ConfigError
from geneoh.fitting.fit_config import KEYPOINTS_ALONE
from geneoh.pipeline.denoise import denoise
from geneoh.pipeline.options import Options
from geneoh.pipeline.presets import preset

STAGES = ("motion", "spatial", "temporal")
SCENE = slice(50, 58)


@pytest.fixture(scope="module")
def short(noisy):
    hand, moving = noisy.hands[0], noisy.object
    names = ("valid", "joints", "pose", "wrist")
    cut = replace(hand, **{name: getattr(hand, name)[SCENE] for name in names})
    moved = {"rotation": moving.rotation[SCENE], "translation": moving.translation[SCENE]}
    return replace(noisy, hands=(cut,), object=replace(moving, **moved))


def joints_of(sequence, **options):
    return denoise(sequence, Options(preset="fast", **options)).sequence.hands[0].joints


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_is_left_out_alone(stage):
    whole = preset("default")
    less = whole.without(stage)
    assert getattr(less, stage) is None
    assert replace(less, **{stage: getattr(whole, stage)}) == whole


def test_without_diffusion_every_stage_is_one_call():
    less = preset("paper").without("diffusion")
    assert {getattr(less, stage).sampler for stage in STAGES} == {"direct"}
    assert less.without("motion").motion is None


def test_without_the_fit_the_object_is_not_looked_at():
    less = preset("default").without("fit")
    assert (less.fit, less.contact) == (KEYPOINTS_ALONE, False)
    assert less.motion == preset("default").motion


def test_without_the_canonical_frame_the_rest_stays():
    less = preset("default").without("canonical")
    assert not less.canonical
    assert replace(less, canonical=True) == preset("default")


# The recording has an exact object and no camera: see `test_noisy_object.py` and `test_camera.py`.
# So few frames say nothing of sliding: see `stages/test_spatial.py`.
ELSEWHERE = ("object", "camera", "told-camera", "sliding")


@pytest.mark.parametrize("part", [part for part in get_args(Ablation) if part not in ELSEWHERE])
def test_every_ablation_gives_another_hand(short, part):
    less = joints_of(short, without=(part,))
    assert less.isfinite().all()
    assert (less - joints_of(short)).norm(dim=-1).mean() > 1e-4


def test_without_sliding_differs_in_one_setting_where_places_are_tried():
    less = preset("default").without("sliding")
    assert not less.spatial.sliding
    assert replace(less, spatial=preset("default").spatial) == preset("default")
    for untouched in (preset("paper"), preset("default").without("spatial")):
        assert untouched.without("sliding") == untouched


def test_without_any_stage_the_fit_follows_the_input(short):
    left = joints_of(short, without=(*STAGES, "fit"))
    assert (left - short.hands[0].joints).norm(dim=-1).mean() < 0.004


def test_fewer_steps_leave_an_absent_stage_absent():
    less = preset("default").without("spatial").with_steps(2)
    assert less.spatial is None
    assert less.motion.steps == 2


def test_rounds_of_spatial_diff_have_an_end():
    rounds = [preset("fast").with_steps(steps).spatial.steps for steps in (1, 20, 21, 650)]
    assert rounds == [1, 20, 20, 20]


def test_options_leave_out_what_they_name():
    assert Options(without=("motion", "fit")).resolved() == preset("default").without(
        "motion"
    ).without("fit")


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"preset": "turbo"}, "'preset' must be one of 'default', 'paper', 'fast', got 'turbo'"),
        ({"seed": -1}, "'seed' must be 0 to 9223372036854775807, got -1"),
        ({"samples": 0}, "'samples' must be 1 or more, got 0"),
        ({"steps": -2}, "'steps' must be 1 or more, got -2"),
        ({"steps": "3"}, "'steps' must be a whole number or none"),
        ({"without": "fit"}, "'without' must be a list"),
        (
            {"refine_object": True, "trust_object": True},
            "'refine_object' .* beside trust_object; leave one of them out",
        ),
        (
            {"refine_object": True, "without": ["fit", "mesh", "object"]},
            "beside without 'mesh' and without 'object'; leave",
        ),
    ],
)
def test_options_of_other_values_are_refused_with_the_field(wrong, words, monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for users
    with pytest.raises(ConfigError, match=words):
        Options(**wrong)


def test_options_take_folders_as_text(monkeypatch):
    monkeypatch.setattr(jaxtyping.config, "jaxtyping_disable", True)  # as for users
    assert Options(mano_dir="models").mano_dir == Path("models")


def test_the_chains_of_the_preset_paper_are_kept_as_samples_are():
    assert Options(preset="paper").resolved() == preset("paper")
    closest = Options(preset="paper", selection="closest").resolved()
    assert (preset("paper").motion.kept, closest.motion.kept) == ("mean", "closest")
    assert Options(selection="closest").resolved().motion == preset("default").motion
