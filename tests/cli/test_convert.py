"""`geneoh convert` as its users run it."""

import json

import numpy as np

from geneoh.readers.joint_orders import ORDERS
from geneoh.readers.registry import SOURCES


def write_landmarks(path, scale=1.0):
    with np.load("taco.npz") as arrays:
        points = scale * arrays["left_joints"][:5]
    frames = [{"points": p.tolist()} for p in points]
    value = {"format": "geneoh-landmarks", "version": 1, "order": "openpose", "fps": 30}
    path.write_text(json.dumps({**value, "hands": {"left": frames}}))


def test_help_names_every_source_with_its_licence(geneoh):
    result = geneoh("convert", "--help")
    for words in ("hoi4d: HOI4D", "CC BY-NC 4.0", "dex-ycb.github.io", "--check", *ORDERS):
        assert words in result.output
    for source in SOURCES.values():
        for words in (source.name, source.title, source.licence, source.where):
            assert words in " ".join(result.output.split())


def test_clips_are_converted_told_and_not_done_twice(geneoh, tmp_path, pytestconfig):
    (tmp_path / "taco.npz").symlink_to(pytestconfig.rootpath / "examples/taco_clean.npz")
    (tmp_path / "in").mkdir()
    write_landmarks(tmp_path / "in/good.json")
    write_landmarks(tmp_path / "in/large.json", 1000)
    (tmp_path / "in/bad.json").write_text("{")
    result = geneoh("convert", "landmarks", "in", "-o", "out", code=2)
    assert "found 3 clips" in result.output
    assert "bad: not read, " in result.output
    assert "millimetres" in result.output
    assert "1 read, 2 not, 1 sequence written to out" in result.output
    assert [path.name for path in (tmp_path / "out").glob("*.npz")] == ["good.npz"]
    again = geneoh("convert", "landmarks", "in", "-o", "out", code=2)
    assert "1 done before" in again.output
    checked = geneoh("convert", "landmarks", "in/large.json", "--check", code=2)
    assert "contradicts its convention" in checked.output


def test_somewhere_to_write_or_a_check_is_needed(geneoh, tmp_path):
    (tmp_path / "a.json").write_text("{}")
    result = geneoh("convert", "landmarks", "a.json", code=2)
    assert "give -o DIR" in result.output
