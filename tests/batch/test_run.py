"""Batches: going on after any kind of stop, and what never stops them."""

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import fake_cleaning
import numpy as np
import pytest

from geneoh.errors import CheckpointError, ConfigError, InputError
from geneoh.files import atomic
from geneoh.files.journal import CLEANED, only_run_in
from geneoh.pipeline.options import Options

RUN = """
import sys
from pathlib import Path
import fake_cleaning
from geneoh.batch import run
from geneoh.batch.cleaning import BatchOptions
from geneoh.batch.clips import find_batch_clips

if __name__ == "__main__":
    run.clean_clip = fake_cleaning.clean_clip
    batch = BatchOptions(Path(sys.argv[2]))
    clips = find_batch_clips([Path(sys.argv[1])], None, batch.folder)
    run.clean_batch(clips, batch, jobs=2)
"""


def results(folder):
    """The bytes of all results and summaries."""
    paths = [*folder.rglob("*.npz"), *folder.glob("summary.*")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def states(folder):
    """What the journal says of each clip."""
    lines = [json.loads(line) for line in (folder / CLEANED).read_text().splitlines()[1:]]
    return {line["clip"]: line["state"] for line in lines}


def test_every_clip_has_a_result_and_a_second_run_does_nothing(clips, clean, tmp_path):
    heard = []
    made = clean(clips, on_progress=lambda *now: heard.append(now))
    assert made.before == 0
    assert made.failed == []
    assert heard == [("clips", done, 4) for done in (1, 2, 3, 4)]
    assert states(tmp_path / "out") == dict.fromkeys(("clip0", "clip1", "clip2", "clip3"), "done")
    first = results(tmp_path / "out")
    assert len(first) == 6
    times = {path: path.stat().st_mtime_ns for path in (tmp_path / "out").glob("*.npz")}
    assert clean(clips).before == 4
    assert results(tmp_path / "out") == first
    assert {path: path.stat().st_mtime_ns for path in times} == times


def test_the_summary_tells_how_deep_two_hands_were_in_each_other(
    clips, clean, monkeypatch, tmp_path
):
    def overlapping(sequence, options):
        return replace(plain(sequence, options), hands_in_each_other=(0.02, 0.003))

    plain = fake_cleaning.denoise
    monkeypatch.setattr(fake_cleaning, "denoise", overlapping)
    clean(clips)
    told = "depth of the hands in each other, deepest: 20.0 -> 3.00 mm"
    assert told in (tmp_path / "out" / "summary.csv").read_text()


def test_the_summary_tells_what_was_assumed_of_a_file(clips, clean, caplog, tmp_path):
    with np.load(clips / "clip1.npz") as file:
        arrays = {name: file[name] for name in file if name != "fps"}
    np.savez(clips / "clip1.npz", **arrays, confidense=0)
    clean(clips)
    lines = (tmp_path / "out" / "summary.csv").read_text().splitlines()
    told = [line for line in lines if "30 frames a second assumed; --fps says otherwise" in line]
    assert [line.partition(",")[0] for line in told] == ["clip1"]
    assert "'confidense' is not read; is it 'confidence'?" in told[0]
    assert "assumed" not in caplog.text


def test_the_summary_links_a_file_whose_name_is_in_an_old_encoding(clips, clean, tmp_path):
    (clips / "clip0.npz").rename(clips / os.fsdecode(b"caf\xe9.npz"))
    clean(clips)
    assert '<a href="caf%E9.npz">caf?</a>' in (tmp_path / "out" / "summary.html").read_text()


@pytest.mark.slow
def test_processes_give_the_bits_of_one_and_survive_a_killed_one(clips, clean, tmp_path):
    clean(clips, "one")
    (clips / "clip2.kill").touch()
    made = clean(clips, "two", jobs=2)
    (lost,) = made.failed
    assert lost.clip == "clip2"
    assert "ended by SIGKILL" in lost.failed
    assert states(tmp_path / "two")["clip2"] == "failed"
    (clips / "clip2.kill").unlink()
    made = clean(clips, "two")
    assert (made.before, made.failed) == (3, [])
    assert results(tmp_path / "two") == results(tmp_path / "one")


def test_a_bad_clip_is_told_and_the_others_go_on(clips, clean, monkeypatch, tmp_path):
    (clips / "clip0.npz").write_bytes(b"PK nothing")

    denoise = fake_cleaning.denoise

    def broken(sequence, options):
        if "clip1" in sequence.source:
            raise ZeroDivisionError("a defect")
        return denoise(sequence, options)

    monkeypatch.setattr(fake_cleaning, "denoise", broken)
    bad, defect = clean(clips).failed
    assert bad.failed.startswith(f"{clips / 'clip0.npz'}: ")
    assert defect.failed == f"{clips / 'clip1.npz'}: unexpected ZeroDivisionError: a defect"
    assert sorted(path.name for path in (tmp_path / "out").glob("*.npz")) == [
        *("clip2.npz", "clip3.npz")
    ]


def test_weights_that_are_missing_end_the_run(clips, clean, monkeypatch):
    def without(sequence, options):
        raise CheckpointError("motion.safetensors: missing")

    monkeypatch.setattr(fake_cleaning, "denoise", without)
    with pytest.raises(CheckpointError):
        clean(clips)


def test_a_mesh_that_is_named_from_the_working_folder_is_found_again(clips, clean, monkeypatch):
    monkeypatch.chdir(clips)
    for before in (0, 4):
        assert clean(clips, meshes=(Path("clip0.obj"),)).before == before


@pytest.mark.parametrize("poses_in", ["poses.npy", "ob_in_cam"])
def test_clips_whose_poses_of_the_object_changed_are_done_again(
    poses_in, clips, clean, monkeypatch
):
    monkeypatch.chdir(clips)
    arrays = dict(np.load("clip0.npz"))
    poses = np.tile(np.eye(4), (len(arrays["object_rotation"]), 1, 1))
    for name in ("object_rotation", "object_translation"):
        arrays.pop(name)
    np.savez("bare.npz", **arrays)
    for place, before in ((0.0, 0), (0.0, 1), (0.01, 0)):
        if place or not Path(poses_in).exists():
            poses[:, 0, 3] = place
            write_poses(Path(poses_in), poses)
        made = clean(clips / "bare.npz", reading={"object_pose": Path(poses_in)})
        assert (made.before, made.failed) == (before, [])


def write_poses(place, poses):
    """Poses in a npy, or in a folder with a text for each frame."""
    if place.suffix:
        np.save(place, poses)
        return
    place.mkdir(exist_ok=True)
    for frame, pose in enumerate(poses):
        np.savetxt(place / f"{frame:06d}.txt", pose)


def test_what_changed_and_what_is_missing_is_done_again(clips, clean, tmp_path):
    clean(clips)
    whole = results(tmp_path / "out")
    (tmp_path / "out" / "clip1.npz").unlink()
    (tmp_path / "out" / "clip2.npz").write_bytes(whole["clip3.npz"])
    os.utime(clips / "clip0.npz")  # the same bytes at another time
    assert clean(clips).before == 2
    assert results(tmp_path / "out") == whole
    fake_cleaning.write_clips(clips / "new", 2)
    (clips / "new" / "clip1.npz").replace(clips / "clip0.npz")
    (clips / "clip3.obj").write_text((clips / "clip3.obj").read_text().replace("0.03", "0.031"))
    for path in (clips / "new").iterdir():
        path.unlink()
    assert clean(clips).before == 2
    changed = results(tmp_path / "out")
    assert {name for name in whole if whole[name] != changed[name]} >= {"clip0.npz", "clip3.npz"}
    assert changed["clip1.npz"] == whole["clip1.npz"]


def test_other_settings_are_refused_with_what_differs(clips, clean, tmp_path):
    clean(clips)
    before = results(tmp_path / "out")
    with pytest.raises(ConfigError, match=r"options\.seed 0 where 3 is asked for"):
        clean(clips, options=Options(seed=3))
    with pytest.raises(ConfigError, match=r"reading\.fps none where 60\.0 is asked for"):
        clean(clips, reading={"fps": 60.0})
    assert results(tmp_path / "out") == before
    assert clean(clips).before == 4


def test_other_settings_may_follow_a_run_that_cleaned_nothing(clips, clean):
    for path in clips.glob("*.npz"):
        fields = dict(np.load(path))
        del fields["side"], fields["fps"]
        np.savez(path, **fields)
    assert len(clean(clips).failed) == 4
    assert clean(clips, reading={"side": "right", "fps": 60.0}).failed == []


def test_a_clip_does_not_replace_the_result_of_another_one_of_its_name(clips, clean, tmp_path):
    clean(clips / "clip0.npz")
    (clips / "moved").mkdir()
    shutil.copy(clips / "clip0.npz", clips / "moved")
    assert clean(clips / "moved" / "clip0.npz").failed == []
    before = results(tmp_path / "out")
    (clips / "new").mkdir()
    np.savez(clips / "new" / "clip0.npz", **np.load(clips / "clip0.npz"), more=1)
    with pytest.raises(InputError, match=r"its name 'clip0' is that of the result of .*/clip0.npz"):
        clean(clips / "new" / "clip0.npz")
    assert results(tmp_path / "out") == before
    assert clean(clips / "new" / ".." / "clip0.npz").failed == []


def test_a_second_run_in_a_folder_is_refused(clips, clean, tmp_path):
    with only_run_in(tmp_path / "out"), pytest.raises(InputError, match="another run is working"):
        clean(clips)


def test_files_of_others_and_inputs_are_kept(clips, clean, tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "clip1.npz").write_bytes(b"mine")
    (failed,) = clean(clips).failed
    assert "was not written by geneoh" in failed.failed
    assert (tmp_path / "out" / "clip1.npz").read_bytes() == b"mine"
    for name in ("summary.csv", "journal.jsonl"):
        (tmp_path / f"with {name}").mkdir()
        (tmp_path / f"with {name}" / name).write_text("mine")
        with pytest.raises(InputError, match=f"{name}: is there already and was not written by"):
            clean(clips, f"with {name}")
        assert (tmp_path / f"with {name}" / name).read_text() == "mine"
    with pytest.raises(InputError, match="is an input and never replaced"):
        clean(clips / "clip1.npz", "in")


def test_a_full_disk_ends_the_run_in_a_sentence_and_it_goes_on(clips, clean, monkeypatch, tmp_path):
    clean(clips, "whole")
    write, calls = os.fsync, []

    def full(descriptor):
        calls.append(descriptor)
        if len(calls) == 4:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        write(descriptor)

    monkeypatch.setattr(atomic.os, "fsync", full)
    with pytest.raises(InputError, match=r"cannot be written \(No space left on device\)"):
        clean(clips)
    monkeypatch.undo()
    done = [name for name, state in states(tmp_path / "out").items() if state == "done"]
    assert len(done) == 1
    assert not list((tmp_path / "out").glob(".*.tmp"))
    monkeypatch.setattr("geneoh.batch.cleaning.denoise", fake_cleaning.denoise)
    assert clean(clips).before == 1
    assert results(tmp_path / "out") == results(tmp_path / "whole")


def test_a_folder_that_cannot_be_made_is_told(clips, clean, tmp_path):
    (tmp_path / "taken").write_text("")
    with pytest.raises(InputError, match=r"taken: cannot be written"):
        clean(clips, "taken")


@pytest.mark.slow
def test_a_batch_that_is_killed_loses_nothing_that_was_done(clips, clean, tmp_path):
    clean(clips, "whole")
    whole, out = results(tmp_path / "whole"), tmp_path / "out"
    killed_when_done(clips, out, 1, pause="0.5")
    done = [name for name, state in states(out).items() if state == "done"]
    assert done
    assert all((out / f"{name}.npz").read_bytes() == whole[f"{name}.npz"] for name in done)
    assert clean(clips).before >= len(done)
    assert results(out) == whole


def killed_when_done(clips, out, count, pause):
    """Run a batch in two workers and kill it when the journal says that so many clips are done."""
    support = Path(fake_cleaning.__file__).parent
    script = out.parent / "run.py"
    script.write_text(RUN)
    environment = {**os.environ, "PYTHONPATH": str(support), fake_cleaning.PAUSE: pause}
    with subprocess.Popen([sys.executable, script, clips, out], env=environment) as process:
        end = time.monotonic() + 120
        while not ((out / CLEANED).exists() and list(states(out).values()).count("done") >= count):
            assert time.monotonic() < end
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGKILL)
