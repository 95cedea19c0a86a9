import hashlib
import json
import os
import re
import shutil
from dataclasses import dataclass, fields, replace
from pathlib import Path

import pytest
import torch
from draws import seeded
from made_actions import write_actions
from made_gestures import made_gestures, write_gesture_shards
from made_grasps import ANY_GRASP
from safetensors.torch import load_file, save_file

from geneoh.config import as_dict
from geneoh.errors import ConfigError, InputError
from geneoh.seeds import seed_of
from geneoh.synthesis import attempts
from geneoh.synthesis.action_shards import read_actions
from geneoh.synthesis.attempts import synthesize_shard
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.gestures.shards import read_gestures
from geneoh.synthesis.grasping.bimanual import BimanualConfig
from geneoh.synthesis.grasping.grasps import synthesize_grasps
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.shapes.families import FAMILIES
from geneoh.synthesis.shards import (
    ShardRecord,
    read_shards,
    record_differences,
    shard_record,
    write_shards,
)

TINY = SynthesisConfig(count=6, frames=8, points=8, shard=2, grasps=ANY_GRASP)


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """The shards of seed 0, to be left as they are."""
    folder = tmp_path_factory.mktemp("made")
    write_shards(folder, TINY, seed=0)
    return folder


@pytest.fixture
def data(made, tmp_path) -> Path:
    """A copy of them, to be damaged."""
    return Path(shutil.copytree(made, tmp_path / "data"))


def contents(folder) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_shards_are_split_and_counted(tmp_path):
    heard = []
    made = write_shards(
        tmp_path / "new" / "folder", TINY, seed=0, on_shard=lambda *at: heard.append(at)
    )
    names = sorted(contents(tmp_path / "new" / "folder"))
    assert names == [
        f"{s}_{i:05d}.safetensors" for s, i in (("train", 1), ("train", 2), ("val", 0))
    ]
    assert made == 3
    assert heard == [(1, 3), (2, 3), (3, 3)]


def test_equal_seeds_give_equal_bytes(made, tmp_path):
    for name, seed in (("b", 0), ("c", 1)):
        write_shards(tmp_path / name, TINY, seed=seed)
    assert contents(made) == contents(tmp_path / "b")
    other = contents(tmp_path / "c")
    assert all(other[name] != data for name, data in contents(made).items())


def test_several_processes_write_the_bytes_of_one(made, tmp_path):
    heard = []
    write_shards(tmp_path, TINY, seed=0, jobs=2, on_shard=lambda *at: heard.append(at))
    assert contents(tmp_path) == contents(made)
    assert heard == [(1, 3), (2, 3), (3, 3)]
    assert write_shards(tmp_path, TINY, seed=0, jobs=2) == 0


def test_an_interrupted_run_makes_only_what_is_missing(data):
    whole = contents(data)
    (data / "train_00001.safetensors").unlink()
    left = data / ".train_00001.safetensors.0.tmp"
    left.write_bytes(b"half written")
    os.utime(left, (0, 0))
    kept = {p.name: p.stat().st_mtime_ns for p in data.glob("*.safetensors")}
    assert write_shards(data, TINY, seed=0) == 1
    assert contents(data) == whole
    assert all((data / n).stat().st_mtime_ns == then for n, then in kept.items())
    assert write_shards(data, TINY, seed=0) == 0


def test_held_out_families_are_in_validation_shards_only(tmp_path, monkeypatch):
    drawn, draw = [], attempts.draw_objects

    def listening(families, **rest):
        drawn.append(families)
        return draw(families, **rest)

    monkeypatch.setattr(attempts, "draw_objects", listening)
    config = replace(TINY, count=16)
    write_shards(tmp_path, config, seed=0)
    validation, *training = drawn
    assert set(validation) <= set(config.held_out)
    assert len(training) == 7
    assert not {name for names in training for name in names} & set(config.held_out)


def test_a_shard_is_filled_from_the_grasps_that_were_kept(monkeypatch):
    calls = []

    def choosy(solids, offsets, config, *, generator, toward):
        calls.append(len(offsets))
        grasps = synthesize_grasps(solids, offsets, config, generator=generator, toward=toward)
        kept = torch.zeros_like(grasps.kept)
        kept[: len(calls) - 1] = True  # none, one, two
        return replace(grasps, kept=kept)

    monkeypatch.setattr(attempts, "synthesize_grasps", choosy)
    generator = seeded()
    made = synthesize_shard(TINY, ["box"], generator=generator)
    assert len(calls) == 3
    assert all(len(getattr(made, f.name)) == TINY.shard for f in fields(Interactions))


