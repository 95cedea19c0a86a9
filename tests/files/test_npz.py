import contextlib
import io
import os
import pickle
import zipfile
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from geneoh.errors import ConfigError, InputError
from geneoh.files import npz
from geneoh.files.npz import read_archive, write_archive
from geneoh.files.values import read_values

ARRAYS = {
    "numbers": np.arange(24, dtype=np.float32).reshape(2, 3, 4),
    "columns": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
    "flags": np.array([True, False]),
    "word": np.array("left"),
    "one": np.array(30.0),
    "none": np.zeros((0, 3)),
}


def test_arrays_come_back_with_shape_and_kind(tmp_path):
    write_archive(tmp_path / "a.npz", ARRAYS)
    read = read_archive(tmp_path / "a.npz")
    assert read.keys() == ARRAYS.keys()
    for name, array in ARRAYS.items():
        assert read[name].dtype == array.dtype
        np.testing.assert_array_equal(read[name], array, strict=True)
        assert read[name].flags.writeable


def test_a_file_of_torch_is_told_as_such(tmp_path):
    torch.save({"hand_pose": torch.zeros(2)}, tmp_path / "a.pt")
    with pytest.raises(InputError, match=r"got a file of torch.save; .*--from"):
        read_archive(tmp_path / "a.pt")


def test_a_pickle_is_told_what_opens_it(tmp_path):
    (tmp_path / "a.pkl").write_bytes(pickle.dumps({"hand_pose": np.zeros(2)}))
    with pytest.raises(InputError, match=r"got a pickle, which is never run; .*--from hamer"):
        read_archive(tmp_path / "a.pkl")


def test_numpy_reads_what_is_written_and_the_other_way(tmp_path):
    write_archive(tmp_path / "ours.npz", ARRAYS)
    np.savez(tmp_path / "plain.npz", **ARRAYS)
    np.savez_compressed(tmp_path / "packed.npz", **ARRAYS)
    with np.load(tmp_path / "ours.npz", allow_pickle=False) as theirs:
        for name in ARRAYS:
            np.testing.assert_array_equal(theirs[name], ARRAYS[name])
    for name in ("plain", "packed"):
        read = read_archive(tmp_path / f"{name}.npz")
        np.testing.assert_array_equal(read["columns"], ARRAYS["columns"])


def test_equal_arrays_give_equal_bytes(tmp_path):
    write_archive(tmp_path / "a.npz", ARRAYS)
    write_archive(tmp_path / "b.npz", {name: array.copy() for name, array in ARRAYS.items()})
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_a_failed_write_keeps_the_old_file_and_leaves_no_other(tmp_path, monkeypatch):
    path = tmp_path / "a.npz"
    write_archive(path, ARRAYS)
    before = path.read_bytes()

    def interrupted(_: np.ndarray) -> bytes:
        raise KeyboardInterrupt

    monkeypatch.setattr(npz, "encode_array", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_archive(path, ARRAYS)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["a.npz"]


def test_objects_are_not_written(tmp_path):
    with pytest.raises(ValueError, match="Object arrays"):
        write_archive(tmp_path / "a.npz", {"a": np.array({}, dtype=object)})
    assert os.listdir(tmp_path) == []


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(InputError, match=r"nowhere/a\.npz: cannot be written"):
        write_archive(tmp_path / "nowhere" / "a.npz", ARRAYS)


def test_a_folder_is_no_archive(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_archive(tmp_path)


def test_an_archive_too_large_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "a.npz", zeros=np.zeros(2**20, np.uint8))
    monkeypatch.setenv("GENEOH_MAX_BYTES", str(2**20))
    monkeypatch.setattr(npz, "decode_array", lambda *_: pytest.fail("was unpacked"))
    with pytest.raises(InputError, match=r"at most 0\.00105 GB.*GENEOH_MAX_BYTES"):
        read_archive(tmp_path / "a.npz")


def test_single_bytes_are_counted_as_the_float64_that_readers_make_of_them(tmp_path, monkeypatch):
    np.savez_compressed(tmp_path / "a.npz", **{name: np.zeros(2**20, np.uint8) for name in "abc"})
    monkeypatch.setenv("GENEOH_MAX_BYTES", str(27 * 2**20))
    with pytest.raises(InputError, match=r"declare 0\.0283 GB"):
        read_archive(tmp_path / "a.npz")
    monkeypatch.setenv("GENEOH_MAX_BYTES", str(28 * 2**20))
    assert set(read_archive(tmp_path / "a.npz")) == set("abc")


@pytest.mark.parametrize("budget", ["2 GB", "-1", "", "1e9"])
def test_a_budget_that_is_no_number_of_bytes_is_refused(tmp_path, monkeypatch, budget):
    write_archive(tmp_path / "a.npz", ARRAYS)
    monkeypatch.setenv("GENEOH_MAX_BYTES", budget)
    with pytest.raises(ConfigError, match="GENEOH_MAX_BYTES must be a whole number of bytes"):
        read_archive(tmp_path / "a.npz")


def test_a_pipe_or_a_device_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "a.npz")
    for path in (tmp_path / "a.npz", Path("/dev/zero")):
        with pytest.raises(InputError, match="must be a regular file, got a pipe or a device"):
            read_archive(path)


