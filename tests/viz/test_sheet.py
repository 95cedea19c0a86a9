import numpy as np
import pytest
from made_grasps import ANY_GRASP

from geneoh.synthesis.data_config import SynthesisConfig
from geneoh.synthesis.replay import NoFirstGraspsError, replay_shard
from geneoh.synthesis.shapes.families import FAMILIES
from geneoh.synthesis.shards import write_shards
from geneoh.viz import sheet
from geneoh.viz.canvas import SCALE_HEIGHT
from geneoh.viz.sheet import SHEET_GAP, TEXT_HEIGHT, contact_sheet, grasp_scene, one_of_each

TINY = SynthesisConfig(count=4, frames=20, points=16, shard=2, grasps=ANY_GRASP)


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """One clip of each family in two shards of grasps that hardly descend."""
    folder = tmp_path_factory.mktemp("data")
    write_shards(folder, TINY, seed=0)
    return one_of_each(folder)


def test_each_family_is_shown_once_in_the_order_of_the_families(clips):
    names = [clip.made_from.families[0] for clip in clips]
    assert len(set(names)) == len(names) <= 4
    assert names == sorted(names, key=list(FAMILIES).index)
    assert set(names) & set(TINY.held_out)
    assert set(names) - set(TINY.held_out)


def test_a_grasp_is_shown_where_it_is_held(clips):
    scene = grasp_scene(clips[0])
    hand = scene.versions[0].hands[0]
    assert scene.frames == 1
    want = clips[0].skin(clips[0].held_frames()[:, None])
    assert np.allclose(hand.verts[0], want.verts[0, 0])
    assert float(hand.measures.depth[0]) == pytest.approx(max(0.0, -float(hand.distance.min())))


def test_the_sheet_has_a_cell_for_each_clip_with_something_in_it(clips):
    steps = []
    sheet = contact_sheet(clips, cell=48, on_step=lambda *at: steps.append(at))
    count = len(clips)
    assert sheet.shape == (48 + TEXT_HEIGHT + SCALE_HEIGHT, (48 + SHEET_GAP) * count - SHEET_GAP, 3)
    assert steps == [(i + 1, count) for i in range(count)]
    for column in range(count):
        cell = sheet[:48, column * (48 + SHEET_GAP) :][:, :48]
        assert int((cell.max(-1) < 240).sum()) > 100


def test_a_shard_whose_first_grasps_all_failed_leaves_the_sheet_to_the_others(
    clips, tmp_path, monkeypatch
):
    lost = []
    write_shards(tmp_path, TINY, seed=0)

    def replayed(path):
        if path.name in lost:
            raise NoFirstGraspsError(f"{path}: none")
        return replay_shard(path)

    monkeypatch.setattr(sheet, "replay_shard", replayed)
    lost.append("val_00000.safetensors")
    families = [clip.made_from.families[0] for clip in clips]
    common = [family for family in families if family not in TINY.held_out]
    assert [each.made_from.families[0] for each in one_of_each(tmp_path)] == common != families
    lost.append("train_00001.safetensors")
    with pytest.raises(NoFirstGraspsError, match="val_00000"):
        one_of_each(tmp_path)
