import json
import math
from dataclasses import asdict, replace

import pytest
import torch
import trimesh
from made_grasps import ANY_GRASP

from geneoh.errors import InputError
from geneoh.evaluation import realism, realism_clips
from geneoh.evaluation.realism import (
    compare_clips,
    comparisons,
    controls,
    measure_realism,
    one_snippet_each,
    table,
)
from geneoh.evaluation.realism_clips import (
    AT_OBJECT,
    FPS,
    MESH_EVERY,
    HandClips,
    recorded_clip,
    synthetic_clips,
    vertex_areas,
)
from geneoh.evaluation.two_sample_classifier import BLOCK, SNIPPET, VIEWS
from geneoh.geometry.mesh import Mesh
from geneoh.hand.library import load_hand
from geneoh.hand.skeleton import bone_lengths
from geneoh.sequence.sequence import HandTrack, ObjectTrack, Sequence
from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.shards import write_shards

FRAMES = 2 * BLOCK + 4


def ball(radius: float) -> Mesh:
    shape = trimesh.creation.icosphere(4, radius)
    return Mesh(torch.from_numpy(shape.vertices).float(), torch.from_numpy(shape.faces).long())


def made(seed: int, count: int, frames: int, shake: float = 0.001, drift: float = 0.0) -> HandClips:
    """Relaxed hands that shake at random places near an object that drifts along x."""
    generator = torch.Generator().manual_seed(seed)
    hand = load_hand("right")
    rest = hand.shaped(torch.zeros(10)).posed(hand.pose_mean, torch.zeros(3)).joints
    place = 0.02 * torch.randn(count, 1, 1, 3, generator=generator)
    noise = shake * torch.randn(count, frames, 21, 3, generator=generator)
    local = rest + place + noise
    world = local.clone()
    world[..., 0] += drift * torch.arange(frames)[:, None]
    everywhere = torch.ones(count, frames, dtype=torch.bool)
    return HandClips(
        world,
        local,
        valid=everywhere,
        near=everywhere,
        area=torch.linspace(1e-3, 3e-3, 50),
        fingers=torch.full((50,), 3.0),
        depth=torch.linspace(0, 0.004, 50),
        touching=torch.arange(50) < 40,
    )


def test_the_same_source_is_told_from_itself_by_nothing():
    report = compare_clips(made(0, 1, FRAMES), made(1, 60, 40))
    assert report.clips == 60
    assert report.snippets == (2 * (BLOCK - SNIPPET + 1), 60)
    by_name = {row.name: row for row in report.measures}
    assert by_name["wrist, speed, object"].distance < 0.2
    assert by_name["fingertips, acceleration, world"].distance < 0.1
    assert by_name["skin in contact"].distance == 0
    assert json.loads(json.dumps(asdict(report)))["clips"] == 60


def test_measures_are_what_was_put_in():
    real, other = made(0, 1, FRAMES, shake=0.0, drift=0.01), made(1, 3, 40, shake=0.0)
    other = replace(other, depth=other.depth + 0.01)
    rows = {row.name: row for row in comparisons(real, other)}
    assert rows["wrist, speed, world"].real.median == pytest.approx(0.01 * FPS, rel=1e-3)
    assert rows["wrist, speed, world"].synthetic.high == pytest.approx(0, abs=1e-4)
    assert rows["wrist, speed, world"].distance == 1
    assert rows["wrist, speed, object"].real.high == pytest.approx(0, abs=1e-4)
    assert rows["wrist, acceleration, world"].real.high == pytest.approx(0, abs=0.01)
    # of the frames that touch: 40 of 50 on a ramp from 10 to 30 cm² and from 0 to 4 mm
    assert rows["skin in contact"].real.median == pytest.approx(10 + 20 * 19.5 / 49, rel=1e-3)
    assert rows["penetration depth"].distance == 1
    assert rows["penetration depth"].synthetic.low == pytest.approx(10 + 4 * 1.95 / 49, rel=1e-3)
    assert rows["fingertips in contact"].real.median == 3
    flexions = [row for name, row in rows.items() if "flexion" in name]
    assert len(flexions) == 15
    assert all(0 <= row.real.low <= row.real.high < 180 for row in flexions)


def test_frames_that_were_not_observed_do_not_count():
    real = made(0, 1, FRAMES)
    gap = real.valid.clone()
    gap[0, 20] = False
    world = real.world.clone()
    world[0, 20] += 5.0
    rows = comparisons(replace(real, valid=gap, world=world), made(1, 3, 40))
    assert all(row.real.high < 40 for row in rows if "speed" in row.name)


def test_a_shakier_recording_is_told_apart_and_the_control_is_not():
    report = compare_clips(made(0, 1, FRAMES, shake=0.004), made(1, 60, FRAMES))
    assert report.accuracy["motion"] > 0.95
    assert report.control["motion"] < 0.75
    assert report.control.keys() == report.accuracy.keys() == set(VIEWS)


def test_each_clip_gives_one_snippet_of_frames_at_the_object():
    some = made(0, 5, 50)
    near = some.near.clone()
    near[1] = False
    near[2, :15] = False
    found = one_snippet_each(replace(some, near=near))
    assert found.shape == (4, SNIPPET, 21, 3)
    starts = (some.object[2].unfold(0, SNIPPET, 1).permute(0, 3, 1, 2) == found[1]).flatten(1)
    assert int(torch.nonzero(starts.all(-1))[0, 0]) >= 15


