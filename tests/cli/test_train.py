"""`geneoh synthesize`, `realism` and `train` on a very small scale, and refusals of `eval`."""

from pathlib import Path

import pytest
import torch
from made_actions import write_actions
from trees import write_mano
from trees.labelled import POUR_MILK, labelled_h2o

from geneoh.choices import ACTION_STAGES
from geneoh.generators.text2hoi.networks.library import SHIPPED, load_text2hoi
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.synthesis.gestures.shards import read_gestures
from geneoh.synthesis.replay import NoFirstGraspsError
from geneoh.synthesis.shards import read_shards, shard_record

SHARDS = ("--count", 4, "--set", "shard=2", "--set", "points=64")
"""Shards of two interactions instead of 256."""
ANYTHING = ("grasps.steps=1", "grasps.checks.fingers=-1", "grasps.checks.depth=1")
"""Grasps that hardly descend and always pass: what they are like is tested elsewhere."""
SMALL = ("steps=2", "batch=2", "validation_batches=1", "warmup=1")


def test_clips_without_a_sheet_are_whole_all_the_same(geneoh, tmp_path, monkeypatch):
    def none(*_):
        raise NoFirstGraspsError("val_00000.safetensors: expected other hands")

    monkeypatch.setattr("geneoh.viz.sheet.sheet_of", none)
    made = geneoh("synthesize", *SHARDS, "-o", "clips", settings=ANYTHING)
    assert "note: no sheet is drawn of val_00000.safetensors: expected" in made.stdout
    assert "2 shards made" in made.stdout
    assert not (tmp_path / "clips" / "sheet.png").exists()


@pytest.mark.slow
def test_synthesized_data_trains_every_stage_and_denoise_takes_the_weights(geneoh, tmp_path):
    made = geneoh("synthesize", *SHARDS, settings=ANYTHING)
    assert "2 shards made" in made.stdout
    assert (tmp_path / "runs" / "data" / "sheet.png").read_bytes().startswith(b"\x89PNG")
    assert "0 shards made" in geneoh("synthesize", *SHARDS, settings=ANYTHING).stdout
    other = geneoh("synthesize", *SHARDS, "--seed", 1, settings=ANYTHING, code=2)
    assert "was made with seed 0 where 1 is asked for" in other.stderr
    examples = Path(__file__).parents[2] / "examples"
    recording = examples / "taco_clean.npz", "--obj", examples / "taco_object.obj"
    compared = geneoh("realism", *recording, code=2)
    assert "take a longer recording or more data" in compared.stderr
    for stage in ("motion", "spatial", "temporal", "toch", "regression"):
        geneoh("train", "--stage", stage, settings=SMALL)
        assert (tmp_path / "runs" / f"{stage}.safetensors").exists()
        log = (tmp_path / "runs" / f"{stage}_log.csv").read_text().splitlines()
        assert log[0] == "step,loss,error_left,rate,seconds"
        assert len(log) == 2


def test_the_seed_of_a_run_is_the_one_that_is_named(geneoh, monkeypatch):
    seeds = []

    def trained(task, folder, **_):
        seeds.append(task.config.seed)
        return folder

    monkeypatch.setattr("geneoh.training.loop.train", trained)
    geneoh("train", "--stage", "text")
    geneoh("train", "--stage", "text", "--seed", 7)
    assert seeds == [0, 7]


def test_training_on_a_fresh_machine_makes_its_data_first(geneoh, tmp_path):
    few = ("count=2", "shard=1", "points=64", *ANYTHING)
    few = tuple(f"synthesis.{setting}" for setting in few)
    geneoh("train", "--stage", "spatial", settings=(*SMALL, *few))
    assert len(list((tmp_path / "runs" / "data").glob("*.safetensors"))) == 2
    assert (tmp_path / "runs" / "spatial.safetensors").exists()


@pytest.mark.slow
def test_a_recording_goes_on_from_the_shipped_weights(geneoh, tmp_path):
    recording = Path(__file__).parents[2] / "examples" / "taco_clean.npz"
    run = ("train", "--stage", "motion", "--data", f"sequences={recording}", "--start", "shipped")
    trained = geneoh(*run, settings=SMALL)
    assert trained.stdout.startswith("sequences: 2 clips of one object, validated on the training")
    assert not (tmp_path / "runs" / "data").exists()
    assert len(list((tmp_path / "runs" / "recordings").rglob("*.safetensors"))) == 1