def test_a_split_is_read_as_it_was_made(data):
    train, val = (read_shards(data, split).take(slice(None)) for split in ("train", "val"))
    assert train.pose.shape == (4, 8, 16, 3)
    assert val.points.shape == (2, 8, 3)
    assert float(train.offsets.norm(dim=-1).std(0).min()) > 0, "people differ in size"
    generator = seeded(seed_of(0, "shard", 0))
    again = synthesize_shard(TINY, list(TINY.held_out), generator=generator)
    for field in fields(Interactions):
        assert torch.equal(getattr(val, field.name), getattr(again, field.name))


@pytest.mark.parametrize(
    ("change", "seed", "words"),
    [
        ({"count": 8}, 0, "count 6 where 8 is asked for"),
        ({"bone_std": 0.0}, 0, "bone_std 0.04 where 0.0 is asked for"),
        ({}, 1, "seed 0 where 1 is asked for"),
    ],
)
def test_a_folder_of_another_config_or_seed_is_refused_and_left_alone(data, change, seed, words):
    (data / "val_00000.safetensors").unlink()
    before = contents(data)
    with pytest.raises(InputError, match=f"was made with {words}; .* name another folder"):
        write_shards(data, replace(TINY, **change), seed=seed)
    assert contents(data) == before


@dataclass(frozen=True)
class OtherObjects:
    """Stands in for scanned objects."""

    fingerprint: str = "abc"


def test_objects_where_there_were_none_are_told(data):
    with pytest.raises(InputError, match="was made with objects none where abc is asked for"):
        write_shards(data, TINY, seed=0, scans=OtherObjects())


def test_shards_that_do_not_belong_together_are_not_read(data, tmp_path):
    write_shards(tmp_path / "other", TINY, seed=1)
    name = "train_00002.safetensors"
    (tmp_path / "other" / name).replace(data / name)
    words = f"{name}: was made with other settings than train_00001.safetensors .seed 1 where 0"
    with pytest.raises(InputError, match=words):
        read_shards(data, "train")
    assert len(read_shards(data, "val")) == 2


@pytest.mark.parametrize("kept", [0, 5, 200, -1])
def test_a_truncated_shard_is_told_with_the_cure(data, kept):
    path = data / "train_00002.safetensors"
    path.write_bytes(path.read_bytes()[:kept])
    told = r"train_00002\.safetensors: expected a whole shard .* delete it and run"
    for act in (
        lambda: read_shards(data, "train"),
        lambda: write_shards(data, TINY, seed=0),
    ):
        with pytest.raises(InputError, match=told):
            act()


def damaged_shard(folder, name: str, at: tuple[int, ...], value: float) -> None:
    """Give the shard for validation another value in one of its tensors."""
    path = folder / "val_00000.safetensors"
    tensors, record = load_file(path), json.dumps(as_dict(ShardRecord(TINY, 0)))
    tensors[name][at] = value
    save_file(tensors, path, metadata={"record": record})


@pytest.mark.parametrize("number", [1e5, float("nan"), float("-inf")])
def test_a_shard_with_numbers_that_no_hand_has_is_told_with_the_cure(data, number):
    damaged_shard(data, "wrist", (1, 3), number)
    with pytest.raises(InputError, match="got numbers beyond 1000 in 'wrist'; delete it"):
        read_shards(data, "val")


@pytest.mark.parametrize(("name", "at"), [("offsets", (1, 4)), ("rotation", (0, 3, 0))])
def test_a_shard_without_bones_or_with_rotations_that_are_none_is_told(data, name, at):
    damaged_shard(data, name, at, 0.0)
    with pytest.raises(InputError, match=r"got (bones of 0|rotations whose rows)"):
        read_shards(data, "val")


@pytest.mark.parametrize("part", [-1, 2, 2**40])
def test_a_shard_with_points_of_parts_that_are_not_there_is_told(data, part):
    damaged_shard(data, "part", (0, 0), part)
    with pytest.raises(InputError, match="numbers in 'part' that are not from 0 to 1"):
        read_shards(data, "val")


def test_a_record_with_a_seed_that_is_no_number_is_told_with_the_cure(tmp_path):
    path = tmp_path / "train_00001.safetensors"
    record = {"record": '{"config": {}, "seed": Infinity}'}
    save_file({"wrist": torch.zeros(1)}, path, metadata=record)
    with pytest.raises(InputError, match="delete it and run"):
        shard_record(path)


