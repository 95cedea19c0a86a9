from dataclasses import replace

import pytest
import torch
from made_actions import write_actions

from geneoh.body.motion import pose
from geneoh.body.skeleton import WRISTS
from geneoh.errors import ConfigError
from geneoh.synthesis.gestures.clips import NAMES
from geneoh.synthesis.gestures.manipulation import ActionSource
from geneoh.synthesis.gestures.shards import DEFAULTS, read_gestures, synthesize_gestures
from geneoh.synthesis.shards import write_shards

TINY = replace(DEFAULTS, count=8, shard=4, frames=30)


def made(folder, **how):
    return write_shards(folder, TINY, seed=0, synthesize=synthesize_gestures, **how)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A training and a validation shard."""
    folder = tmp_path_factory.mktemp("bodies")
    assert made(folder) == 2
    return folder


def test_shards_read_back_with_their_sentences(folder):
    clips = read_gestures(folder, "train")
    assert clips.pose.shape == (4, 30, 52, 3)
    assert clips.motion.rotations.shape == (4, 30, 52, 3, 3)
    assert clips.joined.shape == (4, 4)
    for clip in range(4):
        assert "left hand" in clips.left[clip].lower()
        assert "right hand" in clips.right[clip].lower()


def test_the_same_seed_makes_the_same_bodies(folder, tmp_path):
    made(tmp_path)
    one, other = ((f / "train_00001.safetensors").read_bytes() for f in (folder, tmp_path))
    assert one == other


def test_validation_has_variants_and_bodies_that_training_never_has(folder):
    seen, held_out = (read_gestures(folder, split) for split in ("train", "val"))
    first, body = 10 - TINY.held_out, 400 - TINY.held_out_bodies
    assert seen.variant.max() < first
    assert held_out.variant.max() >= first
    assert (held_out.variant[held_out.gesture > 0] >= first).all()
    assert seen.body.max() < body <= held_out.body.min()


def test_some_bodies_do_what_the_hands_of_actions_do(tmp_path):
    write_actions(tmp_path / "actions")
    source = ActionSource.of(tmp_path / "actions")
    made(tmp_path / "bodies", scans=source)
    clips = read_gestures(tmp_path / "bodies", "train")
    held = clips.take((clips.gesture >= NAMES.index("lift")).any(1), "B")
    assert len(held.body) == 1
    assert held.variant.tolist() == [[-1, -1]]
    wrists = pose(held.skeleton, held.motion).positions[0, :, list(WRISTS.values())]
    moved = wrists[-1] - wrists[0]
    done = held.gesture[0] > 0
    last = min(int(held.length), 30) - 1
    rise = 0.2 * last / 19  # of the made actions' objects
    assert torch.allclose(
        moved[done, 1], torch.tensor(min(rise, 0.2)).expand(int(done.sum())), atol=0.06
    )


def test_all_bodies_may_hold_objects(tmp_path):
    write_actions(tmp_path / "actions")
    source, config = ActionSource.of(tmp_path / "actions"), replace(TINY, handling=1.0)
    how = {"seed": 0, "synthesize": synthesize_gestures, "scans": source}
    write_shards(tmp_path / "bodies", config, **how)
    clips = read_gestures(tmp_path / "bodies", "train")
    assert len(clips.body) == 4
    assert (clips.gesture >= NAMES.index("lift")).any(1).all()
    with pytest.raises(ConfigError, match=r"'handling' must be 0 to 1, got 1\.5"):
        replace(TINY, handling=1.5)


def test_all_variants_cannot_be_held_out():
    with pytest.raises(ConfigError, match="'held_out' must be 1 to 9, got 10"):
        replace(DEFAULTS, held_out=10)
