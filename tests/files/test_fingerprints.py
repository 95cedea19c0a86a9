"""Whether files are as they were."""

import pytest

from geneoh.errors import InputError
from geneoh.files.fingerprints import file_digest, fingerprint, fingerprints, is_unchanged


@pytest.mark.parametrize("clip", ["seq/a__0.pkl", "seq", "seq/a"])
def test_a_file_a_folder_and_a_beginning_of_names_tell_what_changed(tmp_path, clip):
    (tmp_path / "seq").mkdir()
    for name in ("a__0.pkl", "a__1.pkl"):
        (tmp_path / "seq" / name).write_text(name)
    known = {clip: fingerprint(tmp_path / clip)}
    assert is_unchanged(known, tmp_path)
    (tmp_path / "seq/a__0.pkl").write_text("something else")
    assert not is_unchanged(known, tmp_path)


def test_what_is_at_another_path_has_no_fingerprint_of_its_own(tmp_path):
    (tmp_path / "seq").mkdir()
    for name in ("seq/a.npy", "b__0.pkl", "b__1.pkl", "c.npz", "cc.npz"):
        (tmp_path / name).write_text(name)
    given = ["seq", "seq/a.npy", "b", "b__1.pkl", "c.npz", "cc.npz"]
    found = fingerprints(tmp_path / name for name in given)
    assert list(found) == [str(tmp_path / name) for name in ("b", "c.npz", "cc.npz", "seq")]
    assert found[str(tmp_path / "b")] == fingerprint(tmp_path / "b")


def test_what_is_not_there_has_no_fingerprint(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        fingerprint(tmp_path / "nothing")
    assert not is_unchanged({"nothing": "0 0"}, tmp_path)


def test_a_digest_tells_contents_and_not_order(tmp_path):
    for name, text in (("a", "1"), ("b", "2")):
        (tmp_path / name).write_text(text)
    paths = [tmp_path / "a", tmp_path / "b"]
    first = file_digest(paths)
    assert file_digest(reversed(paths)) == first
    (tmp_path / "b").write_text("3")
    assert file_digest(paths) != first
