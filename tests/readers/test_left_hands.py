"""Two left hands of MANO: equal betas mean different hands, and each source says which."""

import pickle

import numpy as np
import pytest
import torch
import trees
from trees import FLIP, scene

from geneoh.readers.base import ReaderOptions
from geneoh.readers.npz.files import load, save_sequence
from geneoh.readers.recordings import read_one

TARGET = "_stir__spoon__bowl_/20230917_001_target"


@pytest.fixture(scope="module")
def mended_dir(tmp_path_factory):
    """A folder whose owner has mended the left file already."""
    folder = trees.write_mano(tmp_path_factory.mktemp("mended"))
    left = trees.mano_arrays("left")
    left["shapedirs"] = left["shapedirs"] * FLIP[:, None]
    (folder / "MANO_LEFT.pkl").write_bytes(pickle.dumps(left))
    return folder


@pytest.mark.parametrize("mended", [False, True])
@pytest.mark.parametrize(
    ("source", "build", "left", "name"),
    [
        ("taco", trees.taco, "as shipped", "mano-as-shipped"),
        ("hawor", trees.hawor, "mirrored", "mano"),
        ("dynhamr", trees.dynhamr, "mirrored", "mano"),
    ],
)
def test_whose_left_hand_it_is_does_not_depend_on_the_users_file(
    source, build, left, name, mended, tmp_path, mano_dir, mended_dir
):
    s = scene(left)
    build(tmp_path, s, False)
    known = ReaderOptions(mano_dir=mended_dir if mended else mano_dir)
    chosen = TARGET if source == "taco" else None
    hand = read_one(source, tmp_path, known, chosen).sequence.hand("left")
    assert hand.hand_model == name
    wanted = torch.from_numpy(s.joints["left"]).float()
    torch.testing.assert_close(hand.joints, wanted, atol=1e-5, rtol=0)


def test_equal_betas_of_the_two_left_hands_are_different_hands():
    shipped, mirrored = (scene(left).joints["left"] for left in ("as shipped", "mirrored"))
    assert np.abs(shipped - mirrored).max() > 1e-3


def test_each_hands_model_comes_back_from_the_file(tmp_path, mano_dir):
    trees.grab(tmp_path, scene(), False)
    sequence = read_one("grab", tmp_path / "grab", ReaderOptions(mano_dir=mano_dir)).sequence
    save_sequence(sequence, tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as file:
        assert str(file["hand_model"]) == "mano-as-shipped"
    again = load(tmp_path / "a.npz")
    models = {hand.side: hand.hand_model for hand in again.hands}
    assert models == {"right": "mano", "left": "mano-as-shipped"}