def test_a_source_of_data_that_is_none_is_refused(geneoh):
    unknown = geneoh("train", "--stage", "motion", "--data", "tacco=nowhere", code=2)
    assert "got tacco" in unknown.stderr
    missing = geneoh("train", "--stage", "motion", "--data", "taco=nowhere", code=2)
    assert "nowhere: no such file or folder" in missing.stderr


def test_settings_of_the_data_come_from_a_file_and_from_the_command(geneoh, tmp_path):
    (tmp_path / "few.toml").write_text("count = 2\nshard = 1\n[grasps]\nsteps = 1\n")
    settings = ("grasps.checks.fingers=-1", "grasps.checks.depth=1", "points=16")
    geneoh("synthesize", "--config", "few.toml", settings=settings)
    made_with = shard_record(tmp_path / "runs" / "data" / "train_00001.safetensors").config
    assert (made_with.count, made_with.points, made_with.grasps.steps) == (2, 16, 1)
    assert made_with.grasps.checks.fingers == -1
    misspelt = geneoh("synthesize", "--set", "grasps.step=3", code=2)
    assert "did you mean 'grasps.steps'?" in misspelt.stderr


def test_hands_hold_meshes_of_a_folder(geneoh, tmp_path):
    mesh = Path(__file__).parents[2] / "examples" / "taco_object.obj"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / mesh.name).write_bytes(mesh.read_bytes())
    quick = (*ANYTHING, "scanned=1.0")
    geneoh("synthesize", "--objects", "mine", *SHARDS, settings=quick)
    clips = read_shards(tmp_path / "runs" / "data", "train")
    assert clips.take(slice(None)).scan.tolist() == [0, 0]
    without = geneoh("synthesize", *SHARDS, settings=ANYTHING, code=2)
    assert "where none is asked for" in without.stderr
    ignored = geneoh("synthesize", *SHARDS, settings=quick, code=2)
    assert "scanned=1.0: expected a setting that this run reads, got one of --objects" in (
        ignored.stderr
    )


def test_a_folder_of_other_data_gets_no_file_of_objects(geneoh, tmp_path):
    mesh = Path(__file__).parents[2] / "examples" / "taco_object.obj"
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / mesh.name).write_bytes(mesh.read_bytes())
    geneoh("synthesize", *SHARDS, settings=ANYTHING)
    before = sorted(tmp_path.rglob("*"))
    mine = ("synthesize", "--objects", "mine")
    other = geneoh(*mine, "--actions", code=2)
    assert "expected actions, got interactions" in other.stderr
    without = geneoh(*mine, *SHARDS, settings=ANYTHING, code=2)
    assert "objects none where those of --objects is asked for" in without.stderr
    assert sorted(tmp_path.rglob("*")) == before


def test_a_share_of_scanned_objects_without_any_is_refused(geneoh):
    scanned = geneoh("train", "--stage", "motion", "--set", "synthesis.scanned=0.5", code=2)
    assert "--set synthesis.scanned=0.5: expected a setting that this run reads" in scanned.stderr


def test_misspelt_setting_is_refused_with_the_nearest(geneoh):
    result = geneoh("train", "--stage", "motion", "--set", "stepz=3", code=2)
    assert "steps" in result.stderr


def test_eval_of_a_missing_recording_says_where_it_looked(geneoh):
    result = geneoh("eval", "--dataset", "taco", "--root", "nowhere", code=2)
    assert "nowhere" in result.stderr


def test_the_text_encoder_is_trained_without_data(geneoh, tmp_path):
    few = ("steps=1", "batch=2", "validation_batches=1")
    refused = geneoh("train", "--stage", "text", "--data", "runs/data", code=2)
    assert "--data: expected none with --stage text" in refused.stderr
    geneoh("train", "--stage", "text", settings=few)
    assert (tmp_path / "runs" / "text.safetensors").exists()


def test_the_networks_of_the_generator_are_trained_one_after_the_other(geneoh, tmp_path):
    write_actions(tmp_path / "actions")
    run = ("--data", "actions", "-o", "run", "--threads", "1")
    settings = ("steps=1", "batch=3", "validation_batches=1", "interaction.width=32")
    settings += ("interaction.heads=2", "interaction.depth=1", "refiner.depth=1")
    (tmp_path / "small.toml").write_text("\n".join(settings))
    for stage in ACTION_STAGES:
        geneoh("train", "--stage", stage, *run, "--config", "small.toml")
    records = [
        load_checkpoint(tmp_path / "run" / f"{stage}.safetensors").record for stage in ACTION_STAGES
    ]
    assert records[0]["contact"] is None
    assert records[1]["contact"] is not None
    assert records[1]["config"]["interaction"]["text"] == 128
    assert [record["interaction"] is None for record in records] == [True, True, False]
    networks = load_text2hoi(tmp_path / "run")
    assert networks.interaction.config.width == 32


