import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from made_actions import made_actions, write_action_shards
from made_grasps import ANY_GRASP

from geneoh.errors import InputError
from geneoh.files.tensors import all_tensors, opened_tensors, write_tensors
from geneoh.streamed import Streamed
from geneoh.synthesis.action_shards import (
    DEFAULTS,
    names_of_shard,
    read_actions,
    synthesize_actions,
)
from geneoh.synthesis.actions.action import Actions
from geneoh.synthesis.shapes.families import FAMILIES
from geneoh.synthesis.shards import write_shards

TINY = replace(DEFAULTS, count=4, shard=2, points=16, grasps=ANY_GRASP)


def numbers(actions: Streamed[Actions]) -> list[int]:
    """The numbers of the objects."""
    return actions.each(lambda shard: shard.name).tolist()


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A training and a validation shard."""
    folder = tmp_path_factory.mktemp("actions")
    assert write_shards(folder, TINY, seed=0, synthesize=synthesize_actions) == 2
    return folder


def test_shards_read_back_with_the_names_of_their_objects(folder):
    actions, names = read_actions(folder, "train")
    assert len(actions) == 2
    assert names == tuple(FAMILIES)
    assert {names[i] for i in numbers(actions)}.isdisjoint(TINY.held_out)
    held_out, _ = read_actions(folder, "val")
    assert {names[i] for i in numbers(held_out)} <= set(TINY.held_out)


def test_shards_that_do_not_say_how_many_families_there_were_have_the_former_names(tmp_path):
    write_action_shards(tmp_path / "data", train=made_actions(seed=0))
    path = tmp_path / "data" / "train_00000.safetensors"
    with opened_tensors(path) as (shard, record):
        tensors, former = all_tensors(shard), {k: v for k, v in record.items() if k != "families"}
    write_tensors(path, tensors, former)
    assert names_of_shard(path) == list(FAMILIES)[:32]
    write_tensors(path, tensors, former | {"families": len(FAMILIES)})
    assert names_of_shard(path) == list(FAMILIES)


def test_the_same_seed_makes_the_same_actions(folder, tmp_path):
    shutil.copy(folder / "val_00000.safetensors", tmp_path)  # which is not made again
    write_shards(tmp_path, TINY, seed=0, synthesize=synthesize_actions)
    one, other = ((f / "train_00001.safetensors").read_bytes() for f in (folder, tmp_path))
    assert one == other


def test_hands_have_the_mean_shape_and_absent_ones_are_zero(folder):
    actions = read_actions(folder, "train")[0].take(slice(None))
    absent = ~actions.hands
    assert (actions.wrist[absent] == 0).all()
    assert (actions.pose[absent] == 0).all()
    assert (actions.wrist[actions.hands].abs().amax((-1, -2)) > 0).all()
    assert torch.isfinite(actions.pose).all()


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"verb": torch.full((6,), 10**9)}, "'verb'"),
        ({"length": torch.full((6,), 10**10)}, "'length'"),
        ({"part": torch.full((6, 48), 2)}, "'part'"),
        ({"wrist": torch.full((6, 2, 20, 3), torch.nan)}, "'wrist'"),
    ],
)
def test_damaged_numbers_are_refused(tmp_path, changed, words):
    write_action_shards(tmp_path / "data", train=replace(made_actions(), **changed))
    with pytest.raises(InputError, match=words):
        read_actions(tmp_path / "data", "train")


def test_actions_without_points_are_refused(tmp_path):
    write_action_shards(tmp_path / "data", train=made_actions().take(slice(0), "P"))
    with pytest.raises(InputError, match="nothing in 'points'"):
        read_actions(tmp_path / "data", "train")
