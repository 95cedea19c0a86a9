"""Which files may be replaced: our own, and no file of others."""

import io
import os
import zipfile

import numpy as np
import pytest

from geneoh.errors import InputError
from geneoh.files.atomic import write_whole
from geneoh.files.npz import member, write_archive
from geneoh.files.outputs import check_outputs, is_ours
from geneoh.geometry.mesh_files import load_mesh


def test_only_regular_files_are_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe.npz")
    (tmp_path / "folder.npz").mkdir()
    (tmp_path / "null.npz").symlink_to(os.devnull)
    (tmp_path / "loop.npz").symlink_to("loop.npz")
    for name, words in {
        "pipe.npz": "got a pipe",
        "folder.npz": "got a folder",
        "null.npz": "got a device",
        "loop.npz": "expected a regular file",
    }.items():
        with pytest.raises(InputError, match=words):
            write_whole(tmp_path / name, "text")
        with pytest.raises(InputError, match=words):
            check_outputs([tmp_path / name], overwrite=True)
    assert len(os.listdir(tmp_path)) == 4


def test_a_link_is_written_through(tmp_path):
    (tmp_path / "link.txt").symlink_to("target.txt")
    write_whole(tmp_path / "link.txt", "text")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "target.txt").read_text() == "text"
    assert sorted(os.listdir(tmp_path)) == ["link.txt", "target.txt"]


def test_what_lies_in_a_folder_that_is_read_is_replaced_only_if_it_is_ours(tmp_path):
    (tmp_path / "sub").mkdir()
    np.savez(tmp_path / "sub/theirs.npz", a=1)
    write_archive(tmp_path / "sub/ours.npz", {"format": np.array("geneoh-sequence")})
    check_outputs([tmp_path / "sub/ours.npz", tmp_path / "new.npz"], inputs=[tmp_path])
    with pytest.raises(InputError, match="is an input"):
        check_outputs([tmp_path / "sub/theirs.npz"], inputs=[tmp_path], overwrite=True)


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("a.npz", b""),
        ("a.npz", b"PK\x05\x06" + b"\0" * 18),
        ("a.npz", b"PK\x03\x04 damaged"),
        ("a.html", b"<!doctype html><title>mine</title>"),
        ("a.png", b"\x89PNG\r\n\x1a\n"),
        ("a.mp4", b"\0\0\0\x08ftyp"),
        ("a.txt", b"geneoh"),
    ],
)
def test_a_file_of_others_is_not_ours(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    assert not is_ours(tmp_path / name)


def test_what_a_user_wrote_in_our_format_is_not_ours(tmp_path):
    ours = {"format": np.array("geneoh-sequence"), "version": np.array(1)}
    np.savez(tmp_path / "theirs.npz", **ours)
    write_archive(tmp_path / "ours.npz", ours)
    assert not is_ours(tmp_path / "theirs.npz")
    assert is_ours(tmp_path / "ours.npz")
    with pytest.raises(InputError, match="was not written by geneoh"):
        check_outputs([tmp_path / "theirs.npz"])


def test_pickles_in_an_archive_are_never_opened(tmp_path):
    for name, value in (("a.npz", np.array([print], dtype=object)), ("b.npz", np.zeros(10**6))):
        raw = io.BytesIO()
        np.save(raw, value, allow_pickle=True)
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr(member("format"), raw.getvalue())
        assert not is_ours(tmp_path / name)


def test_a_folder_to_make_that_is_there_is_refused_with_what_was_expected(tmp_path):
    (tmp_path / "frames").mkdir()
    with pytest.raises(InputError, match="expected a new folder, got one that is there"):
        check_outputs([], folders=[tmp_path / "frames"], overwrite=True)


def test_a_long_name_can_be_written_and_one_that_is_too_long_is_refused(tmp_path):
    write_whole(tmp_path / f"{'a' * 251}.npz", "text")
    check_outputs([tmp_path / f"{'a' * 300}.npz"])
    with pytest.raises(InputError, match="cannot be written"):
        write_whole(tmp_path / f"{'a' * 300}.npz", "text")
    with pytest.raises(InputError, match="cannot be read"):
        load_mesh(tmp_path / f"{'a' * 300}.obj")
