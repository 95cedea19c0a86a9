import hashlib
from dataclasses import fields, replace
from functools import partial

import pytest
import torch

from geneoh.errors import InputError
from geneoh.hand.library import load_hand
from geneoh.synthesis import shards
from geneoh.synthesis.grasps import Checks, synthesize_grasps
from geneoh.synthesis.motion import Interactions
from geneoh.synthesis.shards import (
    SynthesisConfig,
    read_shards,
    seed_of,
    synthesize_shard,
    write_shards,
)

TINY = SynthesisConfig(count=6, frames=8, points=8, shard=2)
ANYTHING = Checks(depth=1.0, fingers=-1, clearance=-1.0)


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """Grasps that hardly descend and always pass: what they are like is tested elsewhere."""
    monkeypatch.setattr(
        shards, "synthesize_grasps", partial(synthesize_grasps, steps=1, checks=ANYTHING)
    )


@pytest.fixture
def hand():
    return load_hand("right")


def contents(folder) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_shards_are_split_and_counted(tmp_path, hand):
    heard = []
    made = write_shards(
        tmp_path / "new" / "folder", TINY, hand, seed=0, on_shard=lambda *at: heard.append(at)
    )
    names = sorted(contents(tmp_path / "new" / "folder"))
    assert names == [
        f"{s}_{i:05d}.safetensors" for s, i in (("train", 1), ("train", 2), ("val", 0))
    ]
    assert made == 3
    assert heard == [(1, 3), (2, 3), (3, 3)]


def test_equal_seeds_give_equal_bytes(tmp_path, hand):
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        write_shards(tmp_path / name, TINY, hand, seed=seed)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")
    other = contents(tmp_path / "c")
    assert all(other[name] != data for name, data in contents(tmp_path / "a").items())


def test_an_interrupted_run_makes_only_what_is_missing(tmp_path, hand):
    write_shards(tmp_path, TINY, hand, seed=0)
    whole = contents(tmp_path)
    (tmp_path / "train_00001.safetensors").unlink()
    (tmp_path / "train_00001.part").write_bytes(b"half written")
    kept = {p.name: p.stat().st_mtime_ns for p in tmp_path.glob("*.safetensors")}
    assert write_shards(tmp_path, TINY, hand, seed=0) == 1
    assert contents(tmp_path) == whole
    assert all((tmp_path / n).stat().st_mtime_ns == then for n, then in kept.items())
    assert write_shards(tmp_path, TINY, hand, seed=0) == 0


def test_held_out_families_are_in_validation_shards_only(tmp_path, hand, monkeypatch):
    drawn, draw = [], shards.draw_objects

    def listening(families, *, generator):
        drawn.append(families)
        return draw(families, generator=generator)

    monkeypatch.setattr(shards, "draw_objects", listening)
    config = replace(TINY, count=16)
    write_shards(tmp_path, config, hand, seed=0)
    validation, *training = drawn
    assert set(validation) <= set(config.held_out)
    assert len(training) == 7
    assert not {name for names in training for name in names} & set(config.held_out)


def test_a_shard_is_filled_from_the_grasps_that_were_kept(hand, monkeypatch):
    calls = []

    def choosy(solids, offsets, *, generator):
        calls.append(len(offsets))
        grasps = synthesize_grasps(solids, offsets, generator=generator, steps=1, checks=ANYTHING)
        kept = torch.zeros_like(grasps.kept)
        kept[: len(calls) - 1] = True  # none, one, two
        return replace(grasps, kept=kept)

    monkeypatch.setattr(shards, "synthesize_grasps", choosy)
    generator = torch.Generator().manual_seed(0)
    made = synthesize_shard(TINY, ["box"], hand, generator=generator)
    assert len(calls) == 3
    assert all(len(getattr(made, f.name)) == TINY.shard for f in fields(Interactions))


def test_a_split_is_read_as_it_was_made(tmp_path, hand):
    write_shards(tmp_path, TINY, hand, seed=0)
    train, val = (read_shards(tmp_path, split) for split in ("train", "val"))
    assert train.pose.shape == (4, 8, 16, 3)
    assert val.points.shape == (2, 8, 3)
    assert float(train.offsets.norm(dim=-1).std(0).min()) > 0, "people differ in size"
    generator = torch.Generator().manual_seed(seed_of(0, "shard", 0))
    again = synthesize_shard(TINY, list(TINY.held_out), hand, generator=generator)
    for field in fields(Interactions):
        assert torch.equal(getattr(val, field.name), getattr(again, field.name))


def test_a_folder_without_the_split_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"expected train_\*\.safetensors, found none"):
        read_shards(tmp_path, "train")


def test_seeds_are_the_same_everywhere_and_differ_by_every_part():
    digest = hashlib.sha256(b"0/shard/12").digest()
    assert seed_of(0, "shard", 12) == int.from_bytes(digest[:8], "big") // 2
    assert len({seed_of(a, b) for a in range(20) for b in ("x", "y")}) == 40
    assert all(0 <= seed_of(i) < 2**63 for i in range(100))