def test_networks_of_the_generator_need_a_folder_of_actions(geneoh, tmp_path):
    missing = geneoh("train", "--stage", "contact", "-o", "run", code=2)
    assert "expected train_*.safetensors" in missing.stderr
    two = geneoh("train", "--stage", "contact", "--data", "a", "--data", "b", code=2)
    assert "--data: expected one source with --stage contact, got 2" in two.stderr
    text = geneoh("train", "--stage", "text", "--text-encoder", "clip", code=2)
    assert "--text-encoder: expected none with --stage text" in text.stderr
    started = geneoh("train", "--stage", "text", "--start", "shipped", "-o", "run", code=2)
    assert "--start: expected none with --stage text" in started.stderr
    cleaner = geneoh("train", "--stage", "motion", "--text-encoder", "clip", code=2)
    assert "--text-encoder: expected none with --stage motion" in cleaner.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("motion", "--mano", "m"), "--mano: expected none with --stage motion and made interact"),
        (("contact", "--mano", "m"), "--mano: expected none with --stage contact and made actions"),
        (("contact", "--set", "recorded.held_out=s9"), "recorded: expected no settings of record"),
    ],
)
def test_options_of_recordings_are_refused_with_made_data(geneoh, words, told):
    refused = geneoh("train", "--stage", *words, "-o", "run", code=2)
    assert told in refused.stderr


@pytest.mark.parametrize(
    ("stage", "setting", "told"),
    [
        ("motion", "temporal.width=32", "got one of the stage temporal; leave it out"),
        ("motion", "motion_level=400", "got one of the stage spatial or temporal or relations"),
        ("spatial", "autoencoder_steps=5", "got one of the stage latent"),
        ("contact", "interaction={depth=2}", "got one of the stage interaction"),
        ("refiner", "losses.points=32", "got one of the stage interaction"),
        ("body_hands", "gestures=0.1", "got one of the stage text_hands"),
        ("blend", "text_hands.width=32", "got one of the stage text_hands"),
        ("length", "contact.latent=8", "'contact' is no setting"),
        ("motion", "clips.reach=0.2", "got one of recordings"),
    ],
)
def test_settings_that_a_stage_does_not_read_are_refused_on_the_command_line(
    geneoh, tmp_path, stage, setting, told
):
    refused = geneoh("train", "--stage", stage, "--set", setting, "-o", "run", code=2)
    assert told in refused.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_serves_several_stages_may_change_for_others_when_a_run_goes_on(
    geneoh, tmp_path
):
    made = ("count=2", "shard=1", "points=64", *ANYTHING)
    geneoh("synthesize", settings=made)
    common = "batch=2\nvalidation_batches=1\nmotion.depth=1\nmotion.width=16\n"
    run = ("train", "--stage", "motion", "--config", "all.toml")
    (tmp_path / "all.toml").write_text(f"steps=1\n{common}temporal.depth=1\nsynthesis.count=2")
    geneoh(*run)
    (tmp_path / "all.toml").write_text(f"steps=2\n{common}temporal.depth=3\nmotion_steps=5")
    geneoh(*run)
    assert load_checkpoint(tmp_path / "runs" / "motion_state.safetensors").record["step"] == 2
    other = geneoh(*run, "--set", "motion.depth=2", code=2)
    assert "motion.depth 1 where 2 is asked for" in other.stderr


def test_settings_that_others_take_the_place_of_are_refused(geneoh, tmp_path):
    write_actions(tmp_path / "actions")
    text = geneoh(
        "train", "--stage", "contact", "--data", "actions", "--set", "contact.text=7", code=2
    )
    assert "--set contact.text=7: expected 128, as in the weights" in text.stderr
    made = ("count=2", "shard=1", "points=64", *ANYTHING)
    geneoh("synthesize", settings=made)
    few = ("--set", "steps=1", "--set", "batch=2")
    start = ("--start", "shipped", "--set", "autoencoder_steps=5")
    started = geneoh("train", "--stage", "latent", *few, *start, code=2)
    assert "--set autoencoder_steps=5: expected 0, as in the weights" in started.stderr
    data = geneoh("train", "--stage", "motion", *few, "--set", "synthesis.count=4", code=2)
    assert "were made with count 2 where 4 is asked for" in data.stderr
    assert not (tmp_path / "runs" / "motion.safetensors").exists()