def test_a_shard_that_the_system_does_not_give_is_told_with_the_cure(tmp_path):
    (tmp_path / "train_00001.safetensors").mkdir()
    with pytest.raises(InputError, match=r"train_00001\.safetensors: expected a whole shard"):
        read_shards(tmp_path, "train")


def test_shards_may_be_read_by_those_who_may_read_other_new_files(tmp_path):
    write_shards(tmp_path, TINY, seed=0)
    (tmp_path / "other").touch()
    assert len({path.stat().st_mode for path in tmp_path.iterdir()}) == 1


def with_record(folder, config: dict) -> Path:
    """A shard whose record has these settings."""
    path = folder / "train_00001.safetensors"
    record = {"record": json.dumps({"config": config, "seed": 3})}
    save_file({"wrist": torch.zeros(1)}, path, metadata=record)
    return path


def test_settings_that_an_older_shard_does_not_tell_are_the_defaults(tmp_path):
    told = {"count": 6, "frames": 8, "points": 8, "shard": 2, "shape_std": 0.8}
    record = shard_record(with_record(tmp_path, told))
    config = SynthesisConfig(count=6, frames=8, points=8, shard=2)
    assert record == ShardRecord(config, 3, families=32)
    assert record_differences(record, record) == ""
    other = replace(config, bimanual=BimanualConfig(share=0.5))
    words = "bimanual.share 0.2 where 0.5 is asked for"
    assert record_differences(record, replace(record, config=other)) == words
    assert record_differences(record, ShardRecord(config, 3)) == "families 32 where 34 is asked for"


@pytest.mark.parametrize("config", [{"bones": 3}, {"grasps": {"step": 3}}, {"held_out": ["mugg"]}])
def test_settings_that_are_not_known_are_told_as_those_of_another_version(tmp_path, config):
    path = with_record(tmp_path, config)
    with pytest.raises(InputError, match=r"train_00001\.safetensors: was made by another version"):
        shard_record(path)


def test_no_more_second_hands_than_first_ones_can_be_asked_for():
    with pytest.raises(ConfigError, match=r"'share' must be 0 to 1, got 1\.5"):
        BimanualConfig(share=1.5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"held_out": ()}, "held_out must name some object families"),
        ({"held_out": tuple(FAMILIES)}, "leave some for training, got 34 of 34"),
        ({"held_out": ("mugg",)}, "'mugg' is no object family; did you mean 'mug'?"),
        ({"held_out": ("zzz",)}, "'zzz' is no object family; there are box, board"),
        ({"shard": 0}, "'shard' must be 1 or more, got 0"),
        ({"frames": 1}, "'frames' must be 2 to 9000, got 1"),
        ({"validation": 2.0}, "'validation' must be 0 to 1, got 2.0"),
        ({"scanned": -1.0}, "'scanned' must be 0 to 1, got -1.0"),
    ],
)
def test_impossible_configs_are_refused_with_what_is_wrong(change, words):
    with pytest.raises(ConfigError, match=re.escape(words)):
        replace(TINY, **change)


@pytest.mark.parametrize("share", [0.0, 0.9, 1.0])
def test_each_split_has_a_shard(share):
    config = replace(TINY, validation=share)
    assert {config.split_of(index) for index in range(config.shards)} == {"train", "val"}


def test_clips_of_another_kind_are_told_as_what_they_are(made, tmp_path):
    write_actions(tmp_path / "actions")
    write_gesture_shards(tmp_path / "bodies", train=made_gestures(2))
    shutil.copytree(made, tmp_path / "interactions")
    readers = {
        "interactions": read_shards,
        "actions": read_actions,
        "bodies": read_gestures,
    }
    for wanted, read in readers.items():
        for found in readers:
            if found != wanted:
                told = rf"train_\d+\.safetensors: expected {wanted}, got {found}; name another"
                with pytest.raises(InputError, match=told):
                    read(tmp_path / found, "train")


def test_a_place_where_no_folder_can_be_made_is_told(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file: cannot be written"):
        write_shards(tmp_path / "file", TINY, seed=0)


def test_a_folder_without_the_split_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"expected train_\*\.safetensors, found none"):
        read_shards(tmp_path, "train")


def test_seeds_are_the_same_everywhere_and_differ_by_every_part():
    digest = hashlib.sha256(b"0/shard/12").digest()
    assert seed_of(0, "shard", 12) == int.from_bytes(digest[:8], "big") // 2
    assert len({seed_of(a, b) for a in range(20) for b in ("x", "y")}) == 40
    assert all(0 <= seed_of(i) < 2**63 for i in range(100))
