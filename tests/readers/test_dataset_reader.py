"""What all readers share: files of one clip that do not belong together are refused."""

import numpy as np
import pytest
import trees
from trees import scene

from geneoh.errors import InputError
from geneoh.readers.base import ReaderOptions
from geneoh.readers.recordings import read_one


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