def test_a_member_is_never_unpacked_beyond_its_declared_size(tmp_path):
    np.savez_compressed(tmp_path / "a.npz", zeros=np.zeros(2**20, np.uint8))
    data = (tmp_path / "a.npz").read_bytes()
    size = (2**20 + 128).to_bytes(4, "little")
    assert data.count(size) >= 1
    (tmp_path / "a.npz").write_bytes(data.replace(size, (200).to_bytes(4, "little")))
    with pytest.raises(InputError, match="damaged"):
        read_archive(tmp_path / "a.npz")


@pytest.mark.filterwarnings("ignore:Duplicate name:UserWarning")
def test_a_field_that_is_there_twice_is_refused(tmp_path):
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(3))
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as file:
        file.writestr("joints.npy", buffer.getvalue())
        file.writestr("joints.npy", buffer.getvalue())
    with pytest.raises(InputError, match="'joints' twice"):
        read_archive(tmp_path / "a.npz")


@given(at=st.integers(0, 10**6), value=st.integers(0, 255), cut=st.integers(0, 10**6))
def test_a_damaged_archive_is_refused_or_read_but_never_crashes(
    tmp_path_factory, at: int, value: int, cut: int
):
    path = Path(tmp_path_factory.mktemp("damaged")) / "a.npz"
    np.savez(path, **ARRAYS)
    data = bytearray(path.read_bytes())
    data[at % len(data)] = value
    path.write_bytes(data[: len(data) - cut % 8])
    with contextlib.suppress(InputError):
        read_archive(path)


def test_a_header_that_is_no_python_literal_is_refused(tmp_path):
    np.savez(tmp_path / "good.npz", joints=np.zeros(3))
    with zipfile.ZipFile(tmp_path / "good.npz") as good:
        raw = good.read("joints.npy")
    for wrong in (b"{'descr': '<f8', (", b"{'descr': '<f8\x00'"):
        with zipfile.ZipFile(tmp_path / "bad.npz", "w") as bad:
            bad.writestr("joints.npy", raw[:10] + wrong + raw[10 + len(wrong) :])
        with pytest.raises(InputError, match="no readable array header"):
            read_archive(tmp_path / "bad.npz")


@pytest.mark.parametrize(
    ("start", "words"),
    [
        (
            b"version https://git-lfs.github.com/spec/v1\noid",
            "Git LFS; .*git lfs pull",
        ),
        (b"\n<!DOCTYPE html>\n<html>", "a web page; give the file itself"),
        (b"#ROSBAG V2.0\n", "a ROS bag; export what it holds of hands or objects as CSV or JSON"),
        (b"\x89MCAP0\r\n", "a ROS bag; export what"),
        (b"SQLite format 3\0", "a database of SQLite, as a ROS bag may be; export what"),
        (b"\x1f\x8b\x08\x00", "a gzip file; unpack it"),
        (b"HIERARCHY\nROOT Hips", "an animated skeleton; export the places of the hand.s joints"),
        (b"\x89PNG\r\n", "a picture, film or document; give the 3D hands"),
        (b"\0\0\0\x20ftypisom", "a picture, film or document; give the 3D hands"),
    ],
)
def test_what_is_often_there_instead_of_an_npz_is_told_with_what_to_do(start, words, tmp_path):
    (tmp_path / "a.npz").write_bytes(start)
    with pytest.raises(InputError, match=words):
        read_archive(tmp_path / "a.npz")


def test_a_zip_of_other_files_is_to_be_unpacked(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("track.npz", b"")
    with pytest.raises(InputError, match=r"a zip of 'track\.npz'; unpack it"):
        read_archive(tmp_path / "a.npz")


def test_an_empty_file_is_called_empty(tmp_path):
    (tmp_path / "hand.npz").touch()
    for read in (read_archive, read_values):
        with pytest.raises(InputError, match=r"hand\.npz: .* got an empty file; write or copy it"):
            read(tmp_path / "hand.npz")