def test_the_generator_learns_lengths_and_contact_from_recordings_of_a_data_set(geneoh, tmp_path):
    labelled_h2o(tmp_path / "h2o", POUR_MILK)
    mano = write_mano(tmp_path / "mano")
    few = ("steps=1", "batch=2", "validation_batches=1", "recorded.points=64")
    run = ("train", "--data", "h2o=h2o", "--mano", mano)
    for stage in ("length", "contact"):
        trained = geneoh(*run, "--stage", stage, settings=few)
        assert trained.stdout.startswith(
            "h2o: 1 actions of 1 objects, validated on the training data"
        )
        record = load_checkpoint(tmp_path / "runs" / f"{stage}.safetensors").record
        assert record["made"]["source"] == "h2o"
    tuned, few = (*run, "--stage", "length", "-o", "tuned"), (*few, "rate=1e-6")
    geneoh(*tuned, "--start", "shipped", settings=few)
    after = load_checkpoint(tmp_path / "tuned" / "length.safetensors").tensors
    for name, before in load_checkpoint(SHIPPED / "length.safetensors").tensors.items():
        torch.testing.assert_close(after[name], before, atol=2e-3, rtol=2e-3)
    geneoh(*tuned, "--start", "tuned/nothing", settings=few, code=2)
    few = (*few, "length.hidden=24")
    other = geneoh(*tuned, "--start", "shipped", settings=few, code=2)
    assert "length.safetensors: expected weights of the length network that is asked for" in (
        other.stderr
    )
    refused = geneoh("train", "--stage", "length", "--data", "dexycb=h2o", code=2)
    assert "expected h2o, grab, arctic, whose recordings come with labels" in refused.stderr


@pytest.mark.slow
def test_bodies_with_sentences_are_made_and_other_kinds_of_data_are_told_apart(geneoh, tmp_path):
    small = ("--count", 4, "--set", "shard=2", "--set", "frames=20")
    made = geneoh("synthesize", "--bodies", *small, "-o", "bodies")
    assert "2 shards made, of 2 bodies each" in made.stdout
    assert len(read_gestures(tmp_path / "bodies", "train").body) == 2
    for wrong, told in (
        (("--bodies", "--actions"), "--bodies: expected no --actions with it"),
        (("--bodies", "--objects", "."), "--objects: expected none with --bodies"),
        (("--with-actions", "bodies"), "--with-actions: expected --bodies with it"),
        (("--bodies", "--with-actions", "none"), "none: expected val_"),
        (("--unit", "mm"), "--unit is of the meshes of --objects, which is not given"),
    ):
        refused = geneoh("synthesize", *wrong, "-o", "other", code=2)
        assert told in refused.stderr


@pytest.mark.parametrize(
    ("kind", "setting", "of"),
    [
        ("--actions", "animation.object.table_share=0.8", "interactions"),
        ("--actions", "grasps.grips=4", "interactions"),
        ("--actions", "acting.hand.restless_share=1.0", "interactions"),
        ("--actions", "acting.hand.regrasp_opening=1.0", "interactions"),
        ("--actions", "acting.setup.parts.table_share=1.0", "interactions"),
        ("--bodies", "handling=0.5", "--with-actions"),
    ],
)
def test_settings_that_a_kind_of_data_does_not_read_are_refused(geneoh, kind, setting, of):
    refused = geneoh("synthesize", kind, settings=(setting,), code=2)
    assert f"expected a setting that this run reads, got one of {of}; leave" in refused.stderr


@pytest.mark.parametrize(
    ("kind", "settings", "told"),
    [
        (None, ("frames=1",), "'frames' must be 2 to 9000, got 1"),
        (None, ("frames=100000000",), "'frames' must be 2 to 9000, got 100000000"),
        ("--bodies", ("frames=9001",), "'frames' must be 2 to 9000, got 9001"),
        (None, ("frames=9000",), "at most 1000000, got 256 clips of 9000 frames; lower one"),
        ("--bodies", ("frames=9000", "shard=112"), "at most 1000000, got 112 clips of 9000"),
        ("--actions", ("frames=40",), "'frames' must be 150, which all actions have, got 40"),
    ],
)
def test_clips_that_are_too_long_or_too_short_to_make_are_one_sentence(
    geneoh, tmp_path, kind, settings, told
):
    refused = geneoh("synthesize", *filter(None, [kind]), "-o", "data", settings=settings, code=2)
    assert len(refused.stderr.strip().splitlines()) == 1
    assert told in refused.stderr
    assert list(tmp_path.iterdir()) == []
