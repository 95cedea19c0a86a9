"""Cases without any data set: the example, our own clips, and what is said when data is missing."""

import pickle
from dataclasses import replace

import pytest
import torch
from watertight import is_watertight

from geneoh.errors import ConfigError, MissingAssetError
from geneoh.evaluation import cases
from geneoh.evaluation.options import SEEDS, EvaluationOptions, ProtocolOptions
from geneoh.evaluation.protocols.clips import windows_in_run
from geneoh.evaluation.protocols.datasets import PROTOCOLS, spread_over_groups
from geneoh.evaluation.protocols.synthetic import COUNT, draw_clip, mesh_of_solid
from geneoh.geometry.distance import SurfaceDistance
from geneoh.hand.library import load_hand
from geneoh.metrics.accuracy import mpjpe
from geneoh.metrics.report import measure_posed
from geneoh.sequence.validation import check_sequence
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.shapes.objects import draw_objects


def find_cases(dataset, root=None, *, options=None, **asked):
    asked = {name: value if name == "limit" else tuple(value) for name, value in asked.items()}
    protocol = options or ProtocolOptions()
    return cases.find_cases(EvaluationOptions(dataset, root, protocol=protocol, **asked))


@pytest.fixture(autouse=True)
def no_data_sets_of_the_machine(monkeypatch):
    for protocol in PROTOCOLS.values():
        monkeypatch.delenv(protocol.variable, raising=False)


def test_the_example_needs_no_file_and_no_root(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found = find_cases("taco", seeds=[11, 22])
    assert [(case.clip.name, case.noise, case.seed) for case in found] == [
        ("20231104_017", noise, seed) for noise in ("gauss", "beta") for seed in (11, 22)
    ]
    case = found[0]
    assert (case.clean.frames, case.clean.hands[0].side) == (146, "left")


def test_truth_scored_against_itself_is_without_error():
    (case,) = find_cases("taco", noises=["clean"], seeds=[11])
    joints = case.clean.hands[0].joints
    assert float(mpjpe(case.noisy.hands[0].joints, joints).abs().max()) == 0


def test_recorded_noise_has_no_truth():
    (case,) = find_cases("taco", noises=["recorded"], seeds=[11])
    assert case.clean is None


def test_noise_depends_on_seed_and_clip_and_on_nothing_else():
    first, second = find_cases("taco", noises=["gauss"], seeds=[11, 22])
    joints = [case.noisy.hands[0].joints for case in (first, second, replace(first))]
    assert torch.equal(joints[0], joints[2])
    assert not torch.allclose(joints[0], joints[1], atol=1e-3)


@pytest.mark.slow
def test_own_clips_are_drawn_from_their_number_alone():
    options = ProtocolOptions(frames=30)
    (case,) = find_cases("synthetic", noises=["drift"], seeds=[77], limit=1, options=options)
    clip = pickle.loads(pickle.dumps(case)).clip
    assert case.clean.frames == 30
    draw_clip.cache_clear()
    sequence = clip.read()
    assert torch.equal(sequence.hands[0].joints, case.clean.hands[0].joints)
    assert torch.equal(sequence.object.meshes[0].verts, case.clean.object.meshes[0].verts)
    assert sequence.frames == 30
    check_sequence(sequence)
    assert clip.name.split("_0")[0] in SynthesisConfig().held_out
    assert is_watertight(sequence.object.meshes[0])


def test_own_clips_hold_their_object_without_sinking_in():
    (case,) = find_cases("synthetic", noises=["clean"], seeds=[11], limit=1)
    sequence = case.clean
    (hand,), motion = sequence.hands, sequence.object
    model, surface = load_hand("right"), motion.surface()
    verts = model.shaped(hand.betas).posed(hand.pose, hand.wrist).verts
    report, _ = measure_posed(
        verts.__getitem__, hand.joints, surface, sequence.fps, hand.valid, faces=model.faces
    )
    # the engine checks spheres along the bones, which leave palm and fingertips thin: the skin of
    # one grasp in ten sinks in by more than 6.5 mm
    assert report.penetration_mean_mm < 8
    assert report.contact_fraction > 0.3


@pytest.mark.parametrize("family", SynthesisConfig().held_out)
def test_meshes_of_analytic_objects_lie_on_their_surface(family):
    solid = draw_objects([family], generator=torch.Generator().manual_seed(3))
    mesh = mesh_of_solid(solid)
    assert is_watertight(mesh)
    off = solid.signed_distance(mesh.verts[None])[0].abs()
    assert float(off.quantile(0.99)) < 1e-4
    surface, _ = solid.surface_points(200, generator=torch.Generator().manual_seed(0))
    on_it = surface[0][solid.signed_distance(surface)[0].abs() < 1e-5]
    gap = SurfaceDistance(mesh).query(on_it).distance.abs()
    assert float(gap.max()) < 1e-3


def test_a_smaller_limit_gives_some_of_the_clips_of_a_larger_one():
    names = [
        {case.clip.name for case in find_cases("synthetic", seeds=[11], limit=limit)}
        for limit in (5, 20, None)
    ]
    assert [len(clips) for clips in names] == [5, 20, COUNT]
    assert names[0] < names[1] < names[2]


def test_a_limit_takes_from_every_group_before_it_takes_twice_and_reads_no_more_than_it_needs():
    read = []

    def groups():
        for index in range(5):
            read.append(index)
            yield [f"{index}{letter}" for letter in "abc"[: index + 1]]

    assert spread_over_groups(groups(), 3) == ["0a", "1a", "2a"]
    assert read == [0, 1, 2, 3]
    assert spread_over_groups(groups(), 7) == ["0a", "1a", "2a", "3a", "4a", "1b", "2b"]
    assert len(spread_over_groups(groups(), None)) == 1 + 2 + 3 + 3 + 3


@pytest.mark.parametrize("name", ["grab", "grab-beta", "hoi4d", "arctic"])
def test_without_data_one_sentence_says_what_to_get_and_where_to_put_it(name, tmp_path):
    protocol = PROTOCOLS[name]
    for root, got in ((None, "no folder was named"), (tmp_path, f"there is none in {tmp_path}")):
        with pytest.raises(MissingAssetError) as caught:
            find_cases(name, root)
        words = str(caught.value)
        assert "\n" not in words
        for part in (got, "get it at", protocol.layout, "--root ROOT", protocol.variable):
            assert part in words


def test_a_named_root_without_taco_is_refused_and_the_example_is_not_taken_instead(tmp_path):
    with pytest.raises(MissingAssetError, match="Hand_Poses"):
        find_cases("taco", tmp_path)


def test_the_environment_says_where_a_copy_lies(tmp_path, monkeypatch):
    monkeypatch.setenv("GENEOH_DATA_ARCTIC", str(tmp_path))
    with pytest.raises(MissingAssetError, match="there is none in"):
        find_cases("arctic")


def test_the_papers_noise_asks_for_mano_or_another_choice(tmp_path):
    (tmp_path / "raw_seqs/s01").mkdir(parents=True)
    (tmp_path / "raw_seqs/s01/box_grab_01.mano.npy").touch()
    with pytest.raises(MissingAssetError, match="register at https"):
        find_cases("arctic", tmp_path)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("dataset", "dexycb", "'dataset' must be one of 'synthetic', 'taco', .* got 'dexycb'"),
        ("noises", ("white",), r"'noises\[0\]' must be one of 'gauss', .* got 'white'"),
        ("noises", "gauss", "'noises' must be a list of .* got 'gauss'"),
        ("methods", ("magic",), r"'methods\[0\]' must be one of 'input', .* got 'magic'"),
        ("seeds", 11, "'seeds' must be a list of a whole number, got 11"),
        ("limit", 0, "'limit' must be 1 or more, got 0"),
    ],
)
def test_what_does_not_exist_is_refused_with_the_choices(field, value, message):
    options = EvaluationOptions("taco")
    vars(options)[field] = value  # the type checker of the tests refuses it as an argument
    with pytest.raises(ConfigError, match=message):
        options.__post_init__()


