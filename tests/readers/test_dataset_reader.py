"""What all readers share: files of one clip that do not belong together are refused."""

import numpy as np
import pytest
import trees
from trees import scene
from trees.videos import hot3d

from geneoh.errors import InputError
from geneoh.readers.base import ReaderOptions, paths_matching
from geneoh.readers.recordings import find_clips, read_clip, read_one, source_named


def test_a_hand_of_other_frames_than_its_object_is_refused(tmp_path, mano_dir):
    trees.arctic(tmp_path, scene(), False)
    path = next(tmp_path.rglob("*.object.npy"))
    np.save(path, np.load(path)[:-2])
    with pytest.raises(InputError, match=r"expected 7 frames of the right hand, .*, got 9"):
        read_one("arctic", tmp_path, ReaderOptions(mano_dir=mano_dir))


@pytest.mark.parametrize(("field", "other"), [("pose", "'rot' with 9"), ("trans", "9 of the pose")])
def test_parameters_of_one_hand_must_be_of_the_same_frames(field, other, tmp_path, mano_dir):
    trees.arctic(tmp_path, scene(), False)
    path = next(tmp_path.rglob("*.mano.npy"))
    hands = np.load(path, allow_pickle=True).item()
    hands["right"][field] = hands["right"][field][:5]
    np.save(path, hands)
    with pytest.raises(InputError, match=rf"same number of frames.*{other}"):
        read_one("arctic", tmp_path, ReaderOptions(mano_dir=mano_dir))


def test_poses_of_a_source_that_act_on_rows_are_refused(tmp_path, mano_dir):
    trees.taco(tmp_path, scene(), False)
    for path in tmp_path.rglob("tool_*.npy"):
        np.save(path, np.load(path).swapaxes(-1, -2))
    known = ReaderOptions(mano_dir=mano_dir)
    with pytest.raises(InputError, match=r"object's poses must have 0 0 0 1 as last row"):
        read_one("taco", tmp_path, known, "_stir__spoon__bowl_/20230917_001_tool")


def test_frames_without_the_object_are_left_out_at_their_times(tmp_path, mano_dir):
    """A moment that was dropped moves the numbers of later frames, but not their times."""
    whole = scene()
    hot3d(tmp_path, whole, False)
    hands = next(tmp_path.rglob("*.jsonl"))
    table = hands.with_name("dynamic_objects.csv")
    for path, dropped in ((hands, slice(4, 6)), (table, slice(1 + 4 * 6, 5 + 4 * 6))):
        lines = path.read_text().splitlines()
        del lines[dropped]  # the third moment of the hands, and the object in the seventh
        path.write_text("\n".join(lines))
    source, options = source_named("hot3d"), ReaderOptions(mano_dir=mano_dir)
    (clip,) = find_clips(source, [tmp_path])
    spans = slice(0, 6), slice(7, 9)
    for span, found in zip(spans, read_clip(source, clip, options), strict=True):
        places = found.sequence.object.translation[:, 0].numpy()
        np.testing.assert_allclose(places, whole.shift[span], atol=1e-5)


def test_links_to_folders_are_followed_and_each_folder_is_read_once(tmp_path):
    """Clips behind links, as where parts of a data set are on another disk, were passed over."""
    for name in ("here/s1/a.npz", "elsewhere/b.npz"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).touch()
    (tmp_path / "here/linked").symlink_to(tmp_path / "elsewhere")
    (tmp_path / "here/again").symlink_to(tmp_path / "here")
    (tmp_path / "here/a").symlink_to(tmp_path / "here/s1")
    found = list(paths_matching(tmp_path / "here", "*.npz"))
    assert found == [tmp_path / "here/linked/b.npz", tmp_path / "here/s1/a.npz"]
    assert list(paths_matching(tmp_path / "here", "s1/")) == [tmp_path / "here/s1"]
