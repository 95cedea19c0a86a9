from dataclasses import replace
from pathlib import Path

import pytest
import torch
from stage_runs import train_stage

from geneoh.errors import CheckpointError, InputError
from geneoh.nn.checkpoint import load_checkpoint
from geneoh.streamed import Streamed
from geneoh.training.resume import digest, refuse_other_run
from geneoh.training.stages import StageTask, build_model, data_digest

CPU = torch.device("cpu")


def test_a_run_of_another_seed_or_network_is_not_continued(tmp_path, clips, tiny):
    train_stage("motion", replace(tiny, steps=2), clips, clips, tmp_path, device=CPU)
    before = (tmp_path / "motion_state.safetensors").read_bytes()
    other = replace(tiny, seed=1, motion=replace(tiny.motion, width=32))
    told = r"motion_state\.safetensors: the saved run has .*motion\.width 16 where 32 .*another out"
    with pytest.raises(CheckpointError, match=told):
        train_stage("motion", other, clips, clips, tmp_path, device=CPU)
    with pytest.raises(CheckpointError, match="seed 0 where 1 is asked for"):
        train_stage("motion", replace(tiny, seed=1), clips, clips, tmp_path, device=CPU)
    assert (tmp_path / "motion_state.safetensors").read_bytes() == before


def test_a_run_is_continued_with_more_steps(tmp_path, clips, tiny):
    train_stage("motion", replace(tiny, steps=2), clips, clips, tmp_path, device=CPU)
    longer = replace(tiny, steps=3, checkpoint_every=1, validate_every=1)
    train_stage("motion", longer, clips, clips, tmp_path, device=CPU)
    assert load_checkpoint(tmp_path / "motion_state.safetensors").record["step"] == 3


def test_a_second_run_of_a_stage_is_kept_out_of_a_folder(tmp_path, clips, tiny):
    def meanwhile(stage):
        def begin(done, total):
            if done == 1:
                train_stage(stage, replace(tiny, seed=1), clips, clips, tmp_path, device=CPU)

        return begin

    with pytest.raises(InputError, match="another run is working in it"):
        train_stage("motion", tiny, clips, clips, tmp_path, device=CPU, on_step=meanwhile("motion"))
    train_stage("motion", tiny, clips, clips, tmp_path, device=CPU, on_step=meanwhile("regression"))
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{stage}{what}"
        for stage in ("motion", "regression")
        for what in (".safetensors", "_log.csv", "_state.safetensors")
    ]


def test_a_run_of_more_steps_than_are_asked_for_is_not_cut_short(tmp_path, clips, tiny):
    train_stage("motion", tiny, clips, clips, tmp_path, device=CPU)
    before = {file.name: file.read_bytes() for file in tmp_path.iterdir()}
    with pytest.raises(CheckpointError, match="has taken 4 steps, more than the 3 that are asked"):
        train_stage("motion", replace(tiny, steps=3), clips, clips, tmp_path, device=CPU)
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_a_damaged_state_is_told_as_that_of_a_run_and_not_as_weights(tmp_path, clips, tiny):
    train_stage("motion", replace(tiny, steps=2), clips, clips, tmp_path, device=CPU)
    state = tmp_path / "motion_state.safetensors"
    state.write_bytes(state.read_bytes()[:100])
    with pytest.raises(CheckpointError, match="to train anew, or choose another output folder"):
        train_stage("motion", tiny, clips, clips, tmp_path, device=CPU)
    assert len(state.read_bytes()) == 100


@pytest.mark.parametrize("part", ["data", "validation"])
def test_a_run_on_other_data_is_not_continued(tmp_path, clips, tiny, part):
    given = {"data": clips, "validation": clips}
    train_stage("motion", tiny, folder=tmp_path, device=CPU, **given)
    (shard,) = clips.shards
    given[part] = Streamed.of([replace(shard, wrist=shard.wrist + 1e-3)])
    words = {"data": "training", "validation": "validation"}[part]
    with pytest.raises(CheckpointError, match=f"the saved run has {words} data"):
        train_stage("motion", tiny, folder=tmp_path, device=CPU, **given)


def test_a_stage_behind_another_motion_network_is_another_run(clips, tiny):
    records = [
        StageTask(
            "spatial", tiny, clips, clips, build_model("motion", replace(tiny, seed=s))
        ).record()
        for s in (0, 0, 1)
    ]
    refuse_other_run(Path("run"), records[0], records[1])
    with pytest.raises(CheckpointError, match="MotionDiff"):
        refuse_other_run(Path("run"), records[0], records[2])


def test_a_record_tells_how_the_data_was_made(clips, tiny):
    made = {"config": {"count": 4}, "seed": 7}
    record = StageTask("motion", tiny, clips, clips, made=made).record()
    assert record["made"] == made
    assert record["sequences"] == 4
    assert record["config"]["motion"]["width"] == 16


def test_a_digest_is_of_values_and_shapes(clips):
    some = torch.arange(6.0)
    assert digest([some]) == digest([some.clone()])
    assert len({digest([some]), digest([some.view(2, 3)]), digest([some + 1]), digest([])}) == 4
    (shard,) = clips.shards
    fields = ("wrist", "offsets", "pose", "translation", "rotation", "points")
    for changed in ({name: 1.01 * getattr(shard, name)} for name in fields):
        assert data_digest(Streamed.of([replace(shard, **changed)])) != data_digest(clips)


def test_a_folder_that_cannot_be_made_is_told(tmp_path, clips, tiny):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        train_stage("motion", tiny, clips, clips, tmp_path / "file" / "run", device=CPU)
