from dataclasses import replace

import numpy as np
import pytest
import torch
from draws import seeded
from made_grasps import ANY_GRASP
from safetensors import safe_open
from safetensors.torch import save_file

from geneoh.errors import InputError
from geneoh.geometry.rotations import axis_angle_to_matrix
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import bone_lengths
from geneoh.synthesis import attempts
from geneoh.synthesis.attempts import Attempts
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.grasping.grasps import synthesize_grasps
from geneoh.synthesis.motions.motion import Interactions
from geneoh.synthesis.replay import Replay, replay_shard
from geneoh.synthesis.shapes.objects import draw_objects
from geneoh.synthesis.shards import read_shard, write_shards

TINY = SynthesisConfig(count=12, frames=60, points=32, shard=6, grasps=ANY_GRASP)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Shards of grasps that hardly descend, every fourth of which is kept."""

    def picky(solids, offsets, config, *, generator, toward):
        grasps = synthesize_grasps(solids, offsets, config, generator=generator, toward=toward)
        return replace(grasps, kept=torch.arange(len(offsets)) % 4 == 3)

    folder = tmp_path_factory.mktemp("data")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(attempts, "synthesize_grasps", picky)
        write_shards(folder, TINY, seed=3)
    return folder


def test_clips_of_the_first_round_are_found_with_their_own_objects(folder):
    for name, families in (
        ("val_00000", set(TINY.held_out)),
        ("train_00001", set(TINY.common)),
    ):
        found = replay_shard(folder / f"{name}.safetensors")
        assert len(found.clips.wrist) == 4, "every fourth of 19 that were tried first"
        assert torch.equal(found.clips.wrist, read_shard(folder / f"{name}.safetensors").wrist[:4])
        assert set(found.made_from.families) <= families
        # the stored points lie on the objects that were drawn again
        off = found.made_from.solids.signed_distance(found.clips.points)
        assert float(off.abs().max()) < 1e-5


def test_hands_with_skin_have_the_clips_own_bones_and_place(folder):
    found = replay_shard(folder / "train_00001.safetensors")
    frames = torch.tensor([[0, 59]]).expand(4, 2)
    skin = found.skin(frames)
    local = found.in_object(found.joints)
    torch.testing.assert_close(skin.joints, local[:, [0, 59]], atol=1e-5, rtol=0)
    tips = torch.cdist(skin.joints[:, :, [4, 8, 12, 16, 20]], skin.verts).amin(-1)
    assert float(tips.max()) < 0.01, "skin is around the stretched bones too"
    plain = load_hand("right").shaped(torch.zeros(10)).offsets.norm(dim=-1)
    lengths = bone_lengths(skin.joints)[:, 0]
    assert float((lengths.sort(-1).values - plain.sort().values).abs().max()) > 0.002


def test_the_held_frame_is_one_where_the_fingers_are_nearest(folder):
    found = replay_shard(folder / "train_00001.safetensors")
    held = found.held_frames()
    every = torch.arange(60).expand(4, 60)
    joints = found.skin(every).joints
    distance = found.distance(joints[:, :, 1:], every)
    gap = distance.abs().mean(-1)
    assert torch.equal((gap + (-distance.amin(-1)).clamp(min=0)).argmin(-1), held)
    # the fingers are farther off in the frames where the hand comes or goes
    assert float((gap.amax(-1) - gap.gather(1, held[:, None])[:, 0]).max()) > 0.02


def test_some_of_the_clips_are_the_same_clips(folder):
    found = replay_shard(folder / "train_00001.safetensors")
    some = found.take([2, 0], "B")
    assert torch.equal(some.clips.wrist, found.clips.wrist[[2, 0]])
    assert some.made_from.families.tolist() == [found.made_from.families[i] for i in (2, 0)]
    frames = torch.zeros(len(found.clips.wrist), 1, dtype=torch.long)
    torch.testing.assert_close(some.skin(frames[:2]).verts, found.skin(frames).verts[[2, 0]])


def test_a_shard_of_other_people_than_its_seed_draws_is_refused(folder, tmp_path):
    path = tmp_path / "train_00001.safetensors"
    with safe_open(folder / path.name, framework="pt") as shard:
        tensors = {name: shard.get_tensor(name) for name in shard.keys()}  # noqa: SIM118
        record = shard.metadata()
    save_file(tensors | {"offsets": 1.01 * tensors["offsets"]}, path, metadata=record)
    with pytest.raises(InputError, match="another version of geneoh made it"):
        replay_shard(path)


def test_hands_with_the_same_bones_are_not_given_the_object_of_another_one(tmp_path):
    write_shards(tmp_path, replace(TINY, count=2, shard=1, shape_std=0.0, bone_std=0.0), seed=3)
    with pytest.raises(InputError, match="or hands have the same bones"):
        replay_shard(tmp_path / "train_00001.safetensors")


def test_distance_follows_the_part_that_has_moved():
    """A chest is as far from points of its lid when that is opened as when it was drawn."""
    solids = draw_objects(["chest"], generator=seeded())
    points, _ = solids.only(1).surface_points(64, generator=seeded(1))
    turn, shift = solids.joint_pose(torch.linspace(0, float(solids.travel[0, 1]), 3)[None])
    world = axis_angle_to_matrix(torch.tensor([0.3, -1.0, 0.5]))
    rotation = torch.stack([world.expand(1, 3, 3, 3), world @ turn], dim=2)
    translation = torch.stack([torch.ones(1, 3, 3), 1 + shift @ world.T], dim=2)
    hand = load_hand("right").shaped(torch.zeros(1, 10))
    clip = Interactions(
        points,
        points,
        torch.ones(1, 64, dtype=torch.long),
        rotation,
        translation,
        torch.zeros(1, 3, 16, 3),
        torch.zeros(1, 3, 3),
        hand.offsets,
        torch.tensor([-1]),
    )
    replay = Replay(clip, Attempts(np.array(["chest"]), solids, hand, torch.zeros(0).long()))
    pulled = points[:, None] @ turn.mT + shift[:, :, None]
    every = torch.arange(3)[None]
    assert float(replay.distance(pulled, every).abs().max()) < 1e-5
    in_world = pulled @ world.T + 1
    torch.testing.assert_close(replay.in_object(in_world), pulled, atol=1e-5, rtol=0)