def test_the_papers_noise_is_refused_where_the_paper_has_none():
    with pytest.raises(ConfigError, match="the paper puts none on taco"):
        find_cases("taco", noises=["paper"])


def test_seeds_are_the_papers_but_for_many_clips():
    assert SEEDS == (11, 22, 77)
    assert {case.seed for case in find_cases("taco")} == set(SEEDS)
    assert {case.seed for case in find_cases("synthetic", limit=1)} == {11}
    assert {case.seed for case in find_cases("synthetic", limit=1, seeds=[1, 2])} == {1, 2}


def test_a_stored_input_that_is_not_there_is_told(tmp_path):
    options = EvaluationOptions("synthetic", noises=("gauss",), limit=1, noisy_inputs=tmp_path)
    (case,) = cases.find_cases(options)
    with pytest.raises(MissingAssetError, match=r"expected .*_gauss_11\.npz or gauss_11\.npz"):
        _ = case.noisy


def test_noise_that_stored_inputs_are_not_given_is_refused(tmp_path):
    protocol = ProtocolOptions(object_noise="shaky_10")
    options = EvaluationOptions("synthetic", limit=1, noisy_inputs=tmp_path, protocol=protocol)
    with pytest.raises(ConfigError, match="--set object_noise: expected none with --twins"):
        cases.find_cases(options)
    assert len(cases.find_cases(replace(options, noisy_inputs=None))) == 2


def test_windows_are_the_papers():
    assert list(windows_in_run(150, ProtocolOptions())) == [(0, 60), (30, 90), (60, 120), (90, 150)]
    assert list(windows_in_run(149, ProtocolOptions())) == [(0, 60), (30, 90), (60, 120)]
    assert list(windows_in_run(59, ProtocolOptions())) == []
    assert list(windows_in_run(150, ProtocolOptions(windows="first"))) == [(0, 60)]