@pytest.mark.parametrize(("recorded", "clip"), [(FRAMES, 12), (8, 40), (8, 12)])
def test_clips_shorter_than_a_snippet_have_none(recorded, clip):
    with pytest.raises(InputError, match="take a longer recording or more data"):
        compare_clips(made(0, 1, recorded), made(1, 60, clip))


def test_controls_need_clips_of_two_blocks():
    assert math.isnan(controls(made(0, 4, BLOCK), made(1, 8, 40).object[:, :SNIPPET])["place"])


def test_too_short_a_recording_is_refused_with_what_is_needed():
    with pytest.raises(InputError, match=rf"blocks of {BLOCK} frames .* got 1 block and 60 clips"):
        compare_clips(made(0, 1, BLOCK + 5), made(1, 60, 40))


def test_vertex_areas_add_up_to_the_surface():
    areas = vertex_areas(ball(0.05))
    assert float(areas.sum()) == pytest.approx(4 * math.pi * 0.05**2, rel=0.01)
    assert float(areas.max() / areas.min()) < 2


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_recording_is_measured_as_a_right_hand_around_its_object(mirrored):
    hand = load_hand("right")
    pose = hand.pose_mean.expand(8, 16, 3).clone()
    shaped = hand.shaped(torch.zeros(10))
    tip = shaped.posed(pose[0], torch.zeros(3)).joints[8]
    shift = torch.tensor([0.01, 0.0, 0.0]) * torch.arange(8)[:, None]
    track = HandTrack(
        side="right",
        valid=torch.arange(8) != 3,
        joints=shaped.posed(pose, shift).joints,
        pose=pose,
        wrist=shift,
        betas=torch.zeros(10),
        hand_model="embedded",
        confidence=(torch.arange(8) != 1).float()[:, None].expand(8, 21),
    )
    # the index fingertip is 2 mm inside a ball that moves along
    motion = ObjectTrack(
        (ball(0.02),),
        torch.eye(3).expand(8, 1, 3, 3),
        (tip + torch.tensor([0.0, -0.018, 0.0]) + shift)[:, None],
        valid=torch.arange(8)[:, None] != 5,
    )
    if mirrored:
        track, motion = track.mirrored(), motion.mirrored()
    found = recorded_clip(Sequence((track,), motion, 30.0), hand)
    assert found.valid[0].tolist() == [i not in (1, 3, 5) for i in range(8)]
    assert bool(found.near[0][found.valid[0]].all())
    assert len(found.depth) == 5
    assert float(found.depth.min()) > 0.001
    assert float(found.depth.max()) < 0.02
    assert bool((found.fingers >= 1).all())
    still = found.object[0, [0, 7], 0]
    torch.testing.assert_close(still[0], still[1], atol=1e-5, rtol=0)
    apart = found.object[0, 0, 8].norm()
    assert float(apart) == pytest.approx(0.018, abs=1e-3)
    assert float(apart) < AT_OBJECT


def test_synthetic_clips_are_measured_frame_by_frame(tmp_path, monkeypatch):
    config = SynthesisConfig(count=6, frames=40, points=16, shard=2, grasps=ANY_GRASP)
    hand = load_hand("right")
    write_shards(tmp_path, config, seed=0)
    monkeypatch.setattr(realism_clips, "CLIPS_PER_SHARD", 1)
    found = synthetic_clips(tmp_path, hand)
    assert found.world.shape == (2, 40, 21, 3), "two training shards, one clip of each"
    assert len(found.depth) == 2 * 40 // MESH_EVERY
    assert bool((found.touching | (found.depth == 0)).all())

    augmented = synthetic_clips(tmp_path, hand, augmented=True)
    again = synthetic_clips(tmp_path, hand, augmented=True)
    assert torch.equal(augmented.world, again.world)
    torch.testing.assert_close(bone_lengths(augmented.world), bone_lengths(found.world))
    calm, restless = (
        each.object.diff(n=2, dim=1).norm(dim=-1).mean() for each in (found, augmented)
    )
    assert restless > 2 * calm


@pytest.mark.parametrize("augmented", [False, True])
def test_the_report_says_whether_the_clips_were_augmented(monkeypatch, tmp_path, augmented):
    monkeypatch.setattr(realism, "recorded_clip", lambda recording, hand: made(0, 1, FRAMES))
    monkeypatch.setattr(realism, "synthetic_clips", lambda *_, augmented: made(1, 20, 40))
    recording = Sequence((), ObjectTrack((), torch.eye(3)[None, None], torch.zeros(1, 1, 3)), 30.0)
    report = measure_realism(recording, tmp_path, augmented=augmented)
    assert asdict(report)["augmented"] is augmented


def test_the_table_has_a_line_for_each_measure_and_view():
    report = compare_clips(made(0, 1, FRAMES), made(1, 20, 40))
    lines = table(report)
    assert len(lines) == 1 + len(report.measures) + 2 + len(VIEWS)
    assert all(len(line) <= 100 for line in lines)
    assert any(line.startswith("wrist, speed, world m/s") for line in lines)
