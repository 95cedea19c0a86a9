"""The caller's poses of the object, out of a folder of texts."""

import re

import numpy as np
import pytest

from geneoh.errors import InputError
from geneoh.readers.foreign_files import read_poses


def pose(number: int) -> np.ndarray:
    """A pose that tells the number of its frame."""
    found = np.eye(4)
    found[0, 3] = number
    return found


def test_texts_of_a_folder_are_frames_in_the_order_of_their_numbers(tmp_path):
    for number in (2, 10, 3, 5):
        np.savetxt(tmp_path / f"{number}.txt", pose(number).reshape(1 if number == 3 else 4, -1))
    poses, first = read_poses(tmp_path)
    assert first == 2
    assert poses.shape == (9, 4, 4)
    known = np.isfinite(poses).all((1, 2))
    assert np.flatnonzero(known).tolist() == [0, 1, 3, 8]
    assert poses[known, 0, 3].tolist() == [2, 3, 5, 10]


def test_texts_that_are_named_by_times_come_one_after_the_other(tmp_path):
    for number, time in enumerate((1581120424100262102, 1581120424148532296, 9581120424)):
        np.savetxt(tmp_path / f"{time}.txt", pose(number))
    poses, first = read_poses(tmp_path)
    assert (poses[:, 0, 3].tolist(), first) == ([2, 0, 1], 0)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("0.npy", "", ": expected a text of a 4x4 matrix for each frame, such as 000000.txt"),
        ("notes.txt", "1 2 3", "notes.txt: expected a frame's number as the name"),
        ("0.txt", "1 2 3", "0.txt: expected rows of 4 or 16 numbers"),
        ("0.txt", "1 0 0 0\n" * 3, "0.txt: expected a 4x4 matrix, got 3 rows"),
    ],
)
def test_a_folder_of_other_files_is_refused_by_its_file(tmp_path, name, text, words):
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=re.escape(words)):
        read_poses(tmp_path)


@pytest.mark.parametrize("ending", [".txt", ".csv", ".json"])
def test_a_text_of_all_poses_is_refused_with_what_to_save(tmp_path, ending):
    path = tmp_path / f"poses{ending}"
    np.savetxt(path, np.tile(np.eye(4).ravel(), (3, 1)))
    with pytest.raises(InputError, match=rf"a npy file of .* got a {ending} file; .* numpy\.save"):
        read_poses(path)


@pytest.mark.parametrize(
    "text", ["0\n0\n0.5\n0\n0\n0\n1\n", "1,0,0,0\n0,1,0,0\n0,0,1,0\n0,0,0,1\n"]
)
def test_texts_of_other_numbers_are_not_called_damaged(tmp_path, text):
    (tmp_path / "0.txt").write_text(text)
    with pytest.raises(InputError, match="write the 16 numbers of a 4x4 matrix with spaces"):
        read_poses(tmp_path)
